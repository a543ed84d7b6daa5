"""The pieces of a scene, and the situations that are made of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from symgrasp.collision.pieces import Piece, pack, pose_rows
from symgrasp.collision.tree import build
from symgrasp.engine.geometry import PlacedPiece, link_piece, object_piece, obstacle_pieces
from symgrasp.motion.bodies.joints import MovingJoints
from symgrasp.motion.bodies.linkage import Linkage, new_workspace
from symgrasp.motion.bodies.situation import Situation
from symgrasp.motion.bodies.state import State
from symgrasp.motion.bodies.weights import balance_of
from symgrasp.poses import Array
from symgrasp.progress import Progress
from symgrasp.robot.robot import Arm
from symgrasp.scene.scene import Scene
from symgrasp.world import BodyName, own_pairs
from symgrasp.world.bullet import BulletWorld

__all__ = ["RESTING", "MotionScene", "Rest"]

RESTING = 2e-3
"""How close (m) the object is to what it rests on, and by how much it counts as smaller while it is lifted
off or put down: so much of it may be inside, see `symgrasp.world.tasks.RESTING_DEPTH`."""


class Rest(NamedTuple):
    """What the object rests on.

    Attributes:
        pieces: of the obstacles that it touches; none where it is in the air.
        normal: (3,) unit vector away from all of them; upwards for none.
    """

    pieces: Sequence[int]
    normal: Array


NOTHING = Rest((), np.array([0.0, 0.0, 1.0]))
"""The object is in the air."""


class MotionScene:
    """The pieces of a scene, of which situations are made.

    Args:
        scene: the scene.
        world: a world of it, which is asked for its shapes.
        progress: called with the finished share of the pieces; may raise `Cancelled`.

    Attributes:
        scene: the scene.
        names: what each piece belongs to.
        pieces: all pieces.
    """

    def __init__(self, scene: Scene, world: BulletWorld, progress: Progress | None = None) -> None:
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
        self.pieces = pack([p.piece for p in placed], progress)
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
        rest: Rest = NOTHING,
        tilt: float = np.inf,
    ) -> Situation:
        """Return what moves, and what it must not meet, when some arms or hands move.

        Args:
            state: where everything is that does not move.
            arms: the arms that move.
            hands: the arms whose hands open or close; their joints have no columns.
            held_by: the arms that hold the object; if they move it moves with them, fixed to the first one.
            touching: the arms whose fingers may touch the object besides them. Those of both that do not move
                stand still: a torso that carries them, too, keeps its value.
            without: arms whose links are left out, because they move too and are looked at later.
            rest: what the object rests on, and may be inside of a little.
            tilt: largest angle (rad) of the axis of the object from the vertical, while it is moved.
        """
        still = [arm for arm in (*held_by, *touching) if arm not in (*arms, *hands, *without)]
        moving = MovingJoints(state, arms, hands, still)
        carrier = self._carriers(moving)
        pose = self._poses(state)
        holder = -1
        if held_by and held_by[0] in arms:
            holder = moving.carrier(held_by[0].robot, held_by[0].tool)
            carrier.update(dict.fromkeys(self._object.tolist(), holder))
            if rest.pieces:
                carrier.update(dict.fromkeys(self._core.tolist(), holder))
        local = self._local(state, moving, carrier)
        radius, lever = self._levers(moving, carrier, local)
        left_out = set(self._carriers(MovingJoints(state, without, ()))) - set(carrier)
        standing = [
            *(i for i in self._obstacles.tolist() if i not in rest.pieces),
            *(i for (name, _), own in self._links.items() if name not in moving.robots for i in own),
        ]
        standing = [piece for piece in standing if piece not in left_out]
        pairs = [
            pair
            for pair in self._pairs_of(set(moving.robots), carrier, held_by, touching, rest)
            if pair[1] not in left_out
        ]
        place = {piece: k for k, piece in enumerate(carrier)}
        linkage = Linkage(
            origin=moving.origin,
            axis=moving.axis,
            slides=moving.slides,
            parent=moving.parent,
            limits=moving.limits,
            piece=np.array(list(carrier), dtype=np.int64),
            frame=np.array(list(carrier.values()), dtype=np.int64),
            local=local,
            radius=radius,
            lever=lever,
            margin=np.array([self._margin(piece) for piece in carrier]),
            pair=np.array([(place[a], b) for a, b, _ in pairs], dtype=np.int64).reshape(-1, 2),
            other=np.array([place.get(b, -1) for _, b, _ in pairs], dtype=np.int64),
            common=np.array(
                [moving.common(carrier[a], carrier.get(b, -1)) for a, b, _ in pairs], dtype=np.int64
            ),
            distance=np.array([d for _, _, d in pairs], dtype=float),
            rests=np.array([a in self._core for a, _, _ in pairs], dtype=bool),
            tilted=holder if tilt < np.pi else -1,
            upright=local[place[int(self._object[0])], 2:9:3].copy() if holder >= 0 else np.zeros(3),
            tilt=float(min(tilt, np.pi)),
            balance=balance_of(self.scene, state, moving, held_by, without),
        )
        tree = build(self.pieces.size, pose, np.array(standing, dtype=np.int64))
        apart = np.array([self.names[a].body != self.names[b].body for a, b, _ in pairs], dtype=bool)
        return Situation(
            moving=moving,
            columns={arm.name: moving.columns(arm) for arm in arms},
            linkage=linkage,
            pieces=self.pieces,
            tree=tree,
            work=new_workspace(linkage, self.pieces, pose),
            apart=apart,
            names=self.names,
        )

    def rests(self, T_world_object: Array) -> bool:
        """Whether the object stands on something at a pose (4, 4)."""
        with self._world.preserving_state():
            return self._world.object_rests(T_world_object)

    def rest(self, T_world_object: Array) -> Rest:
        """Return what the object rests on at a pose (4, 4)."""
        with self._world.preserving_state():
            self._world.set_object(T_world_object)
            normals = self._world.object_normals(RESTING)
        if not normals:
            return NOTHING
        pieces = [piece for piece in self._obstacles.tolist() if self.names[piece] in normals]
        away = np.sum(list(normals.values()), axis=0)
        length = float(np.linalg.norm(away))
        # Between things that are opposite to each other it can only be lifted.
        return Rest(pieces, away / length if away[2] > 0.5 * length else NOTHING.normal)

    def _carriers(self, moving: MovingJoints) -> dict[int, int]:
        """Return the pieces of links that move, with the joint that carries each."""
        found = {}
        for (name, link), own in self._links.items():
            if name in moving.robots and (j := moving.carrier(moving.robots[name], link)) >= 0:
                found.update(dict.fromkeys(own, j))
        return found

    def _poses(self, state: State) -> Array:
        """Return the poses (P, 12) of all pieces in a state."""
        pose = self._pose.copy()
        for name, robot in self.scene.robots.items():
            links = robot.T_world_base @ robot.model.forward(state.values[name])
            for link in robot.model.link_names:
                pose[self._links.get((name, link), [])] = pose_rows(links[robot.model.link_index(link)])
        pose[[*self._object, *self._core]] = pose_rows(state.T_world_object)
        return pose

    def _local(self, state: State, moving: MovingJoints, carrier: Mapping[int, int]) -> Array:
        """Return the poses (M, 12) of the moving pieces in the frames of their joints."""
        links = {body for body, _ in self._links}
        local = [
            moving.link_in_joint(j, self.names[piece].link)
            if self.names[piece].body in links
            else moving.now_in_joint(j, state.T_world_object)
            for piece, j in carrier.items()
        ]
        return pose_rows(np.array(local).reshape(-1, 4, 4))

    def _levers(self, moving: MovingJoints, carrier: Mapping[int, int], local: Array) -> tuple[Array, Array]:
        """Return the radius (M,) of each moving piece about the middle of its box, and its levers (M, J)."""
        size, radius = self.pieces.size, np.zeros(len(carrier))
        lever = np.zeros((len(carrier), len(moving.joints)))
        for k, (piece, j) in enumerate(carrier.items()):
            corners, rounding = self._corners(piece), float(size[piece, 0])
            radius[k] = np.linalg.norm(corners - size[piece, 3:6], axis=1).max() + rounding
            points = corners @ local[k, :9].reshape(3, 3).T + local[k, 9:]
            lever[k] = moving.levers(j, points, rounding)
        return radius, lever

    def _corners(self, piece: int) -> Array:
        """Return points of whose hull a piece is a part, but for its rounding."""
        size = self.pieces.size[piece]
        if size[2]:
            signs = np.array(list(np.ndindex(2, 2, 2))) * 2.0 - 1.0
            return size[3:6] + signs * size[6:9]
        first, end, _ = self.pieces.ranges[piece]
        return self.pieces.vertices[first:end]

    def _margin(self, piece: int) -> float:
        """Return the distance (m) that a moving piece keeps from what stands."""
        if piece in self._core:
            return np.inf  # only from what the object rests on
        return 0.0 if piece in self._object else self.scene.settings.margin

    def _pairs_of(
        self,
        robots: set[str],
        carrier: Mapping[int, int],
        held_by: Sequence[Arm],
        touching: Sequence[Arm],
        rest: Rest,
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
        add([p for p in carrier if p not in self._object and p not in self._core], rest.pieces, margin)
        if carried:
            add(self._core.tolist(), rest.pieces, 0.0)
        return found


def _core(piece: Piece) -> Piece:
    """Return a piece of the object without what is nearer to its surface than `RESTING`."""
    r, h = piece.vertices[:, 0], piece.vertices[:, 2]
    low, high = h.min() + RESTING, max(h.min() + RESTING, h.max() - RESTING)
    inner = np.column_stack([np.maximum(r - RESTING, 0.0), np.zeros(len(r)), h.clip(low, high)])
    return Piece(inner, rounding=piece.rounding, slack=np.inf, revolved=True)
