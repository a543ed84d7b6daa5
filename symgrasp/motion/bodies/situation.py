"""What moves and what stands during a part of a motion: a `Linkage` for every such situation of a scene."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from symgrasp.collision.pieces import PackedPieces, Piece, pack, pose_rows
from symgrasp.collision.tree import Tree, build
from symgrasp.engine.geometry import PlacedPiece, link_piece, object_piece, obstacle_pieces
from symgrasp.errors import NoPlanError
from symgrasp.motion.bodies.joints import common_joint, joint_index, last_joint, moving_joints
from symgrasp.motion.bodies.linkage import Linkage, Workspace, new_workspace
from symgrasp.motion.bodies.state import State
from symgrasp.poses import Array, inverse
from symgrasp.robot.joint import Joint
from symgrasp.robot.robot import Arm, Robot
from symgrasp.scene.scene import Scene
from symgrasp.world import BodyName, own_pairs
from symgrasp.world.bullet import BulletWorld

__all__ = ["RESTING", "MotionScene", "Situation"]

RESTING = 2e-3
"""How close (m) the object is to what it rests on, and by how much it counts as smaller while it is lifted
off or put down: so much of it may be inside, see `symgrasp.world.tasks.RESTING_DEPTH`."""


@dataclass(frozen=True, eq=False)
class Situation:
    """A linkage with all that compiled code needs to prove lines of it free.

    Attributes:
        joints: the joints that move, with their robots.
        columns: arm → where its joints are among those of the linkage.
        linkage: what moves.
        pieces: all pieces.
        tree: the boxes of those that stand.
        work: arrays to write to.
        apart: (Q,) whether the pieces of each pair belong to different bodies.
        names: what each piece belongs to.
    """

    joints: Sequence[tuple[Robot, Joint]]
    columns: Mapping[str, np.ndarray]
    linkage: Linkage
    pieces: PackedPieces
    tree: Tree
    work: Workspace
    apart: np.ndarray
    names: Sequence[BodyName] = field(repr=False)

    def with_room(self, room: float) -> Situation:
        """Return the situation with more distance (m) to keep between different bodies."""
        wide = self.linkage._replace(
            margin=self.linkage.margin + room, distance=self.linkage.distance + room * self.apart
        )
        return replace(self, linkage=wide)

    def stacked(self, joints: Mapping[str, Array]) -> Array:
        """Return arm → values (..., dof) as values (..., J) of the linkage."""
        first = next(iter(joints.values()))
        q = np.zeros((*first.shape[:-1], len(self.linkage.parent)))
        for arm, values in joints.items():
            q[..., self.columns[arm]] = values
        return q

    def row(self, state: State) -> Array:
        """Return the values (J,) of the linkage in a state."""
        return np.array(
            [joint.ratio * state.values[robot.name][joint.source] for robot, joint in self.joints]
        )

    def by_arm(self, q: Array) -> dict[str, Array]:
        """Return values (..., J) of the linkage as arm → values (..., dof)."""
        return {arm: q[..., columns] for arm, columns in self.columns.items()}


class MotionScene:
    """The pieces of a scene, of which situations are made.

    Args:
        scene: the scene.
        world: a world of it, which is asked for its shapes.
    """

    def __init__(self, scene: Scene, world: BulletWorld) -> None:
        self.scene, self._world = scene, world
        placed: list[PlacedPiece] = []
        self._links: dict[tuple[str, str], list[int]] = {}
        for name in scene.robots:
            for link, shapes in world.shapes(name).items():
                self._links[name, link] = list(range(len(placed), len(placed) + len(shapes)))
                placed += [PlacedPiece(BodyName(name, link), link_piece(s), np.eye(4)) for s in shapes]
        whole = [object_piece(v) for v in scene.profile.convex_pieces()]
        name = BodyName(scene.file.object.name, "")
        self._object = np.arange(len(placed), len(placed) + len(whole))
        self._core = self._object + len(whole)  # the object without what may be inside its support
        placed += [PlacedPiece(name, p, np.eye(4)) for p in [*whole, *map(_core, whole)]]
        self._obstacles = np.arange(len(placed), len(placed) + sum(1 for _ in obstacle_pieces(scene)))
        placed += obstacle_pieces(scene)
        self.names = [p.name for p in placed]
        self.pieces = pack([p.piece for p in placed])
        self._pose = pose_rows(np.array([p.pose for p in placed]))
        self._pairs = {name: own_pairs(scene, name) for name in scene.robots}

    def home(self) -> State:
        """Return the state in which all robots are at home, with the object where the first task has it."""
        values = {name: robot.home.copy() for name, robot in self.scene.robots.items()}
        return State(values, self.scene.task().T_world_object)

    def situation(
        self,
        state: State,
        arms: Sequence[Arm],
        *,
        hands: Sequence[Arm] = (),
        held_by: Sequence[Arm] = (),
        touching: Sequence[Arm] = (),
        without: Sequence[Arm] = (),
        resting_on: Sequence[int] = (),
        tilt: float = np.inf,
    ) -> Situation:
        """Return what moves, and what it must not meet, when some arms or hands move.

        Args:
            state: where everything is that does not move.
            arms: the arms that move.
            hands: the arms whose hands open or close; their joints have no columns.
            held_by: the arms that hold the object; if they move it moves with them, fixed to the first one.
            touching: the arms whose fingers may touch the object besides them.
            without: arms whose links are left out, because they move too and are looked at later.
            resting_on: pieces on which the object rests, of which it may be inside a little.
            tilt: largest angle (rad) of the axis of the object from the vertical, while it is moved.
        """
        joints = moving_joints(arms, hands)
        joint_rows, parent, frames = self._joint_rows(state, joints)
        pose = self._pose.copy()
        links = {name: self._link_poses(state, robot) for name, robot in self.scene.robots.items()}
        carrier: dict[int, int] = {}  # moving piece → joint
        for (name, link), indices in self._links.items():
            model = self.scene.robots[name].model
            pose[indices] = pose_rows(links[name][model.link_index(link)])
            last = last_joint(joints, name, model.chain(link))
            if last >= 0:
                carrier.update(dict.fromkeys(indices, last))
        carried = bool(held_by) and held_by[0] in arms
        shapes = [*self._object, *self._core]
        pose[shapes] = pose_rows(state.T_world_object)
        holder = -1
        if carried:
            holder = last_joint(joints, held_by[0].robot.name, held_by[0].robot.model.chain(held_by[0].tool))
            carrier.update(dict.fromkeys(self._object.tolist(), holder))
            if len(resting_on):
                carrier.update(dict.fromkeys(self._core.tolist(), holder))
        left_out = self._links_moved_by(without) - set(carrier)
        moving = sorted(carrier)
        self._check_followers(joints)
        local = self._local(state, joints, frames, moving, carrier, pose)
        radius, reach = self._levers(joints, joint_rows, parent, moving, carrier, local)
        of_robots = {robot.name for robot, _ in joints}
        standing = [
            *(i for i in self._obstacles.tolist() if i not in resting_on),
            *(i for (name, _), own in self._links.items() if name not in of_robots for i in own),
        ]
        standing = [piece for piece in standing if piece not in left_out]
        pairs = [
            pair
            for pair in self._pairs_of(of_robots, carrier, held_by, touching, resting_on)
            if pair[1] not in left_out
        ]
        margin = np.full(len(moving), self.scene.settings.margin)
        for k, piece in enumerate(moving):
            if piece in self._object:
                margin[k] = 0.0
            elif piece in self._core:
                margin[k] = np.inf
        place = {piece: k for k, piece in enumerate(moving)}
        origin, axis, slides, limits = joint_rows
        linkage = Linkage(
            origin=origin,
            axis=axis,
            slides=slides,
            parent=parent,
            limits=limits,
            piece=np.array(moving, dtype=np.int64),
            frame=np.array([carrier[p] for p in moving], dtype=np.int64),
            local=local,
            radius=radius,
            lever=reach,
            margin=margin,
            pair=np.array([(place[a], b) for a, b, _ in pairs], dtype=np.int64).reshape(-1, 2),
            other=np.array([place.get(b, -1) for _, b, _ in pairs], dtype=np.int64),
            common=np.array(
                [common_joint(parent, carrier[a], carrier.get(b, -1)) for a, b, _ in pairs], dtype=np.int64
            ),
            distance=np.array([d for _, _, d in pairs], dtype=float),
            tilted=holder if carried and tilt < np.pi else -1,
            upright=local[place[int(self._object[0])], 2:9:3].copy() if carried else np.zeros(3),
            tilt=float(min(tilt, np.pi)),
        )
        columns = {
            arm.name: np.array([joint_index(joints, arm.robot.name, name) for name in arm.joint_names])
            for arm in arms
        }
        tree = build(self.pieces.size, pose, np.array(standing, dtype=np.int64))
        work = new_workspace(linkage, self.pieces, pose)
        apart = np.array([self.names[a].body != self.names[b].body for a, b, _ in pairs], dtype=bool)
        return Situation(joints, columns, linkage, self.pieces, tree, work, apart, self.names)

    def rests(self, T_world_object: Array) -> bool:
        """Whether the object stands on something at a pose (4, 4)."""
        with self._world.preserving_state():
            return self._world.object_rests(T_world_object)

    def supports(self, T_world_object: Array) -> list[int]:
        """Return the pieces of the obstacles that the object touches at a pose (4, 4)."""
        with self._world.preserving_state():
            self._world.set_object(T_world_object)
            touched = {c.b for c in self._world.object_contacts(RESTING)}
        return [piece for piece in self._obstacles.tolist() if self.names[piece] in touched]

    def _links_moved_by(self, arms: Sequence[Arm]) -> set[int]:
        """Return the pieces that the joints of some arms move."""
        joints = moving_joints(arms, ())
        return {
            piece
            for (name, link), own in self._links.items()
            if last_joint(joints, name, self.scene.robots[name].model.chain(link)) >= 0
            for piece in own
        }

    def _link_poses(self, state: State, robot: Robot) -> Array:
        return robot.T_world_base @ robot.model.forward(state.values[robot.name])

    def _joint_rows(
        self, state: State, joints: Sequence[tuple[Robot, Joint]]
    ) -> tuple[tuple[Array, Array, np.ndarray, Array], np.ndarray, Array]:
        """Return origins, axes, kinds and limits of joints, their parents, and frames (J, 4, 4) at zero."""
        zero = self._zero(state, joints)
        frames = np.array([zero[robot.name][joint.child] for robot, joint in joints]).reshape(-1, 4, 4)
        parent = np.full(len(joints), -1, dtype=np.int64)
        origin = frames.copy()
        for j, (robot, joint) in enumerate(joints):
            before = [b for b in robot.model.chain(robot.model.link_names[joint.child]) if b is not joint]
            parent[j] = last_joint(joints, robot.name, before)
            if parent[j] >= 0:
                origin[j] = inverse(frames[parent[j]]) @ frames[j]
        rows = (
            pose_rows(origin),
            np.array([joint.axis for _, joint in joints]),
            np.array([joint.kind == "prismatic" for _, joint in joints]),
            np.array([[joint.lower for _, joint in joints], [joint.upper for _, joint in joints]]),
        )
        return rows, parent, frames

    def _zero(self, state: State, joints: Sequence[tuple[Robot, Joint]]) -> dict[str, Array]:
        """Return robot → poses of its links with the moving joints at zero."""
        values = {name: state.values[name].copy() for name in {robot.name for robot, _ in joints}}
        for robot, joint in joints:
            values[robot.name][joint.source] = 0.0
        return {
            name: self.scene.robots[name].T_world_base @ self.scene.robots[name].model.forward(v)
            for name, v in values.items()
        }

    def _local(
        self,
        state: State,
        joints: Sequence[tuple[Robot, Joint]],
        frames: Array,
        moving: Sequence[int],
        carrier: Mapping[int, int],
        pose: Array,
    ) -> Array:
        """Return the poses (M, 12) of the moving pieces in the frames of their joints."""
        zero = self._zero(state, joints)
        local = np.empty((len(moving), 4, 4))
        now = {robot.name: self._link_poses(state, robot) for robot, _ in joints}
        for k, piece in enumerate(moving):
            robot, joint = joints[carrier[piece]]
            name = self.names[piece]
            if name.body == robot.name:
                link = zero[robot.name][robot.model.link_index(name.link)]
                local[k] = inverse(frames[carrier[piece]]) @ link
            else:  # the object is where it is at the present values of the joints
                local[k] = inverse(now[robot.name][joint.child]) @ state.T_world_object
        return pose_rows(local)

    def _levers(
        self,
        joints: Sequence[tuple[Robot, Joint]],
        rows: tuple[Array, Array, np.ndarray, Array],
        parent: np.ndarray,
        moving: Sequence[int],
        carrier: Mapping[int, int],
        local: Array,
    ) -> tuple[Array, Array]:
        """Return the radius (M,) of each moving piece about the middle of its box, and its levers (M, J)."""
        origin, axis, slides, limits = rows
        size, radius, lever = self.pieces.size, np.zeros(len(moving)), np.zeros((len(moving), len(joints)))
        span = np.where(slides, np.abs(limits).max(axis=0), 0.0)
        for k, piece in enumerate(moving):
            corners = self._corners(piece)
            rounding = size[piece, 0]
            radius[k] = np.linalg.norm(corners - size[piece, 3:6], axis=1).max() + rounding
            points = corners @ local[k, :9].reshape(3, 3).T + local[k, 9:]
            j = carrier[piece]
            lever[k, j] = (
                1.0 if slides[j] else np.linalg.norm(_across(points, axis[j]), axis=1).max() + rounding
            )
            away = np.linalg.norm(points, axis=1).max() + rounding + span[j]
            while parent[j] >= 0:
                step, j = origin[j, 9:], parent[j]
                lever[k, j] = 1.0 if slides[j] else np.linalg.norm(_across(step, axis[j])) + away
                away += np.linalg.norm(step) + span[j]
        return radius, lever

    def _corners(self, piece: int) -> Array:
        """Return points of whose hull a piece is a part, but for its rounding."""
        size = self.pieces.size[piece]
        if size[2]:
            signs = np.array(list(np.ndindex(2, 2, 2))) * 2.0 - 1.0
            return size[3:6] + signs * size[6:9]
        first, end, _ = self.pieces.ranges[piece]
        return self.pieces.vertices[first:end]

    def _pairs_of(
        self,
        robots: set[str],
        carrier: Mapping[int, int],
        held_by: Sequence[Arm],
        touching: Sequence[Arm],
        resting_on: Sequence[int],
    ) -> list[tuple[int, int, float]]:
        """Return the pairs of pieces that must keep a distance (m), a moving one first."""
        margin = self.scene.settings.margin
        found: list[tuple[int, int, float]] = []

        def add(a: Iterable[int], b: Iterable[int], distance: float) -> None:
            for first in a:
                for second in b:
                    if first not in carrier and second not in carrier:
                        continue
                    if carrier.get(first) != carrier.get(second):
                        found.append(
                            (first, second, distance) if first in carrier else (second, first, distance)
                        )

        for name in robots:
            for a, b in self._pairs[name]:
                add(self._links.get((name, a), ()), self._links.get((name, b), ()), 0.0)
        listed = sorted(robots)
        for i, first in enumerate(listed):
            for second in listed[i + 1 :]:
                for (name, _), own in self._links.items():
                    for (other, _), theirs in self._links.items():
                        if (name, other) == (first, second):
                            add(own, theirs, margin)
        fingers = {(arm.robot.name, link) for arm in (*held_by, *touching) for link in arm.hand.touch_links}
        carried = self._object[0] in carrier
        for (name, link), own in self._links.items():
            if (name, link) not in fingers and (name in robots or not carried):
                add(own, self._object.tolist(), 0.0)
        add([p for p in carrier if p not in self._object and p not in self._core], resting_on, margin)
        if carried:
            add(self._core.tolist(), resting_on, 0.0)
        return found

    def _check_followers(self, joints: Sequence[tuple[Robot, Joint]]) -> None:
        """Check that no other joint mimics one of those that move."""
        for robot in {robot.name: robot for robot, _ in joints}.values():
            sources = {joint.source for own, joint in joints if own is robot}
            names = {joint.name for own, joint in joints if own is robot}
            for joint in robot.model.joints:
                if joint.source in sources and joint.name not in names:
                    raise NoPlanError(
                        f"no motion of {robot.name} can be planned: {joint.name} follows a joint of its arm"
                    )


def _core(piece: Piece) -> Piece:
    """Return a piece of the object without what is nearer to its surface than `RESTING`."""
    r, h = piece.vertices[:, 0], piece.vertices[:, 2]
    low, high = h.min() + RESTING, max(h.min() + RESTING, h.max() - RESTING)
    inner = np.column_stack([np.maximum(r - RESTING, 0.0), np.zeros(len(r)), h.clip(low, high)])
    return Piece(inner, rounding=piece.rounding, slack=np.inf, revolved=True)


def _across(vectors: Array, axis: Array) -> Array:
    """Return the parts of vectors (..., 3) perpendicular to a unit axis."""
    return vectors - (vectors @ axis)[..., None] * axis
