"""The collision geometry of a scene for one arm: everything that does not depend on the object's pose."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby, pairwise
from typing import NamedTuple

import numpy as np

from symgrasp.collision.hulls import with_hulls
from symgrasp.collision.pieces import PackedPieces, Piece, joined, pack, pose_rows
from symgrasp.collision.tree import Tree, build, grafted
from symgrasp.engine.balance import balance_of
from symgrasp.engine.kinematics import MovingPieces
from symgrasp.engine.search_types import Balance
from symgrasp.meshes.flat_faces import convex_faces, fills_hull
from symgrasp.object.profile import COLLISION_FACETS
from symgrasp.poses import Array, inverse
from symgrasp.progress import Progress, at_start
from symgrasp.robot.joint import Joint
from symgrasp.robot.link_shapes import CollisionShape
from symgrasp.robot.model import RobotModel
from symgrasp.robot.robot import Arm
from symgrasp.scene.scene import Scene
from symgrasp.world import BodyName, BulletWorld, Shape, own_pairs

__all__ = [
    "ArmGeometry",
    "PlacedPiece",
    "arm_geometry",
    "hand_poses",
    "link_piece",
    "object_piece",
    "obstacle_pieces",
    "supports",
]


class ArmGeometry(NamedTuple):
    """The collision geometry of a scene for one arm, as P pieces: the robot's, the object's, the static ones.

    Attributes:
        names: (P,) names of the body and link of each piece.
        pieces: those that the arm moves, the rest of the robot's, the object's, and the static ones (the
            obstacles and the other robots at home), in this order; then H hulls of some of these.
        pose: (P + H, 12) their poses; placeholders for the moving ones and the object's.
        moving: the pieces that the arm moves, and their pairs.
        tree: the boxes of the static pieces.
        pairs: the two links of each pair of the robot's own pieces, in the order of `mark_near`.
        moving_links: names of the links that the arm moves.
        tool_links: those of them that are fixed to the tool, fingers included.
        balance: what decides whether the robot stands.
        local: (rows, M, 12) pose of each moving piece in its joint's frame, at the opening of each row: of a
            pitched arm, whose joints place its hand; of others (0, M, 12).
    """

    names: list[BodyName]
    pieces: PackedPieces
    pose: Array
    moving: MovingPieces
    tree: Tree
    pairs: list[frozenset[str]]
    moving_links: frozenset[str]
    tool_links: frozenset[str]
    balance: Balance
    local: Array

    def moving_in(self, row: int) -> MovingPieces:
        """Return the moving pieces for grasps of a row: the same for all, but of a pitched arm."""
        return self.moving._replace(local=self.local[row]) if len(self.local) else self.moving


class PlacedPiece(NamedTuple):
    """A piece with the name of its body and its pose (4, 4) in the world.

    Attributes:
        mesh: which mesh it is a face of, if it is: the same for all of them; and whether that fills its hull.
    """

    name: BodyName
    piece: Piece
    pose: Array
    mesh: tuple[BodyName, int, bool] | None = None


def supports(arm: Arm) -> bool:
    """Whether the engine can place every link that an arm moves.

    It can where each such link depends on the joints of the arm's chain alone, or on the joints of the
    hand and lies beyond the last joint of the chain. A mimic joint elsewhere that follows a joint of the
    arm breaks this.
    """
    model = arm.robot.model
    own = set(arm.indices.tolist())
    chain = {j.name for j in model.joints if j.name in arm.joint_names}
    hand = {model.joint_names.index(name) for name in arm.hand.joints}
    last = arm.joint_names[-1]
    for link in model.colliding_links():
        joints = model.chain(link)
        if any(j.source in own and j.name not in chain for j in joints):
            return False
        if any(j.source in hand for j in joints) and last not in [j.name for j in joints]:
            return False
    return True


def arm_geometry(
    world: BulletWorld, arm: Arm, openings: Array, progress: Progress | None = None
) -> ArmGeometry:
    """Collect the collision geometry of a world for an arm.

    Args:
        world: the world; its other robots are at home.
        arm: the arm.
        openings: (rows,) opening (m) of the hand at each row of the grid.
        progress: called with the finished share of the pieces, and with 0 before; may raise `Cancelled`.
    """
    tell = at_start(progress) or (lambda _: None)
    scene, model = world.scene, arm.robot.model
    shapes = world.shapes(arm.robot.name)
    joints = [next(j for j in model.joints if j.name == name) for name in arm.joint_names]
    last_joint = {link: _last_joint(model, joints, link) for link in shapes}
    placed_by_joints = len(joints) - (0 if arm.pitched else 1)
    tool = [link for link in shapes if last_joint[link] >= placed_by_joints]
    between = [link for link in shapes if 0 <= last_joint[link] < placed_by_joints]
    between.sort(key=lambda link: last_joint[link])
    fixed = [link for link in shapes if last_joint[link] < 0]
    order = [(link, shape) for links in (tool, between, fixed) for link in links for shape in shapes[link]]
    links = [link for link, _ in order]
    tool_count = sum(link in tool for link in links)
    moving_count = sum(link not in fixed for link in links)

    zero = arm.robot_values(np.zeros(arm.dof))
    at_zero = arm.robot.T_world_base @ model.forward(zero)
    frames = [at_zero[j.child] for j in joints]
    own = [
        PlacedPiece(BodyName(arm.robot.name, k), link_piece(s), at_zero[model.link_index(k)])
        for k, s in order
    ]
    tell(0.0)
    name = BodyName(scene.file.object.name, "")
    objects = [PlacedPiece(name, object_piece(v), np.eye(4)) for v in scene.profile.convex_pieces()]
    others = [*obstacle_pieces(scene), *_other_robots(world, arm)]
    placed = [*own, *objects, *others]
    tell(0.0)

    moving_links = links[:moving_count]
    into_frames = inverse(np.array([frames[last_joint[link]] for link in moving_links]).reshape(-1, 4, 4))
    local = _poses(arm, moving_links, into_frames, [None])[0]
    of_rows = _poses(arm, moving_links, into_frames, openings.tolist() if arm.pitched else [])
    tell(0.0)
    origins, axes = [frames[0], *(inverse(a) @ b for a, b in pairwise(frames))], [j.axis for j in joints]
    if arm.pitched:
        origins, axes = [*origins, np.eye(4)], [*axes, np.array([0.0, 0.0, 1.0])]
    pieces = pack([p.piece for p in placed], progress)
    pose = pose_rows(np.array([p.pose for p in placed]))
    tell(0.0)
    tree, hulls = _tree(placed, pieces, pose, len(own) + len(objects))
    pieces = joined(pieces, pack(hulls))
    pose = np.concatenate([pose, pose_rows(np.tile(np.eye(4), (len(hulls), 1, 1)))])
    pairs = _own_pairs(own_pairs(world.scene, arm.robot.name), links, moving_count)
    together = (pairs < tool_count).all(axis=1)
    base = (pairs[:, 0] < tool_count) & (pairs[:, 1] >= moving_count)
    arm_pairs, start = _sort_by_arm_piece(pairs[~(together | base)], tool_count, moving_count)
    return ArmGeometry(
        names=[p.name for p in placed],
        pieces=pieces,
        pose=pose,
        moving=MovingPieces(
            joint_origin=pose_rows(np.array(origins)),
            joint_axis=np.array(axes),
            frame=np.array([last_joint[link] for link in moving_links], dtype=np.int64),
            local=local,
            hand=hand_poses(arm, links[:tool_count], openings),
            touch=np.array([link in arm.hand.touch_links for link in moving_links], dtype=bool),
            hand_pairs=pairs[together],
            base_pairs=pairs[base],
            arm_pairs=arm_pairs,
            arm_pair_start=start,
            objects=np.arange(len(own), len(own) + len(objects), dtype=np.int64),
        ),
        tree=tree,
        pairs=[
            frozenset((links[a], links[b]))
            for a, b in np.concatenate([pairs[together], pairs[base], arm_pairs]).tolist()
        ],
        moving_links=frozenset(moving_links),
        tool_links=frozenset(links[:tool_count]),
        balance=balance_of(arm, joints, openings),
        local=of_rows,
    )


def _tree(
    placed: Sequence[PlacedPiece], pieces: PackedPieces, pose: Array, first: int
) -> tuple[Tree, list[Piece]]:
    """Return the tree over the static pieces, from index first on, and its hulls, to be put after all."""
    trees, hulls = [], []
    for mesh, group in groupby(range(first, len(placed)), lambda k: placed[k].mesh):
        if mesh is None:
            trees += [build(pieces.size, pose, np.array([k])) for k in group]
        else:
            tree = build(pieces.size, pose, np.array(list(group)))
            tree, own = with_hulls(tree, pieces, pose, mesh[2])
            tree.hull[tree.hull >= 0] += len(placed) + len(hulls)
            trees.append(tree)
            hulls += own
    return grafted(trees), hulls


def _poses(arm: Arm, links: list[str], into_frames: Array, openings: Sequence[float | None]) -> Array:
    """Return the poses (., M, 12) of M links in the frames of their joints, at some openings of the hand.

    Args:
        arm: the arm.
        links: the links.
        into_frames: (M, 4, 4) from the world into these frames, with the joints of the arm at zero.
        openings: None for the hand at home.
    """
    model = arm.robot.model
    index = [model.link_index(link) for link in links]
    found = np.empty((len(openings), len(links), 12))
    for k, opening in enumerate(openings):
        poses = arm.robot.T_world_base @ model.forward(arm.robot_values(np.zeros(arm.dof), opening))
        found[k] = pose_rows(into_frames @ poses[index])
    return found


def _last_joint(model: RobotModel, joints: list[Joint], link: str) -> int:
    """Return the index of the last of an arm's joints that moves a link, -1 if none does."""
    chain = [j.name for j in model.chain(link)]
    return max((k for k, joint in enumerate(joints) if joint.name in chain), default=-1)


