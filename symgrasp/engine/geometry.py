"""What never changes while an object is moved: the pieces of a scene as one arm meets them."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from symgrasp.engine.checks import MovingBodies
from symgrasp.engine.solids import Piece, Solids, pack, pose_rows
from symgrasp.engine.tree import Tree, build
from symgrasp.meshes import read_mesh
from symgrasp.object.profile import COLLISION_FACETS
from symgrasp.poses import Array, inverse
from symgrasp.robot.model import Joint, RobotModel
from symgrasp.robot.robot import Arm
from symgrasp.scene.parts import Obstacle
from symgrasp.scene.scene import Scene
from symgrasp.world import BodyName, BulletWorld, Shape, checked_self_pairs

__all__ = ["ArmGeometry", "arm_geometry", "supports"]


class ArmGeometry(NamedTuple):
    """An arm among everything that stands still, and an object.

    Attributes:
        names: (P,) the body and link of each piece.
        solids: all P pieces: those that move, the robot's others, the object's, all others.
        pose: (P, 12) where they are; the object's and those of what moves do not matter.
        body: what moves.
        tree: over all others.
        pairs: the links of the robot's own pairs, in the order of `mark_near`.
        moving: the links that move.
        with_tool: those of them that are fixed to the tool, fingers included.
    """

    names: list[BodyName]
    solids: Solids
    pose: Array
    body: MovingBodies
    tree: Tree
    pairs: list[frozenset[str]]
    moving: frozenset[str]
    with_tool: frozenset[str]


class _Placed(NamedTuple):
    """A piece, whose it is, and where."""

    name: BodyName
    piece: Piece
    pose: Array


def supports(arm: Arm) -> bool:
    """Whether all that an arm moves is either fixed to one of its joints or part of its hand."""
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


def arm_geometry(world: BulletWorld, arm: Arm, openings: Array) -> ArmGeometry:
    """Collect the pieces of a world as an arm meets them.

    Args:
        world: the world; its robots are at home.
        arm: the arm.
        openings: (rows,) opening (m) of the hand at each row of the grid.
    """
    scene, model = world.scene, arm.robot.model
    shapes = world.shapes(arm.robot.name)
    joints = [next(j for j in model.joints if j.name == name) for name in arm.joint_names]
    level = {link: _level(model, joints, link) for link in shapes}
    tool = [link for link in shapes if level[link] == arm.dof - 1]
    between = sorted((link for link in shapes if 0 <= level[link] < arm.dof - 1), key=lambda k: level[k])
    still = [link for link in shapes if level[link] < 0]
    order = [(link, shape) for links in (tool, between, still) for link in links for shape in shapes[link]]
    links = [link for link, _ in order]
    hands = sum(link in tool for link in links)
    count = sum(link not in still for link in links)

    zero = arm.robot_values(np.zeros(arm.dof))
    at_zero = arm.robot.T_world_base @ model.forward(zero)
    frames = [at_zero[j.child] for j in joints]
    own = [_Placed(BodyName(arm.robot.name, k), _piece(s), at_zero[model.link_index(k)]) for k, s in order]
    name = BodyName(scene.file.object.name, "")
    objects = [_Placed(name, _revolved(v), np.eye(4)) for v in scene.profile.convex_pieces()]
    others = [*_obstacles(world), *_other_robots(world, arm)]
    placed = [*own, *objects, *others]

    solids = pack([p.piece for p in placed])
    pose = pose_rows(np.array([p.pose for p in placed]))
    pairs = _own_pairs(model, links, count)
    together = (pairs < hands).all(axis=1)
    base = (pairs[:, 0] < hands) & (pairs[:, 1] >= count)
    arm_pairs, start = _by_first(pairs[~(together | base)], hands, count)
    return ArmGeometry(
        names=[p.name for p in placed],
        solids=solids,
        pose=pose,
        body=MovingBodies(
            joint_origin=pose_rows(np.array([frames[0], *(inverse(a) @ b for a, b in _steps(frames))])),
            joint_axis=np.array([j.axis for j in joints]),
            frame=np.array([level[link] for link in links[:count]], dtype=np.int32),
            local=pose_rows(
                np.array([inverse(frames[level[p.name.link]]) @ p.pose for p in own[:count]]).reshape(
                    -1, 4, 4
                )
            ),
            hand=_hand_poses(arm, links[:hands], openings),
            touch=np.array([link in arm.hand.touch_links for link in links[:hands]], dtype=bool),
            hand_pairs=pairs[together],
            base_pairs=pairs[base],
            arm_pairs=arm_pairs,
            arm_pair_start=start,
            objects=np.arange(len(own), len(own) + len(objects), dtype=np.int32),
        ),
        tree=build(solids, pose, np.arange(len(own) + len(objects), len(placed))),
        pairs=[
            frozenset((links[a], links[b]))
            for a, b in np.concatenate([pairs[together], pairs[base], arm_pairs]).tolist()
        ],
        moving=frozenset(links[:count]),
        with_tool=frozenset(links[:hands]),
    )


def _level(model: RobotModel, joints: list[Joint], link: str) -> int:
    """Return which of an arm's joints is the last one to move a link, -1 if none does."""
    chain = [j.name for j in model.chain(link)]
    return max((k for k, joint in enumerate(joints) if joint.name in chain), default=-1)


