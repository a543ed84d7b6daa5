"""Measuring a parallel hand in its URDF: its fingers, how they open, its tool frame and its palm."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import combinations, product
from typing import Any, NamedTuple

import numpy as np
import yaml
from scipy.spatial import ConvexHull

from symgrasp.assembly import Frame
from symgrasp.errors import UrdfError, one_of
from symgrasp.hand import Hand, JointTable
from symgrasp.handprint import hull_edges, slab_corners
from symgrasp.outline import simplify
from symgrasp.poses import Array, from_rotation, inverse, quat_wxyz, rpy
from symgrasp.robot import RobotModel

__all__ = ["hand_yaml", "measure_hand"]

STEPS = 65
"""Postures from closed to open at which the fingers are measured."""

TIP = 0.010
"""Where the tool frame is put (m) behind the ends of the fingers, half a usual pad, if no link says."""

PALM_ROOM = 0.004
"""Room to leave (m) between an object and the palm."""

PALM_SKIN = 0.005
"""The palm is measured this far (m) behind its foremost point, because fronts are rounded."""

PAD_DEPTH = 0.001
"""What is no further back (m) than this from a finger's innermost point belongs to its pad."""

SLICE = 0.002
"""Pads and palm are measured in slices this thick (m) to either side."""

WIDE = 0.8
"""Objects may reach as deep as the open fingers keep this share of their opening; what is narrower
behind is the root of the fingers."""

TABLE_ERROR = 2.5e-4
"""By how much (m) the opening may differ from what the table of a joint says."""

SNAP = np.cos(np.deg2rad(15))
"""Directions closer than this to an axis of the palm are meant to be that axis."""

MOST_JOINTS = 8
"""Joints that move the fingers of one hand; more is not a parallel hand."""


def measure_hand(model: RobotModel, tool: str | None = None) -> Hand:
    """Measure a parallel hand.

    Args:
        model: the hand's URDF, or that of a robot with the hand on it.
        tool: a link between the finger tips, needed where a robot has several hands. Its origin
            becomes that of the tool frame; the axes are measured.

    Raises:
        UrdfError: there is no such link, or nothing that opens and closes like a parallel hand.
    """
    anatomy = _anatomy(model, tool)
    gripper = _gripper(model, anatomy)
    palm, fingers = _solid(model, anatomy.palm), _solid(model, *gripper.sides)
    T = _tool_pose(gripper, palm, tool)
    width, face, front = _palm_face(gripper.motion.bodies(palm, 1.0, T)) if palm else (0.0, 0.0, np.inf)
    depth = _finger_depth(gripper, T, front)
    steps, openings = _openings(gripper, T, depth)
    return Hand(
        name=model.path.stem,
        links=(*palm, *fingers),
        touch_links=fingers,
        joints=_tables(gripper, steps, openings),
        min_opening=_round(openings[0]),
        max_opening=_round(openings[-1]),
        finger_depth=_round(depth),
        pad_width=_round(min(gripper.pad(side, steps[0], T)[1] for side in (0, 1))),
        palm_width=_round(width),
        palm_depth=_round(face),
        tool=_tool_frame(model, T, anatomy.base, tool),
        urdf=str(model.path.resolve()) if anatomy.alone else None,
    )


