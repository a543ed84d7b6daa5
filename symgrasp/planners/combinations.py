"""The first choice for each of several variables that goes with all others, by pairs that exclude each other.

A set of choices is an integer whose i-th bit says whether the i-th choice is in it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence

__all__ = ["first_combination", "members"]

Pairs = Mapping[tuple[int, int], Sequence[int]]
"""(j, k), j < k → for every choice of variable j the choices of variable k that go with it."""

Excluded = Mapping[tuple[int, ...], Collection[tuple[int, ...]]]
"""Variables in rising order → combinations of their choices that do not go together."""


def members(choices: int) -> Iterator[int]:
    """Yield the choices in a set, in rising order."""
    while choices:
        low = choices & -choices
        yield low.bit_length() - 1
        choices ^= low


def first_combination(left: Sequence[int], pairs: Pairs, excluded: Excluded) -> list[int] | None:
    """Return the first combination, in the order of a product, that nothing excludes; None if there is none.

    Args:
        left: for every variable the set of its choices.
        pairs: which choices of two variables go together; all where a pair is not given.
        excluded: combinations that do not go together for other reasons.
    """
    narrowed = _consistent(list(left), pairs)
    return _extend([], narrowed, pairs, excluded) if narrowed else None


def _consistent(left: list[int], pairs: Pairs) -> list[int] | None:
    """Leave the choices that go with some choice of every other variable; None if a variable has none."""
    before = None
    while before != left:
        before = list(left)
        for (j, k), rows in pairs.items():
            ones = others = 0
            for i in members(left[j]):
                together = rows[i] & left[k]
                if together:
                    ones |= 1 << i
                    others |= together
            left[j], left[k] = ones, others
    return left if all(left) else None


def _extend(picked: list[int], left: list[int], pairs: Pairs, excluded: Excluded) -> list[int] | None:
    """Extend choices for the first variables to all, or return None; ``left`` goes with those picked."""
    depth = len(picked)
    if depth == len(left):
        return picked
    for i in members(left[depth]):
        chosen = [*picked, i]
        if any(
            variables[-1] == depth and tuple(chosen[v] for v in variables) in combinations
            for variables, combinations in excluded.items()
        ):
            continue
        narrowed = [
            choices & pairs[depth, k][i] if k > depth and (depth, k) in pairs else choices
            for k, choices in enumerate(left)
        ]
        found = _extend(chosen, narrowed, pairs, excluded) if all(narrowed) else None
        if found:
            return found
    return None