def _steps(frames: list[Array]) -> Iterator[tuple[Array, Array]]:
    return pairwise(frames)


def _piece(shape: Shape) -> Piece:
    return Piece(shape.vertices, shape.rounding, shape.slack)


def _hand_poses(arm: Arm, links: list[str], openings: Array) -> Array:
    """Return the poses (rows, G, 12) of links in the tool frame at every opening."""
    model = arm.robot.model
    index = [model.link_index(link) for link in links]
    values = np.array([arm.robot_values(arm.home, float(opening)) for opening in openings])
    poses = model.forward(values)
    T_tool_base = inverse(poses[:, model.link_index(arm.tool)])
    return pose_rows(T_tool_base[:, None] @ poses[:, index]).reshape(len(openings), len(links), 12)


def _own_pairs(model: RobotModel, links: list[str], count: int) -> np.ndarray:
    """Return the pairs (., 2) of the robot's own pieces that can collide, of which one moves at least.

    The first of a pair moves, and against the tool if either does.
    """
    pieces: dict[str, list[int]] = {}
    for k, link in enumerate(links):
        pieces.setdefault(link, []).append(k)
    found = []
    for first, second in checked_self_pairs(model):
        for a in pieces.get(first, []):
            for b in pieces.get(second, []):
                found.append((min(a, b), max(a, b)))
    pairs = np.array([pair for pair in found if pair[0] < count], dtype=np.int32)
    return pairs.reshape(-1, 2)


def _by_first(pairs: np.ndarray, hands: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Sort pairs by the piece that moves between tool and base; return them and where each begins."""
    turned = [(b, a) if a < hands else (a, b) for a, b in pairs.tolist()]
    ordered = np.array(sorted(turned), dtype=np.int32).reshape(-1, 2)
    return ordered, np.searchsorted(ordered[:, 0], np.arange(count + 1)).astype(np.int32)


def _revolved(vertices: Array) -> Piece:
    """Return the round piece through the corners of a convex piece of the object.

    It contains the prism that PyBullet has, and exceeds it by the height of the arcs over its sides.
    The same for every turn of the object, it makes the hand's gap the same for all cells of a row.
    """
    radius = np.hypot(vertices[:, 0], vertices[:, 1])
    knots = np.column_stack([radius, np.zeros(len(radius)), vertices[:, 2]])
    slack = radius.max() * (1.0 - np.cos(np.pi / COLLISION_FACETS))
    return Piece(np.unique(np.round(knots, 12), axis=0), rounding=1e-11, slack=slack, revolved=True)


def _obstacles(world: BulletWorld) -> Iterator[_Placed]:
    for o in world.scene.obstacles:
        name, pose = BodyName(o.name, ""), o.T_world_obstacle
        if o.kind == "urdf":
            assert o.path is not None
            model = RobotModel(o.path)
            links = pose @ model.forward(np.zeros(len(model.joint_names)))
            yield from _links(world.shapes(o.name), o.name, model, links)
        elif o.kind == "mesh":
            for triangle in _triangles(o):
                yield _Placed(name, Piece(triangle), pose)
        else:
            yield _Placed(name, _primitive(o), pose)


def _primitive(o: Obstacle) -> Piece:
    if o.kind == "box":
        return Piece((np.array(list(np.ndindex(2, 2, 2))) - 0.5) * o.size)
    if o.kind == "cylinder":
        radius, height = o.size
        return Piece(np.array([[radius, 0.0, -0.5 * height], [radius, 0.0, 0.5 * height]]), revolved=True)
    return Piece(np.zeros((1, 3)), rounding=o.size[0])


def _triangles(o: Obstacle) -> Array:
    assert o.path is not None
    return np.asarray(read_mesh(o.path, f"obstacle {o.name}").triangles, dtype=float)


def _other_robots(world: BulletWorld, arm: Arm) -> Iterator[_Placed]:
    scene: Scene = world.scene
    for name, robot in scene.robots.items():
        if name != arm.robot.name:
            links = robot.T_world_base @ robot.model.forward(robot.home)
            yield from _links(world.shapes(name), name, robot.model, links)


def _links(shapes: dict[str, list[Shape]], name: str, model: RobotModel, links: Array) -> Iterator[_Placed]:
    for link, parts in shapes.items():
        for shape in parts:
            yield _Placed(BodyName(name, link), _piece(shape), links[model.link_index(link)])
