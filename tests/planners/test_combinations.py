"""The first combination that nothing excludes, against all of the product."""

from __future__ import annotations

from itertools import combinations, product

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from symgrasp.planners.combinations import first_combination, members


def test_members_of_a_set():
    assert list(members(0b101001)) == [0, 3, 5]
    assert not list(members(0))


@given(st.integers(0, 2**32 - 1), st.integers(1, 4), st.sampled_from([0.3, 0.6, 0.9]))
def test_against_the_whole_product(seed, variables, density):
    rng = np.random.default_rng(seed)
    counts = rng.integers(1, 5, variables).tolist()
    left = [int(rng.integers(0, 1 << count)) for count in counts]
    together = {
        (j, k): rng.random((counts[j], counts[k])) < density
        for j, k in combinations(range(variables), 2)
        if rng.random() < 0.8
    }
    three = [scope for scope in combinations(range(variables), 3) if rng.random() < 0.5]
    excluded = {
        scope: {tuple(int(rng.integers(counts[v])) for v in scope) for _ in range(10)} for scope in three
    }
    pairs = {
        pair: [sum(1 << k for k, good in enumerate(row) if good) for row in rows]
        for pair, rows in together.items()
    }
    expected = next(
        (
            list(chosen)
            for chosen in product(*(range(count) for count in counts))
            if all(left[v] >> i & 1 for v, i in enumerate(chosen))
            and all(rows[chosen[j], chosen[k]] for (j, k), rows in together.items())
            and not any(tuple(chosen[v] for v in scope) in excluded[scope] for scope in three)
        ),
        None,
    )
    assert first_combination(left, pairs, excluded) == expected