def hand_yaml(hand: Hand) -> str:
    """Return a hand in the notation of the scene file, and in words as comments."""
    mm = {key: f"{1e3 * value:.1f} mm" for key, value in vars(hand).items() if isinstance(value, float)}
    words = [
        f"# fingers: {', '.join(hand.touch_links)}, moved by {', '.join(hand.joints)}",
        f"# they open from {mm['min_opening']} to {mm['max_opening']}; their pads are {mm['pad_width']} wide",
        f"# objects may reach {mm['finger_depth']} behind the tool frame; the palm is {mm['palm_depth']}"
        f" behind it, {mm['palm_width']} wide there",
    ]
    if hand.urdf is not None:
        words.append("# a hand of its own: the robot also needs mount: {link: LINK, pose: {…}}")
    content = {
        "name": hand.name,
        "urdf": hand.urdf,
        "tool": hand.tool and _frame_content(hand.tool),
        "links": list(hand.links),
        "touch_links": list(hand.touch_links),
        "joints": {
            name: table if isinstance(table, float | int) else [list(knot) for knot in table]
            for name, table in hand.joints.items()
        },
    }
    for key in ("min_opening", "max_opening", "finger_depth", "pad_width", "palm_width", "palm_depth"):
        content[key] = getattr(hand, key)
    content = {key: value for key, value in content.items() if value is not None}
    text = yaml.safe_dump({"hand": content}, sort_keys=False, default_flow_style=None, width=100)
    return "\n".join([*words, text])


def _frame_content(frame: Frame) -> dict[str, Any]:
    if frame.is_link:
        return {"link": frame.link}
    turn = np.rad2deg(rpy(frame.matrix())).round(4) + 0.0
    return {"link": frame.link, "pose": {"position": list(frame.position), "rpy_deg": turn.tolist()}}


# -- which links are palm and fingers -----------------------------------------------------------


class _Anatomy(NamedTuple):
    """Links by name.

    Attributes:
        base: the link that all fingers hang on.
        palm: the links that do not move against it.
        branches: for each joint at the palm, the links that it moves.
        alone: whether the URDF is that of the hand alone.
    """

    base: str
    palm: list[str]
    branches: list[list[str]]
    alone: bool


def _anatomy(model: RobotModel, tool: str | None) -> _Anatomy:
    chains = {link: model.chain(link) for link in model.link_names}
    moving = {link: [j for j in chain if j.source >= 0] for link, chain in chains.items()}
    # Links that only fixed joints connect are one body, known by the last joint that moves it.
    found: dict[str | None, list[list[str]]] = {}
    for joint in model.joints:
        if joint.source >= 0:
            branch = [link for link in model.link_names if joint in chains[link]]
            above = moving[model.link_names[joint.parent]]
            if _solid(model, branch):
                found.setdefault(above[-1].name if above else None, []).append(branch)
    hands = {mover: branches for mover, branches in found.items() if len(branches) > 1}
    body = {link: joints[-1].name if joints else None for link, joints in moving.items()}
    if tool is not None:
        mover = body[model.link_names[model.link_index(tool)]]
        if mover not in hands:
            raise UrdfError(model.path, "tool", tool, "a link of a palm that two or more fingers hang on")
    else:
        inner = [m for m, bs in hands.items() if not any(body[link] in hands for b in bs for link in b)]
        if len(inner) != 1:
            palms = [link for link in model.link_names if body[link] in inner]
            expected = f"--tool, {one_of(palms)}" if palms else "a palm with two or more moving fingers"
            raise UrdfError(model.path, "hand", f"{len(inner)} hands", expected)
        mover = inner[0]
    together = [link for link in model.link_names if body[link] == mover]
    parents = [chains[branch[0]][:-1] for branch in hands[mover]]
    shared = [j for j in parents[0] if all(j in chain for chain in parents)]
    base = model.link_names[shared[-1].child] if shared else model.root
    # On a robot the last link of the arm is no part of the hand, though fixed to it.
    palm = together if mover is None else [link for link in together if chains[link][: len(shared)] == shared]
    return _Anatomy(base, palm, hands[mover], mover is None)


def _solid(model: RobotModel, *links: Iterable[str]) -> tuple[str, ...]:
    wanted = {link for group in links for link in group}
    return tuple(link for link in model.colliding_links() if link in wanted)


# -- how the fingers move -----------------------------------------------------------------------


