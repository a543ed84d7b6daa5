"""Finding a parallel hand in a URDF: its palm, its fingers, and the joints that open it."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import combinations, product
from typing import NamedTuple

import numpy as np

from symgrasp.errors import UrdfError, one_of
from symgrasp.poses import Array, inverse
from symgrasp.robot.handprint import hull_edges, slab_corners
from symgrasp.robot.model import RobotModel

__all__ = [
    "PAD_HALF_HEIGHT",
    "FingerMotion",
    "Gripper",
    "HandStructure",
    "find_gripper",
    "find_hand_structure",
    "links_with_shapes",
    "snap_to_axis",
]

PAD_DEPTH = 0.001
"""The pad of a finger is what lies within this depth (m) of its innermost point."""

PAD_HALF_HEIGHT = 0.002
"""Pads are measured where z of the tool frame is within this distance (m) of 0."""

SNAP_COSINE = np.cos(np.deg2rad(15))
"""Directions within 15° of a coordinate axis (this is the cosine) are taken to be that axis."""

MOST_JOINTS = 8
"""A hand whose fingers are moved by more joints than this is not taken for a parallel hand."""


class HandStructure(NamedTuple):
    """Which links of a URDF are the palm and which the fingers of a hand, by name.

    Attributes:
        base: the link that carries all fingers.
        palm: the links that are fixed to the base, and the base.
        fingers: for each moving joint on the palm, the links that it moves.
        standalone: whether the URDF holds the hand only, and no robot.
    """

    base: str
    palm: list[str]
    fingers: list[list[str]]
    standalone: bool


def find_hand_structure(model: RobotModel, tool: str | None) -> HandStructure:
    """Find the palm that carries two or more fingers.

    Args:
        model: the URDF.
        tool: a link fixed to the palm; may be None where there is one palm only.

    Raises:
        UrdfError: there is no such palm, or several.
    """
    chains = {link: model.chain(link) for link in model.link_names}
    moving = {link: [j for j in chain if j.source >= 0] for link, chain in chains.items()}
    # Links that only fixed joints connect move as one rigid group. A group is named by the last joint that
    # moves it, None where no joint does.
    fingers_of: dict[str | None, list[list[str]]] = {}
    for joint in model.joints:
        if joint.source >= 0:
            finger = [link for link in model.link_names if joint in chains[link]]
            above = moving[model.link_names[joint.parent]]
            if links_with_shapes(model, finger):
                fingers_of.setdefault(above[-1].name if above else None, []).append(finger)
    hands = {mover: fingers for mover, fingers in fingers_of.items() if len(fingers) > 1}
    group = {link: joints[-1].name if joints else None for link, joints in moving.items()}
    if tool is not None:
        mover = group[model.link_names[model.link_index(tool)]]
        if mover not in hands:
            raise UrdfError(model.path, "tool", tool, "a link of a palm that two or more fingers hang on")
    else:
        # A group whose "fingers" carry fingers themselves is the torso of a robot, not a palm.
        inner = [m for m, fs in hands.items() if not any(group[link] in hands for f in fs for link in f)]
        if len(inner) != 1:
            palms = [link for link in model.link_names if group[link] in inner]
            expected = f"--tool, {one_of(palms)}" if palms else "a palm with two or more moving fingers"
            raise UrdfError(model.path, "hand", f"{len(inner)} hands", expected)
        mover = inner[0]
    together = [link for link in model.link_names if group[link] == mover]
    parents = [chains[finger[0]][:-1] for finger in hands[mover]]
    shared = [j for j in parents[0] if all(j in chain for chain in parents)]
    base = model.link_names[shared[-1].child] if shared else model.root
    # On a robot the last link of the arm moves with the palm, but is not part of the hand.
    palm = together if mover is None else [link for link in together if chains[link][: len(shared)] == shared]
    return HandStructure(base, palm, hands[mover], mover is None)


def links_with_shapes(model: RobotModel, *links: Iterable[str]) -> tuple[str, ...]:
    """Return the links of several groups that have a collision shape, in the model's order."""
    wanted = {link for group in links for link in group}
    return tuple(link for link in model.colliding_links() if link in wanted)


class FingerMotion(NamedTuple):
    """The joints of a hand moved together by a parameter t, 0 at one end of their ranges, 1 at the other.

    Attributes:
        model: the URDF.
        base: the link whose frame everything is measured in.
        sources: (k,) indices of the joints into ``model.joint_names``.
        direction: (k,) 1 for a joint whose value grows with t, -1 for one whose value falls.
    """

    model: RobotModel
    base: str
    sources: np.ndarray
    direction: np.ndarray

    def joint_values(self, t: float) -> Array:
        """Return the values (k,) of the joints at the parameter t."""
        lower, upper = self.model.lower[self.sources], self.model.upper[self.sources]
        return np.where(self.direction > 0, lower + t * (upper - lower), upper - t * (upper - lower))

    def hulls(self, links: Iterable[str], t: float, T_base_frame: Array) -> list[Array]:
        """Return the vertices (n, 3) of the convex hulls of links' collision shapes.

        Args:
            links: names of the links.
            t: the parameter.
            T_base_frame: pose (4, 4) in the base of the frame to express the vertices in.
        """
        q = self.model.default_values()
        q[self.sources] = self.joint_values(t)
        poses = self.model.forward(q)
        T_frame_root = inverse(poses[self.model.link_index(self.base)] @ T_base_frame)
        hulls = []
        for link in links:
            pose = T_frame_root @ poses[self.model.link_index(link)]
            hulls += [points @ pose[:3, :3].T + pose[:3, 3] for points in self.model.hulls(link)]
        return hulls

    def centre(self, links: Iterable[str], t: float) -> Array:
        """Return the mean (3,) of the hull vertices of links, in the base frame."""
        return np.concatenate(self.hulls(links, t, np.eye(4))).mean(axis=0)


