"""When a motion is where: as fast as limits of speed and acceleration allow, by TOPP-RA.

Every segment starts and ends at rest. In between the corners of its path are rounded, by at most half of the
clearance that was proven along it, and of the room that the object and the balance of the robots leave it;
its clearance is lowered by as much as that and the lines between rows may take.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np

from symgrasp.errors import NoPlanError, SymgraspError
from symgrasp.motion.segments import Motion, Segment
from symgrasp.motion.times.reach import joint_reach
from symgrasp.motion.times.rounding import RoundedPath, pieces
from symgrasp.poses import Array, inverse
from symgrasp.progress import Progress
from symgrasp.robot.robot import Arm
from symgrasp.scene.scene import Scene

__all__ = ["GRIP_TIME", "STEP", "load", "timed"]

STEP = 0.02
"""Longest time (s) between two rows of a segment in which arms move."""

MOST_ROWS = 2000
"""Most rows of a path between two stops, however little its lines may deviate."""

GRIP_TIME = 0.5
"""Least time (s) that a hand takes to open or close, as it also has to build up or lose its grip."""

ROUNDED_SHARE, CHORD_SHARE = 0.5, 0.2
"""Shares of how far a path may be off that rounding may take, and straight lines between rows besides."""

PARTS = (
    "matplotlib", "matplotlib.backend_bases", "matplotlib.axes", "matplotlib.projections",
    "matplotlib.pyplot", "scipy.special", "scipy.interpolate", "toppra",
)  # fmt: skip
"""What `toppra` imports, in parts that take about a fifth of a second each, and itself."""


def timed(motion: Motion, progress: Progress | None = None) -> Motion:
    """Return a motion with times.

    Speeds and accelerations are differences of the rows: they stay within what the URDF says of speeds, and
    the scene of accelerations. Joints of hands have a limit of speed only.

    Args:
        motion: the motion, timed or not.
        progress: called with the finished share; may raise `Cancelled`.

    Raises:
        SymgraspError: toppra is not installed.
        NoPlanError: it found no times.
    """
    segments = []
    for k, segment in enumerate(motion.segments):
        if progress:
            progress(k / len(motion.segments))
        segments.append(_timed(motion, k, segment))
    return replace(motion, segments=tuple(segments))


def _timed(motion: Motion, index: int, segment: Segment) -> Segment:
    scene = motion.scene
    columns = _columns(scene, segment)
    rows = np.column_stack([segment.joints[arm][:, j] for arm, j, *_ in columns])
    off = min(segment.clearance, segment.room)
    weight = _weights(motion, index, columns)
    if segment.tilt_room < np.inf:  # an angle counts as the distance that is the same share of what is left
        weight = np.maximum(weight, _turning(scene, segment, columns) * off / segment.tilt_room)
    speed = np.array([limit for _, _, limit, _ in columns])
    acceleration = np.array([limit for *_, limit in columns])
    t, joined, deviation = _times(rows, weight, speed, acceleration, off)
    if deviation > off:  # too little is left for lines between rows: a stop at every corner
        t, joined, deviation = _times(rows, weight, speed, acceleration, 0.0)
    least = _hand_time(scene, segment)
    if len(t) == 1:  # only hands move
        t, joined = np.array([0.0, max(least, STEP)]), rows[[0, -1]]
    # Rounded corners stay between those of the polyline, but for rounding errors: at limits these count.
    joined = np.clip(joined, rows.min(axis=0), rows.max(axis=0))
    t *= max(1.0, least / t[-1])
    at = {(arm, j): k for k, (arm, j, *_) in enumerate(columns)}
    joints = {}
    for name, given in segment.joints.items():
        arm = scene.arms[name]
        joints[name] = joined[:, [at[_owner(scene, at, arm, j)] for j in range(given.shape[1])]]
    return replace(segment, joints=joints, times=t, clearance=segment.clearance - deviation)


def _times(
    rows: Array, weight: Array, speed: Array, acceleration: Array, off: float
) -> tuple[Array, Array, float]:
    """Return times (m,), the rows (m, n) then, and how far (m) any point is off a polyline (., n) at most.

    That is at most ``off`` (m), unless even many rows between two stops are too few.
    """
    deviation = 0.0
    times, values = [np.zeros(1)], [rows[:1]]
    for piece in pieces(rows, weight, ROUNDED_SHARE * off):
        path = RoundedPath(piece, weight, ROUNDED_SHARE * off)
        t, s = _parametrized(path, speed, acceleration, CHORD_SHARE * off)
        deviation = max(deviation, path.deviation + path.chord_deviation(s))
        times.append(times[-1][-1] + t[1:])
        values.append(path(s[1:]))
    return np.concatenate(times), np.concatenate(values), deviation


Column = tuple[str, int, float, float]
"""Arm, which of its joints, largest speed and acceleration."""


def _columns(scene: Scene, segment: Segment) -> list[Column]:
    """Return the joints that move in a segment, those that arms share once."""
    seen: set[tuple[str, int]] = set()
    columns = []
    for name in segment.joints:
        arm = scene.arms[name]
        for j, index in enumerate(arm.indices.tolist()):
            if (arm.robot.name, index) not in seen:
                seen.add((arm.robot.name, index))
                robot = arm.robot
                columns.append((name, j, float(robot.velocity[index]), robot.acceleration))
    return columns


def _owner(scene: Scene, at: Mapping[tuple[str, int], int], arm: Arm, j: int) -> tuple[str, int]:
    """Return the column that an arm's joint is in: another arm's for one that they share."""
    return next(
        (name, i)
        for name, i in at
        if scene.arms[name].robot is arm.robot and scene.arms[name].indices[i] == arm.indices[j]
    )


def _weights(motion: Motion, index: int, columns: list[Column]) -> Array:
    """Return how far (m) any point moves at most, for each unit of the joints that move in a segment."""
    scene, segment = motion.scene, motion.segments[index]
    profile = scene.profile
    corners = np.array([[0.0, 0.0, h, 1.0] for h in (profile.h_min, profile.h_max)])
    state = motion.state(index, 0, 0.0)
    held: dict[str, dict[str, float]] = {}
    for name in segment.held_by:
        arm = scene.arms[name]
        tool = arm.tool_at(state.values[arm.robot.name])
        ends = (corners @ (inverse(tool) @ state.T_world_object).T)[:, :3]
        radius = float(profile.points[:, 1].max())
        held.setdefault(arm.robot.name, {})[arm.tool] = float(np.linalg.norm(ends, axis=1).max()) + radius
    robots = {scene.arms[name].robot.name for name, *_ in columns}
    reach = {name: joint_reach(scene.robots[name].model, held.get(name)) for name in robots}
    return np.array([reach[scene.arms[arm].robot.name][scene.arms[arm].indices[j]] for arm, j, *_ in columns])


def _turning(scene: Scene, segment: Segment, columns: list[Column]) -> Array:
    """Return how far (rad) the object turns at most for each unit of the joints that move in a segment."""
    holder = scene.arms[segment.held_by[0]]
    chain = holder.robot.model.chain(holder.tool)
    turning = {joint.name for joint in chain if joint.kind != "prismatic"}
    joints = [(scene.arms[name], scene.arms[name].joint_names[j]) for name, j, *_ in columns]
    return np.array([arm.robot is holder.robot and joint in turning for arm, joint in joints], dtype=float)


def _hand_time(scene: Scene, segment: Segment) -> float:
    """Return the least time (s) that the hands of a segment take."""
    times = [0.0]
    for name, (first, last) in segment.gripper.items():
        arm = scene.arms[name]
        names, speed = arm.robot.model.joint_names, arm.robot.velocity
        values = [
            arm.hand.joint_values(float(x)) for x in np.linspace(last if first is None else first, last, 50)
        ]
        for joint in arm.hand.joints:
            k = names.index(joint)
            path = [v[joint] for v in values]
            moved = (
                49 * np.abs(np.diff(path)).max() if first is not None else abs(path[0] - arm.robot.home[k])
            )
            times.append(float(moved) / float(speed[k]))
        times.append(GRIP_TIME if first != last else 0.0)
    return 1.0001 * max(times)  # for rounding errors


def _parametrized(
    path: RoundedPath, speed: Array, acceleration: Array, tolerance: float
) -> tuple[Array, Array]:
    """Return times (m,) (s), evenly spaced from zero, and the positions (m,) along a path then.

    On straight lines between them no point is further off the path than a tolerance (m).
    """
    grid = np.unique(np.concatenate([np.linspace(a, b, 6) for a, b in _intervals(path)]))
    solved = _topp(path, grid, speed, acceleration)
    rate = 0.5 * (solved[1:] + solved[:-1])
    if not np.all(rate > 0):
        raise NoPlanError("timing: no times within the limits of speed and acceleration")
    ends = np.concatenate([[0.0], np.cumsum(np.diff(grid) / rate)])
    steps = max(4, int(np.ceil(ends[-1] / STEP)))
    t, s = _sampled(grid, solved, ends, steps)
    deviation = path.chord_deviation(s)
    if deviation > tolerance and steps < MOST_ROWS:
        finer = min(MOST_ROWS, int(np.ceil(steps * 1.1 * np.sqrt(deviation / max(tolerance, 1e-9)))))
        t, s = _sampled(grid, solved, ends, finer)
    s[0], s[-1] = 0.0, path.length
    return t * _stretch(path(s), t, speed, acceleration), s


def _sampled(grid: Array, rates: Array, ends: Array, steps: int) -> tuple[Array, Array]:
    """Return steps + 1 evenly spaced times (s), and the positions then.

    Args:
        grid: positions (k,) on the path.
        rates: ds/dt (k,) (1/s) there; between two of them the acceleration is constant.
        ends: times (k,) (s) there.
        steps: how many.
    """
    t = np.linspace(0.0, ends[-1], steps + 1)
    k = np.clip(np.searchsorted(ends, t, side="right") - 1, 0, len(grid) - 2)
    x, width = t - ends[k], np.diff(ends)[k]
    return t, grid[k] + rates[k] * x + 0.5 * (rates[k + 1] - rates[k]) / width * x * x


def _intervals(path: RoundedPath) -> list[tuple[float, float]]:
    """Return the pieces of a path, cut to at most a fiftieth of it."""
    cut = np.unique(np.concatenate([path.knots, np.linspace(0.0, path.length, 51)]))
    cut = cut[np.concatenate([np.diff(cut) > 1e-9 * path.length, [True]])]
    return list(zip(cut[:-1].tolist(), cut[1:].tolist(), strict=True))


def load(progress: Progress | None = None) -> None:
    """Import what times are computed with, part by part, as far as it is installed: that takes half a second.

    Args:
        progress: called with 0 after every part; may raise `Cancelled`.
    """
    for name in PARTS:
        with suppress(ImportError):
            import_module(name)
        if progress:
            progress(0.0)


def _topp(path: RoundedPath, grid: Array, speed: Array, acceleration: Array) -> Array:
    """Return the rates ds/dt (k,) (1/s) at positions (k,) of a path, at rest at both ends, by TOPP-RA."""
    try:
        import toppra
    except ImportError as error:
        raise SymgraspError("timing takes toppra: pip install 'symgrasp[motion]'") from error
    logging.getLogger("toppra").setLevel(logging.ERROR)
    limits: list[Any] = [
        toppra.constraint.JointVelocityConstraint(np.stack([-speed, speed], axis=1)),
        toppra.constraint.JointAccelerationConstraint(
            np.stack([-acceleration, acceleration], axis=1),
            discretization_scheme=toppra.constraint.DiscretizationType.Interpolation,
        ),
    ]
    solver = toppra.algorithm.TOPPRA(limits, _Geometric(path), gridpoints=grid, solver_wrapper="seidel")
    _, rates, *_ = solver.compute_parameterization(0.0, 0.0)
    if rates is None:
        raise NoPlanError("timing: no times within the limits of speed and acceleration")
    return rates


class _Geometric:
    """A path as toppra takes it."""

    def __init__(self, path: RoundedPath) -> None:
        self._path = path
        self.dof = path(np.zeros(1)).shape[1]
        self.path_interval = np.array([0.0, path.length])
        self.waypoints = None

    def __call__(self, path_positions: Array, order: int = 0) -> Array:
        return self._path(path_positions, order)


def _stretch(rows: Array, t: Array, speed: Array, acceleration: Array) -> float:
    """Return by which factor times (m,) must grow for the rows (m, n) to keep limits, at rest at both ends.

    TOPP-RA keeps the limits at the positions of its grid only.
    """
    step = t[1] - t[0]
    v = np.diff(rows, axis=0) / step
    a = np.concatenate([2 * v[:1], np.diff(v, axis=0), -2 * v[-1:]]) / step
    too_fast = float((np.abs(v) / speed).max())
    too_sudden = float((np.abs(a) / acceleration).max())
    return 1.0001 * max(1.0, too_fast, np.sqrt(too_sudden))