class _Motion(NamedTuple):
    """The joints of a hand, moved together from one end of their ranges (0) to the other (1).

    Attributes:
        model: the URDF.
        base: the link whose frame everything is measured in.
        sources: (k,) indices of the joints into ``model.joint_names``.
        direction: (k,) 1 for a joint that goes up, -1 for one that goes down.
    """

    model: RobotModel
    base: str
    sources: np.ndarray
    direction: np.ndarray

    def joint_values(self, t: float) -> Array:
        """Return the values (k,) of the joints."""
        lower, upper = self.model.lower[self.sources], self.model.upper[self.sources]
        return np.where(self.direction > 0, lower + t * (upper - lower), upper - t * (upper - lower))

    def bodies(self, links: Iterable[str], t: float, T_base_frame: Array) -> list[Array]:
        """Return the vertices (n, 3) of the convex bodies of links, in a frame on the base."""
        q = self.model.default_values()
        q[self.sources] = self.joint_values(t)
        poses = self.model.forward(q)
        T_frame_root = inverse(poses[self.model.link_index(self.base)] @ T_base_frame)
        bodies = []
        for link in links:
            pose = T_frame_root @ poses[self.model.link_index(link)]
            bodies += [points @ pose[:3, :3].T + pose[:3, 3] for points in self.model.hulls(link)]
        return bodies

    def centre(self, links: Iterable[str], t: float) -> Array:
        """Return the middle (3,) of the corners of links in the base."""
        return np.concatenate(self.bodies(links, t, np.eye(4))).mean(axis=0)


class _Gripper(NamedTuple):
    """Two sides of fingers, closed at 0 and open at 1.

    Attributes:
        motion: how they move.
        sides: the links of the fingers on the + and on the - side of the closing direction.
        closing: unit closing direction (3,) in the base.
    """

    motion: _Motion
    sides: tuple[list[str], list[str]]
    closing: Array

    def slab(self, side: int, t: float, T_base_tool: Array, low: float, high: float) -> Array:
        """Cut one side's fingers to ``low <= z <= high`` of the tool frame.

        Returns:
            The corners (n, 2): x, and the distance outwards from the middle plane of the tool.
        """
        outwards = np.sign(T_base_tool[:3, 1] @ self.closing) * (1, -1)[side]
        bodies = self.motion.bodies(self.sides[side], t, T_base_tool)
        corners = np.concatenate([slab_corners(b, hull_edges(b), low, high) for b in bodies])
        if not len(corners):
            path, link = self.motion.model.path, self.sides[side][-1]
            raise UrdfError(path, f"hand: link {link}", None, "fingers that reach the tool frame")
        return corners * [1.0, outwards]

    def gap(self, t: float, T_base_tool: Array, depth: float) -> float:
        """Return the smallest distance (m) between the sides from ``depth`` (m) behind the tool on."""
        return sum(float(self.slab(side, t, T_base_tool, -depth, np.inf)[:, 1].min()) for side in (0, 1))

    def pad(self, side: int, t: float, T_base_tool: Array) -> tuple[float, float, float]:
        """Return middle and width of a pad along x, and how far outwards it is, at the tool frame."""
        x, y = self.slab(side, t, T_base_tool, -SLICE, SLICE).T
        face = x[y <= y.min() + PAD_DEPTH]
        return 0.5 * float(face.min() + face.max()), float(np.ptp(face)), float(y.min())


