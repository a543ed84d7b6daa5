"""The ends of windows where pieces all but touch: PyBullet decides, value by value."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from symgrasp.engine.redundancy.windows import FINEST, STEP
from symgrasp.feasibility.cell import Window

__all__ = ["settled", "with_witness"]

IsFree = Callable[[int, float], bool]
"""Whether a branch is free at a value of φ (rad)."""


def settled(
    found: Sequence[Window],
    undecided: Sequence[tuple[int, float]],
    is_free: IsFree,
    limits: tuple[float, float],
) -> tuple[Window, ...]:
    """Return windows up to their ends, by branch, then by φ.

    Args:
        found: windows up to where pieces all but touch.
        undecided: branches and values of φ (rad) that may be free besides.
        is_free: tells it.
        limits: least and largest φ (rad).
    """
    windows: list[Window] = []
    for own in found:
        if is_free(own.branch, 0.5 * (own.low + own.high)):
            low = _walk(own.branch, own.low, -1, is_free, limits)
            high = _walk(own.branch, own.high, 1, is_free, limits)
            windows.append(Window(own.branch, low, high, own.whole and (low, high) == (own.low, own.high)))
    refuted: dict[int, float] = {}
    for branch, phi in sorted(undecided):
        if any(w.branch == branch and w.low <= phi <= w.high for w in windows):
            continue
        if phi - refuted.get(branch, -1e9) < STEP:
            continue
        if is_free(branch, phi):
            low, high = (_walk(branch, phi, sign, is_free, limits) for sign in (-1, 1))
            windows.append(Window(branch, low, high, whole=False))
        else:
            refuted[branch] = phi
    return _joined(windows)


def with_witness(windows: tuple[Window, ...], witness: tuple[int, float] | None) -> tuple[Window, ...]:
    """Return windows of a cell, with one of no width at its witness where none of them holds it.

    At singular poses a branch may be free at single values of φ, between which the halving steps.

    Args:
        windows: by branch, then by φ.
        witness: branch and φ (rad) of the cell's witness, if it has one.
    """
    if witness is None:
        return windows
    branch, phi = witness
    if any(w.branch == branch and w.low - FINEST <= phi <= w.high + FINEST for w in windows):
        return windows
    return tuple(sorted((*windows, Window(branch, phi, phi, whole=True))))


def _walk(branch: int, phi: float, sign: int, is_free: IsFree, limits: tuple[float, float]) -> float:
    """Return how far φ (rad) goes one way from a free value: steps grow while it is free, then shrink."""
    step, grows = FINEST, True
    while True:
        after = min(max(phi + sign * step, limits[0]), limits[1])
        if after == phi:
            return phi
        if is_free(branch, after):
            phi, step = after, min(2 * step, STEP) if grows else step
        elif step <= FINEST:
            return phi
        else:
            step, grows = 0.5 * step, False


def _joined(windows: Sequence[Window]) -> tuple[Window, ...]:
    """Return windows with those as one that meet."""
    joined: list[Window] = []
    for own in sorted(windows):
        last = joined[-1] if joined else None
        if last is not None and last.branch == own.branch and own.low - last.high <= FINEST:
            high, whole = max(last.high, own.high), last.whole and own.whole and own.low <= last.high
            joined[-1] = last._replace(high=high, whole=whole)
        else:
            joined.append(own)
    return tuple(joined)