def link_piece(shape: Shape) -> Piece:
    """Return the piece of a shape of a link, in the link's frame."""
    return Piece(shape.vertices, shape.rounding, shape.slack)


def hand_poses(arm: Arm, links: list[str], openings: Array) -> Array:
    """Return the poses (rows, G, 12) of G links in the tool frame at the opening of each row."""
    model = arm.robot.model
    index = [model.link_index(link) for link in links]
    values = np.array([arm.robot_values(arm.home, float(opening)) for opening in openings])
    poses = model.forward(values)
    T_tool_base = inverse(poses[:, model.link_index(arm.tool)])
    return pose_rows(T_tool_base[:, None] @ poses[:, index]).reshape(len(openings), len(links), 12)


def _own_pairs(checked: Sequence[tuple[str, str]], links: list[str], count: int) -> np.ndarray:
    """Return the pairs (., 2) of the robot's own pieces that can collide and of which at least one moves.

    Args:
        checked: the pairs of links that must not collide.
        links: link of each of the robot's pieces; those fixed to the tool first, then the other moving ones.
        count: number of moving pieces.

    Returns:
        The pairs, the lower index first: so the first piece moves, and is fixed to the tool if any is.
    """
    by_link: dict[str, list[int]] = {}
    for k, link in enumerate(links):
        by_link.setdefault(link, []).append(k)
    found = []
    for first, second in checked:
        for a in by_link.get(first, []):
            for b in by_link.get(second, []):
                found.append((min(a, b), max(a, b)))
    pairs = np.array([pair for pair in found if pair[0] < count], dtype=np.int64)
    return pairs.reshape(-1, 2)