def _gripper(model: RobotModel, anatomy: _Anatomy) -> _Gripper:
    """Find which way the joints turn to part the fingers, and along which direction.

    Among all combinations of directions, the one whose fingers part the most is meant.
    """
    branches = anatomy.branches
    best, found = 0.0, None
    for motion in _motions(model, anatomy):
        centres = np.array([[motion.centre(_solid(model, b), t) for b in branches] for t in (0.0, 1.0)])
        moved = centres[1] - centres[0]
        for a, b in combinations(range(len(branches)), 2):
            parted = moved[a] - moved[b]
            if np.linalg.norm(parted) > best + 1e-6:
                best, found = float(np.linalg.norm(parted)), (motion, centres, a, b, parted)
    if found is None:
        raise UrdfError(model.path, "hand: joints", list(model.joint_names), "joints that part the fingers")
    motion, centres, a, b, parted = found
    if (centres[:, a] - centres[:, b]).mean(axis=0) @ parted < 0:  # they near each other: turn time round
        motion = motion._replace(direction=-motion.direction)
    closing = _snap(parted / best)
    closing = closing * np.sign(closing[np.abs(closing).argmax()])
    along = centres.mean(axis=0) @ closing
    plus = along > 0.5 * (along[a] + along[b])
    sides = [[link for k, branch in enumerate(branches) if plus[k] == s for link in branch] for s in (1, 0)]
    return _Gripper(motion, (sides[0], sides[1]), closing)


def _motions(model: RobotModel, anatomy: _Anatomy) -> Iterable[_Motion]:
    moved = {link for branch in anatomy.branches for link in branch}
    sources = sorted({j.source for j in model.joints if j.source >= 0 and model.link_names[j.child] in moved})
    names = [model.joint_names[k] for k in sources]
    if len(names) > MOST_JOINTS or not np.isfinite(model.upper[sources] - model.lower[sources]).all():
        raise UrdfError(model.path, "hand: joints", names, f"at most {MOST_JOINTS} joints, with limits")
    for signs in product((1.0,), *[(1.0, -1.0)] * (len(sources) - 1)):
        yield _Motion(model, anatomy.base, np.array(sources), np.array(signs))


def _snap(direction: Array) -> Array:
    """Return the axis of the frame that a direction (3,) is meant to be, or the direction itself."""
    direction = direction / np.linalg.norm(direction)
    k = int(np.abs(direction).argmax())
    return np.sign(direction[k]) * np.eye(3)[k] if abs(direction[k]) > SNAP else direction


# -- what is measured ---------------------------------------------------------------------------


def _tool_pose(gripper: _Gripper, palm: Sequence[str], tool: str | None) -> Array:
    """Return the pose (4, 4) of the tool frame in the base: z approach, y closing direction."""
    motion, y = gripper.motion, gripper.closing
    fingers = [link for side in gripper.sides for link in side]
    behind = motion.centre(palm, 1.0) if palm else np.zeros(3)
    z = 0.5 * (motion.centre(fingers, 0.0) + motion.centre(fingers, 1.0)) - behind
    z = _snap(z - (z @ y) * y)
    z = z - (z @ y) * y
    z /= np.linalg.norm(z)
    if tool is not None:
        model = motion.model
        links = model.forward(model.default_values())
        T = inverse(links[model.link_index(motion.base)]) @ links[model.link_index(tool)]
        y = -y if y @ T[:3, 1] < 0 else y
        return from_rotation(np.column_stack([np.cross(y, z), y, z]), T[:3, 3])
    T = from_rotation(np.column_stack([np.cross(y, z), y, z]))
    reach = min(np.concatenate(motion.bodies(fingers, t, T))[:, 2].max() for t in (0.0, 1.0))
    T[:3, 3] = (reach - TIP) * z
    (x0, _, out0), (x1, _, out1) = (gripper.pad(side, 1.0, T) for side in (0, 1))
    T[:3, 3] += T[:3, :3] @ [0.5 * (x0 + x1), 0.5 * (out0 - out1), 0.0]
    T[:3, 3] = T[:3, 3].round(4)
    return T


def _palm_face(bodies: Sequence[Array]) -> tuple[float, float, float]:
    """Return the palm's width along x, its distance behind the tool, and that of its foremost point.

    The width is taken in the plane of closing-free motion (y = 0), so that an object that reaches
    behind that face within it surely meets the palm.
    """
    front = max(float(points[:, 2].max()) for points in bodies)
    face = front - PALM_SKIN
    width = 0.0
    for points in bodies:
        corners = slab_corners(points, hull_edges(points), face - SLICE, face)
        width = max(width, _width_at_middle(corners))
    return width, -face, -front


