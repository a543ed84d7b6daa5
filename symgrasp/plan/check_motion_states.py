"""Whether bodies keep their distance at every state of a motion."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from symgrasp.plan.check_motion_rows import Expect
from symgrasp.plan.motion_record import SegmentRecord
from symgrasp.poses import Array, inverse, pose_error
from symgrasp.progress import Progress
from symgrasp.scene.balance import load_of_hand, support_margin
from symgrasp.scene.scene import Scene
from symgrasp.world import BodyName, BulletWorld, Collision, near_links

__all__ = ["RIGID", "SegmentStates", "check_free", "tool_pose"]

CLEARANCE_TOLERANCE = 1e-5
"""By how much (m) a clearance may be overstated: PyBullet reads URDFs in single precision."""

RIGID = 1e-3, 0.01
"""How far (m) and how much (rad) the object may move in the hands when several hold it: between two rows
each arm follows its own straight line in joint space."""

FINEST = 5e-4
"""Shortest distance (m) between two states that are checked, where the stated clearance is shorter."""

LARGEST_TURN = 0.1
"""Largest turn (rad), or shift (m), of a joint between two states from which it is measured how far anything
moves: arcs are then hardly longer than the straight lines that are measured."""

MOST_STATES = 200_000
"""Most states of a motion that are checked."""

OFF_LINE = 2e-3, 0.02
"""How far (m) and how much (rad) a hand whose fingers may touch the object may be off the line of a grasp:
between two rows an arm follows a straight line in joint space, whose corners are rounded."""

TILT_TOLERANCE = 1e-3
"""By how much (degrees) the object may tilt beyond its limit: numbers are rounded."""

BALANCE_TOLERANCE = 1e-6
"""How far (m) a centre of mass may be outside of the support: numbers are rounded."""

TOUCHING, SUNK = 2e-3, 2e-3
"""How near (m) the object is to what it rests on, and by how much (m) it may sink into it when it is
lifted off or put down."""


@dataclass(frozen=True, eq=False)
class SegmentStates:
    """Where everything is in a segment.

    Attributes:
        scene: the scene.
        segment: the segment.
        start: robot → values (N,) of all its joints where it starts.
        T_start: pose (4, 4) of the object there.
        in_hand: arm that holds the object → T_tool_object (4, 4).
        grasps: arm → T_object_tool (4, 4) of its grasps of the plan.
        strict: whether its clearance may not be overstated at all.
    """

    scene: Scene
    segment: SegmentRecord
    start: Mapping[str, Array]
    T_start: Array
    in_hand: Mapping[str, Array]
    grasps: Mapping[str, Sequence[Array]]
    strict: bool = False

    @property
    def rows(self) -> Array:
        """The indices (n,) of the rows."""
        return np.arange(len(self.segment.times), dtype=float)

    def values(self, at: Array) -> dict[str, Array]:
        """Return robot → values (m, N) of all its joints at rows (m,), or between them."""
        t = np.array(self.segment.times)
        share = np.interp(at, self.rows, t) / t[-1]
        values = {name: np.tile(row, (len(at), 1)) for name, row in self.start.items()}
        for name, rows in self.segment.joints.items():
            arm = self.scene.arms[name]
            for j, column in zip(arm.indices, np.array(rows).T, strict=True):
                values[arm.robot.name][:, j] = np.interp(at, self.rows, column)
        for name, (first, last) in self.segment.gripper.items():
            arm = self.scene.arms[name]
            for joint, end in arm.hand.joint_values(last).items():
                k = arm.robot.model.joint_names.index(joint)
                if first is None:
                    was = self.start[arm.robot.name][k]
                    column = was + share * (end - was)
                else:
                    openings = first + share * (last - first)
                    column = np.array([arm.hand.joint_values(float(x))[joint] for x in openings])
                values[arm.robot.name][:, k] = column
        return values

    def objects(self, values: Mapping[str, Array]) -> tuple[Array, Array]:
        """Return the poses (m, 4, 4) of the object in the first hand, and how far (2,) others have it off.

        The latter is a distance (m) and an angle (rad), the largest ones.
        """
        count = len(next(iter(values.values())))
        poses = [tool_pose(self.scene, name, values) @ own for name, own in self.in_hand.items()]
        if not poses:
            return np.tile(self.T_start, (count, 1, 1)), np.zeros(2)
        off = [[float(error.max()) for error in pose_error(poses[0], other)] for other in poses]
        return poses[0], np.max(off, axis=0)

    def between(self, step: float, most: int, trying: Callable[[], None] = lambda: None) -> Array | None:
        """Return rows (m,), or what is between two, from each of which to the next nothing moves far.

        None if these are more than so many.

        Args:
            step: the distance (m).
            most: most rows.
            trying: called before the way of every link is looked at; may raise `Cancelled`.
        """
        rows = self.values(self.rows)
        turned = np.max([np.abs(np.diff(values, axis=0)).max(axis=1) for values in rows.values()], axis=0)
        parts = np.ceil(turned / LARGEST_TURN).clip(1)
        if parts.sum() >= most:
            return None
        at = _divided(self.rows, parts)
        values = self.values(at)
        steps = _largest_steps(self.scene, values, self.objects(values)[0], trying)
        parts = np.ceil(steps / step).clip(1)
        return None if parts.sum() >= most else _divided(at, parts)

    def on_line(self, values: Mapping[str, Array], objects: Array) -> dict[str, np.ndarray]:
        """Return which of some states (m,) have an arm on the line along which it takes one of its grasps.

        The arms are those that move, or move their hands, in an approach or a retreat, or at a grasp.

        Args:
            values: robot → values (m, N) of its joints.
            objects: (m, 4, 4) poses of the object.
        """
        if self.segment.kind not in ("approach", "close", "open", "retreat"):
            return {}
        found = {}
        for name in self.segment.joints:
            tools = inverse(objects) @ tool_pose(self.scene, name, values)
            found[name] = np.zeros(len(objects), dtype=bool)
            for grasp in self.grasps.get(name, ()):
                off = inverse(grasp) @ tools
                angle = np.asarray(pose_error(grasp, tools)[1])
                aside = np.linalg.norm(off[:, :2, 3], axis=1)
                near = (aside <= OFF_LINE[0]) & (off[:, 2, 3] <= OFF_LINE[0]) & (angle <= OFF_LINE[1])
                found[name] |= near
        return found


def tool_pose(scene: Scene, name: str, values: Mapping[str, Array]) -> Array:
    """Return ``T_world_tool`` (..., 4, 4) of an arm for robot → values (..., N) of its joints."""
    arm = scene.arms[name]
    return arm.tool_at(values[arm.robot.name])


def check_free(
    states: SegmentStates,
    world: BulletWorld,
    most: int,
    where: str,
    expect: Expect,
    progress: Progress | None = None,
) -> int:
    """Check that all bodies keep the clearance of a segment, at steps that are shorter than it.

    Args:
        states: of the segment.
        world: a world of the scene; it ends at the end of the segment, or where a clearance is not kept.
        most: most states that may be checked.
        where: what it is called in failures.
        expect: notes a statement, and what is wrong where it does not hold.
        progress: called with the share of the states that are checked; may raise `Cancelled`.

    Returns:
        How many states were checked.
    """
    segment, trying = states.segment, partial(progress or (lambda _: None), 0.0)
    expect(segment.clearance >= 0, f"{where}: clearance is {segment.clearance} m")
    at = states.between(max(FINEST, segment.clearance), most, trying)
    text = f"{where}: more than {MOST_STATES:,} states of the motion would have to be checked"
    if not expect(at is not None, text) or at is None:
        return 0
    fine = states.values(at)
    trying()
    poses, (slip, twist) = states.objects(fine)
    text = f"{where}: the object slips by {1e3 * slip:.2f} mm and {np.rad2deg(twist):.2f}° in the hands"
    expect(slip <= RIGID[0] and twist <= RIGID[1], text)
    if states.in_hand:
        tilts = np.rad2deg(np.arccos(np.clip(poses[:, 2, 2], -1.0, 1.0)))
        limit, tilt = _largest_tilt(states.scene, segment), float(tilts.max())
        if segment.task_from == segment.task_to:  # as the task has it, it may be tilted further
            limit = max(limit, float(tilts[0]), float(tilts[-1]))
        expect(tilt <= limit + TILT_TOLERANCE, f"{where}: the object tilts by {tilt:.2f}°, not {limit:g}°")
    trying()
    if not _check_balance(states, fine, poses, where, expect):
        return len(at)
    trying()
    near = _NearBodies(states, world, fine, poses, trying)
    for k, pose in enumerate(poses):
        if progress:
            progress(k / len(poses))
        for name, values in fine.items():
            world.set_robot(name, values[k])
        world.set_object(pose)
        for c, gap in near.too_close(k):
            text = f"{where}: row {at[k]:.2f}: {c.a} and {c.b} keep {1e3 * gap:.3f} mm"
            expect(False, f"{text}, not {1e3 * segment.clearance:.3f} mm beyond the margin")
            return len(at)
    expect(True, where)
    return len(at)


def _check_balance(
    states: SegmentStates, values: Mapping[str, Array], poses: Array, where: str, expect: Expect
) -> bool:
    """Check that robots that can fall stand, at joint values (m, N) with the object at poses (m, 4, 4)."""
    scene, holders = states.scene, list(states.in_hand)
    hands = {name: tool_pose(scene, name, values) for name in holders}
    ok = True
    for name, robot in scene.robots.items():
        if robot.support is None:
            continue
        own = [arm for arm in holders if scene.arms[arm].robot is robot]
        loads = [
            load_of_hand(scene, scene.arms[arm], holders, poses, (inverse(poses) @ hands[arm])[:, 2, 3])
            for arm in own
        ]
        alone = len(own) == len(holders)  # then it carries the whole object, once
        margins = support_margin(robot, values[name], loads[:1] if alone else loads)
        k = int(np.argmin(margins))
        text = f"{where}: state {k}: {name} falls, its centre of mass is {-1e3 * margins[k]:.3f} mm outside"
        ok &= expect(margins[k] >= -BALANCE_TOLERANCE, text)
    return ok


def _largest_tilt(scene: Scene, segment: SegmentRecord) -> float:
    """Return the largest tilt (degrees) that the scene allows on the way of a segment."""
    carries = scene.file.carries()
    own = [carry.tilt_deg for carry in carries if carry.tasks == (segment.task_from, segment.task_to)]
    return min(own or [carry.tilt_deg for carry in carries if carry.tasks is None], default=180.0)


class _NearBodies:
    """Finds bodies that are closer than a segment states.

    Two bodies that move as one stay as far apart as they are, and are left out.

    Args:
        states: of the segment.
        world: a world of the scene.
        values: robot → values (m, N) of its joints along the segment.
        objects: (m, 4, 4) poses of the object.
        trying: called while links that are near each other are found; may raise `Cancelled`.
    """

    def __init__(
        self,
        states: SegmentStates,
        world: BulletWorld,
        values: Mapping[str, Array],
        objects: Array,
        trying: Callable[[], None],
    ) -> None:
        self._world, self._clearance = world, states.segment.clearance
        self._tolerance = 0.0 if states.strict else CLEARANCE_TOLERANCE
        scene, kind = states.scene, states.segment.kind
        self._holding = [scene.arms[name] for name in states.in_hand]
        self._taking = {scene.arms[name]: on for name, on in states.on_line(values, objects).items()}
        moving = {name: np.ptp(rows, axis=0) > 0 for name, rows in values.items()}
        self._group: dict[BodyName, tuple[str, str] | None] = {}  # what stands has none
        for name, robot in scene.robots.items():
            for link in robot.model.link_names:
                chain = [j for j in robot.model.chain(link) if j.source >= 0 and moving[name][j.source]]
                self._group[BodyName(name, link)] = (name, chain[-1].name) if chain else None
        holder = next((scene.arms[name] for name in states.in_hand), None)
        group = self._group[BodyName(holder.robot.name, holder.tool)] if holder else None
        self._group[BodyName(scene.file.object.name, "")] = group
        self._carried = group is not None
        self._resting: set[BodyName] = set()
        ends = {"lift": [0], "lower": [-1]}.get(kind, [0, -1])
        for pose in objects[ends] if self._carried else ():
            world.set_object(pose)
            self._resting |= {c.b for c in world.object_contacts(TOUCHING)}

        pairs = [(a, b) for a, b in world.link_pairs() if self._group[a] != self._group[b]]
        self._reach = self._clearance + world.margin
        self._links = near_links(world, values, pairs, self._reach, trying)

    def too_close(self, k: int) -> Iterator[tuple[Collision, float]]:
        """Yield the pairs that are closer than they may be in state k, with their distance (m).

        The world is in that state. The distance is that beyond the margin.
        """
        world = self._world
        touching = [*self._holding, *(arm for arm, on in self._taking.items() if on[k])]
        reach = self._reach
        for c in world.all_pairs_within(reach, self._links[k], touching):
            gap = reach - c.depth - world.margin_for(c.reason)
            moved = self._group.get(c.a) != self._group.get(c.b)
            if moved and gap < self._clearance - self._tolerance:
                yield c, gap
        for c in world.object_contacts(reach) if self._carried else ():
            gap = reach - c.depth
            if gap < (-SUNK if c.b in self._resting else self._clearance) - self._tolerance:
                yield c, gap


def _divided(at: Array, parts: Array) -> Array:
    """Return rows (n,) with further ones in between, which make so many parts (n - 1,) of each gap."""
    between = [
        a + (b - a) * np.arange(1, count + 1) / count
        for a, b, count in zip(at[:-1], at[1:], parts.astype(int).clip(1), strict=True)
    ]
    return np.concatenate([at[:1], *between])


def _largest_steps(
    scene: Scene, values: Mapping[str, Array], objects: Array, trying: Callable[[], None]
) -> Array:
    """Return how far (n - 1,) (m) any point of robots and object moves from row to row, at most."""
    profile = scene.profile
    r = float(profile.points[:, 1].max())
    steps = [_moves(objects, _corners([-r, -r, profile.h_min], [r, r, profile.h_max]))]
    for name, rows in values.items():
        model = scene.robots[name].model
        poses = model.forward_rows(rows, trying)
        for link in model.colliding_links():
            trying()
            points = np.concatenate(model.hulls(link))
            corners = _corners(points.min(axis=0), points.max(axis=0))
            steps.append(_moves(poses[:, model.link_index(link)], corners))
    return np.max(steps, axis=0)


def _corners(low: Sequence[float] | Array, high: Sequence[float] | Array) -> Array:
    """Return the corners (8, 3) of a box."""
    ends = np.array([low, high])
    return np.array([[ends[i, 0], ends[j, 1], ends[k, 2]] for i, j, k in np.ndindex(2, 2, 2)])


def _moves(poses: Array, points: Array) -> Array:
    """Return how far (n - 1,) (m) any of some points (k, 3) moves from pose to pose (n, 4, 4)."""
    placed = np.einsum("nij,kj->nki", poses[:, :3, :3], points) + poses[:, None, :3, 3]
    return np.linalg.norm(np.diff(placed, axis=0), axis=2).max(axis=1)