class Gripper(NamedTuple):
    """The fingers of a hand in two opposing groups; they are closed at t = 0 and open at t = 1.

    Attributes:
        motion: the joints that open them.
        sides: the links of the fingers on the + and on the - side of the closing direction.
        closing: unit closing direction (3,) in the base.
    """

    motion: FingerMotion
    sides: tuple[list[str], list[str]]
    closing: Array

    def slab(self, side: int, t: float, T_base_tool: Array, low: float, high: float) -> Array:
        """Cut the fingers of one side to ``low <= z <= high`` (m) of the tool frame.

        Args:
            side: 0 or 1, index into `sides`.
            t: the parameter of the motion.
            T_base_tool: pose (4, 4) of the tool frame in the base.
            low: lower bound of z.
            high: upper bound of z.

        Returns:
            The corners (n, 2) of the cut: x, and the distance outwards from the plane y = 0 (m).

        Raises:
            UrdfError: no finger of that side reaches the slab.
        """
        outwards = np.sign(T_base_tool[:3, 1] @ self.closing) * (1, -1)[side]
        hulls = self.motion.hulls(self.sides[side], t, T_base_tool)
        corners = np.concatenate([slab_corners(h, hull_edges(h), low, high) for h in hulls])
        if not len(corners):
            path, link = self.motion.model.path, self.sides[side][-1]
            raise UrdfError(path, f"hand: link {link}", None, "fingers that reach the tool frame")
        return corners * [1.0, outwards]

    def gap(self, t: float, T_base_tool: Array, depth: float) -> float:
        """Return the smallest distance (m) between the two sides where ``z >= -depth`` in the tool frame."""
        return sum(float(self.slab(side, t, T_base_tool, -depth, np.inf)[:, 1].min()) for side in (0, 1))

    def pad(self, side: int, t: float, T_base_tool: Array) -> tuple[float, float, float]:
        """Return the middle and the width of a pad along the tool's x, and its distance outwards (m)."""
        x, y = self.slab(side, t, T_base_tool, -PAD_HALF_HEIGHT, PAD_HALF_HEIGHT).T
        face = x[y <= y.min() + PAD_DEPTH]
        return 0.5 * float(face.min() + face.max()), float(np.ptp(face)), float(y.min())


def find_gripper(model: RobotModel, structure: HandStructure) -> Gripper:
    """Find in which directions the joints move to open the hand, and along which direction it closes.

    Of all combinations of joint directions, the one that separates two fingers the most is taken.

    Raises:
        UrdfError: the fingers have too many joints, joints without limits, or none that separate them.
    """
    fingers = structure.fingers
    best, found = 0.0, None
    for motion in _motions(model, structure):
        shaped = [links_with_shapes(model, finger) for finger in fingers]
        centres = np.array([[motion.centre(links, t) for links in shaped] for t in (0.0, 1.0)])
        moved = centres[1] - centres[0]
        for a, b in combinations(range(len(fingers)), 2):
            parted = moved[a] - moved[b]
            if np.linalg.norm(parted) > best + 1e-6:
                best, found = float(np.linalg.norm(parted)), (motion, centres, a, b, parted)
    if found is None:
        raise UrdfError(model.path, "hand: joints", list(model.joint_names), "joints that part the fingers")
    motion, centres, a, b, parted = found
    if (centres[:, a] - centres[:, b]).mean(axis=0) @ parted < 0:  # t closes them: reverse it
        motion = motion._replace(direction=-motion.direction)
    closing = snap_to_axis(parted / best)
    closing = closing * np.sign(closing[np.abs(closing).argmax()])
    along = centres.mean(axis=0) @ closing
    plus = along > 0.5 * (along[a] + along[b])
    sides = [[link for k, finger in enumerate(fingers) if plus[k] == s for link in finger] for s in (1, 0)]
    return Gripper(motion, (sides[0], sides[1]), closing)


def _motions(model: RobotModel, structure: HandStructure) -> Iterable[FingerMotion]:
    """Yield the motions for all combinations of joint directions, up to reversing them all."""
    moved = {link for finger in structure.fingers for link in finger}
    sources = sorted({j.source for j in model.joints if j.source >= 0 and model.link_names[j.child] in moved})
    names = [model.joint_names[k] for k in sources]
    if len(names) > MOST_JOINTS or not np.isfinite(model.upper[sources] - model.lower[sources]).all():
        raise UrdfError(model.path, "hand: joints", names, f"at most {MOST_JOINTS} joints, with limits")
    for signs in product((1.0,), *[(1.0, -1.0)] * (len(sources) - 1)):
        yield FingerMotion(model, structure.base, np.array(sources), np.array(signs))


def snap_to_axis(direction: Array) -> Array:
    """Return the coordinate axis (3,) that is within 15° of a direction (3,), else the unit direction."""
    direction = direction / np.linalg.norm(direction)
    k = int(np.abs(direction).argmax())
    return np.sign(direction[k]) * np.eye(3)[k] if abs(direction[k]) > SNAP_COSINE else direction
