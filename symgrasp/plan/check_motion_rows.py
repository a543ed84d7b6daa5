"""Whether arms and hands can follow the rows of a motion in the times that it states."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import combinations

import numpy as np

from symgrasp.plan.motion_record import SegmentRecord
from symgrasp.poses import Array
from symgrasp.robot.robot import Arm
from symgrasp.scene.scene import Scene

__all__ = ["TOLERANCE", "Expect", "check_rows"]

Expect = Callable[[object, str], bool]
"""Notes a statement, and what is wrong where it does not hold; returns whether it does."""

TOLERANCE = 1e-6
"""By how much (m, rad, s) numbers may differ that should be the same."""

LIMIT_TOLERANCE = 1e-6
"""By which share a speed or an acceleration may exceed its limit: they are differences of rounded numbers."""

OPENINGS = 50
"""At how many openings of a hand the values of its joints are compared."""


def check_rows(
    segment: SegmentRecord, start: Mapping[str, Array], scene: Scene, where: str, expect: Expect
) -> bool:
    """Check times, limits, speeds, accelerations and stated velocities of a segment.

    Args:
        segment: the segment.
        start: robot → values (N,) of all its joints where it starts.
        scene: the scene.
        where: what it is called in failures.
        expect: notes a statement.

    Returns:
        Whether all of it holds.
    """
    t = np.array(segment.times)
    if not expect(t[0] == 0 and np.all(np.diff(t) > 0), f"{where}: times do not increase from 0"):
        return False
    paths = {name: np.array(rows) for name, rows in segment.joints.items()}
    ok = all(
        [
            _check_path(scene.arms[name], t, path, np.array(segment.velocities[name]), where, expect)
            for name, path in paths.items()
        ]
    )
    for a, b in combinations(paths, 2):
        ok &= expect(
            _agree(scene.arms[a], paths[a], scene.arms[b], paths[b]), f"{where}: {a}, {b}: torsos differ"
        )
    for name, (first, last) in segment.gripper.items():
        arm = scene.arms[name]
        ok &= expect(name in paths, f"{where}: the hand of {name} moves, but the arm has no joint values")
        fits = arm.hand.min_opening - TOLERANCE <= last <= arm.hand.max_opening + TOLERANCE
        ok &= expect(fits, f"{where}: the hand of {name} does not open to {last} m")
        for joint, moved in _hand_moves(arm, first, last, start).items():
            limit = arm.robot.velocity[arm.robot.model.joint_names.index(joint)]
            text = f"{where}: the hand of {name} moves {joint} too fast"
            ok &= expect(moved / t[-1] <= limit * (1 + LIMIT_TOLERANCE), text)
    return ok


def _check_path(arm: Arm, t: Array, path: Array, velocities: Array, where: str, expect: Expect) -> bool:
    """Check the rows (m, n) of an arm at times (m,), and their stated velocities (m, n)."""
    n = len(arm.joint_names)
    step = np.diff(t)[:, None]
    between = 0.5 * (step[1:] + step[:-1])
    v = np.diff(path, axis=0) / step
    # At rest at both ends: the mean speed of a step is reached, from rest, in half of its time at the latest.
    a = np.concatenate([2 * v[:1] / step[:1], np.diff(v, axis=0) / between, -2 * v[-1:] / step[-1:]])
    slopes = np.zeros_like(path)
    slopes[1:-1] = 0.5 * (v[:-1] * step[1:] + v[1:] * step[:-1]) / between
    limit = 1 + LIMIT_TOLERANCE
    wrong = {
        "outside the limits of": (path < arm.lower[:n]) | (path > arm.upper[:n]),
        "too fast for": np.abs(v) > arm.robot.velocity[arm.indices] * limit,
        "accelerates too much for": np.abs(a) > arm.robot.acceleration * limit,
        "velocities are not those of the rows, of": np.abs(slopes - velocities) > TOLERANCE,
    }
    ok = True
    for text, bad in wrong.items():
        row, j = np.argwhere(bad)[0] if bad.any() else (0, 0)
        text = f"{where}: {arm.name}: {text} {arm.joint_names[j]} at row {row}"
        ok &= expect(not bad.any(), text)
    return ok


def _agree(arm: Arm, path: Array, other: Arm, theirs: Array) -> bool:
    """Whether the joints that two arms share have the same values in both of their paths."""
    if arm.robot is not other.robot:
        return True
    shared = [j for j in arm.joint_names if j in other.joint_names]
    own, their = ([a.joint_names.index(j) for j in shared] for a in (arm, other))
    return bool(np.all(np.abs(path[:, own] - theirs[:, their]) <= TOLERANCE))


def _hand_moves(
    arm: Arm, first: float | None, last: float, start: Mapping[str, Array]
) -> Mapping[str, float]:
    """Return joint of a hand → how far (rad or m) it would move in a segment at its largest speed."""
    end = arm.hand.joint_values(last)
    if first is None:
        names: Sequence[str] = arm.robot.model.joint_names
        return {j: abs(value - start[arm.robot.name][names.index(j)]) for j, value in end.items()}
    openings = np.linspace(first, last, OPENINGS)
    values = [arm.hand.joint_values(float(opening)) for opening in openings]
    return {j: max(abs(np.diff([v[j] for v in values]))) * (OPENINGS - 1) for j in end}