def _sort_by_arm_piece(pairs: np.ndarray, hands: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Sort pairs by their piece between tool and base, of which each pair has one, and put it first.

    Args:
        pairs: (., 2) pairs of pieces.
        hands: number of pieces that are fixed to the tool.
        count: number M of moving pieces.

    Returns:
        The pairs (., 2), and (M + 1,) where those of each moving piece begin.
    """
    turned = [(b, a) if a < hands else (a, b) for a, b in pairs.tolist()]
    ordered = np.array(sorted(turned), dtype=np.int64).reshape(-1, 2)
    return ordered, np.searchsorted(ordered[:, 0], np.arange(count + 1))


def object_piece(vertices: Array) -> Piece:
    """Return the revolved piece around the vertices (n, 3) of a convex piece of the object.

    It contains the prism that PyBullet has; the slack is the height of its arcs over the sides of the prism.
    Because it is round, the hand has the same distance from it for all cells of a row.
    """
    radius = np.hypot(vertices[:, 0], vertices[:, 1])
    knots = np.column_stack([radius, np.zeros(len(radius)), vertices[:, 2]])
    slack = radius.max() * (1.0 - np.cos(np.pi / COLLISION_FACETS))
    return Piece(np.unique(np.round(knots, 12), axis=0), rounding=1e-11, slack=slack, revolved=True)


def obstacle_pieces(scene: Scene) -> Iterator[PlacedPiece]:
    """Yield the pieces of the obstacles; those of a mesh are its flat faces."""
    for o in scene.obstacles:
        for k, (link, shape) in enumerate(o.shapes()):
            name, pose = BodyName(o.name, link), o.T_world_obstacle @ shape.pose
            if shape.kind == "mesh":
                mesh = o.mesh(link, shape)
                faces = (name, k, fills_hull(mesh))
                yield from (PlacedPiece(name, Piece(face), pose, faces) for face in convex_faces(mesh))
            else:
                yield PlacedPiece(name, _exact(shape), pose)


def _exact(shape: CollisionShape) -> Piece:
    """Return a box, cylinder or sphere in its own frame."""
    if shape.kind == "box":
        return Piece((np.array(list(np.ndindex(2, 2, 2))) - 0.5) * shape.size)
    if shape.kind == "cylinder":
        radius, height = shape.size
        return Piece(np.array([[radius, 0.0, -0.5 * height], [radius, 0.0, 0.5 * height]]), revolved=True)
    return Piece(np.zeros((1, 3)), rounding=shape.size[0])


def _other_robots(world: BulletWorld, arm: Arm) -> Iterator[PlacedPiece]:
    """Yield the pieces of all robots but the arm's, at home."""
    scene: Scene = world.scene
    for name, robot in scene.robots.items():
        if name != arm.robot.name:
            links = robot.T_world_base @ robot.model.forward(robot.home)
            yield from _links(world.shapes(name), name, robot.model, links)


def _links(
    shapes: dict[str, list[Shape]], name: str, model: RobotModel, links: Array
) -> Iterator[PlacedPiece]:
    """Yield the pieces of a URDF, given the shapes and the world poses (links, 4, 4) of its links."""
    for link, parts in shapes.items():
        for shape in parts:
            yield PlacedPiece(BodyName(name, link), link_piece(shape), links[model.link_index(link)])