def _width_at_middle(corners: Array) -> float:
    """Return the width (m) about the origin of the hull of xy corners (n, 2) along the line y = 0."""
    if len(corners) < 3:
        return 0.0
    a, b = corners[ConvexHull(corners).simplices].transpose(1, 0, 2)
    crosses = a[:, 1] * b[:, 1] < 0
    a, b = a[crosses], b[crosses]
    x = a[:, 0] - a[:, 1] * (b[:, 0] - a[:, 0]) / (b[:, 1] - a[:, 1])
    return max(0.0, 2 * float(min(x.max(), -x.min()))) if len(x) else 0.0


def _finger_depth(gripper: _Gripper, T_base_tool: Array, palm: float) -> float:
    """Return how deep (m) objects may reach: to the palm, or to where the open fingers narrow."""
    fingers = [link for side in gripper.sides for link in side]
    length = -min(float(p[:, 2].min()) for p in gripper.motion.bodies(fingers, 1.0, T_base_tool))
    deepest = max(0.0, min(palm - PALM_ROOM, length))
    wide = WIDE * gripper.gap(1.0, T_base_tool, 0.0)
    depths = np.linspace(deepest, 0.0, STEPS)
    return next((float(d) for d in depths if gripper.gap(1.0, T_base_tool, d) >= wide), 0.0)


def _openings(gripper: _Gripper, T_base_tool: Array, depth: float) -> tuple[Array, Array]:
    """Return postures (m,) from where the fingers touch to fully open, and the openings (m,) there."""
    steps = np.linspace(0.0, 1.0, STEPS)
    gaps = np.array([gripper.gap(t, T_base_tool, depth) for t in steps])
    first = int(np.argmax(gaps > 0))
    if gaps[-1] <= 0 or (np.diff(gaps[first:]) <= 0).any():
        shown = (1e3 * gaps[[0, -1]]).round(1).tolist()
        raise UrdfError(
            gripper.motion.model.path, "hand: opening (mm)", shown, "fingers that part as their joints move"
        )
    if first:
        touch = np.interp(0.0, gaps[first - 1 : first + 1], steps[first - 1 : first + 1])
        return np.append(touch, steps[first:]), np.append(0.0, gaps[first:])
    if gaps[0] < TABLE_ERROR:
        gaps[0] = 0.0
    return steps, gaps


def _tables(gripper: _Gripper, steps: Array, openings: Array) -> dict[str, JointTable]:
    """Return how each joint follows the opening."""
    motion = gripper.motion
    values = np.array([motion.joint_values(t) for t in steps])
    tables: dict[str, JointTable] = {}
    for k, source in enumerate(motion.sources):
        at = values[:, k]
        error = TABLE_ERROR * np.ptp(at) / np.ptp(openings)
        ratio = float(openings @ at / (openings @ openings))
        if np.abs(ratio * openings - at).max() <= error:
            tables[motion.model.joint_names[source]] = float(f"{ratio:.4g}")
        else:
            knots = simplify(np.column_stack([openings, at]), error)
            tables[motion.model.joint_names[source]] = tuple(
                (_round(o), round(float(v), 5)) for o, v in knots
            )
    return tables


def _tool_frame(model: RobotModel, T_base_tool: Array, base: str, tool: str | None) -> Frame:
    """Return the tool frame on the given link, or else on the base."""
    link = tool or base
    links = model.forward(model.default_values())
    pose = inverse(links[model.link_index(link)]) @ links[model.link_index(base)] @ T_base_tool
    if np.allclose(pose, np.eye(4), atol=1e-3):
        return Frame(link)
    position = tuple((_round(v) + 0.0) for v in pose[:3, 3])
    return Frame(link, (position[0], position[1], position[2]), tuple(quat_wxyz(pose).tolist()))


def _round(length: float) -> float:
    return round(float(length), 4)
