"""Fingers that open in two opposing groups, and how the joints of a parallel hand open them."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from itertools import combinations, product
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from symgrasp.errors import UrdfError
from symgrasp.hands.held import Outline, outline
from symgrasp.hands.structure import HandStructure, links_with_shapes
from symgrasp.poses import Array, inverse
from symgrasp.robot.handprint import hull_edges, slab_corners
from symgrasp.robot.model import RobotModel

__all__ = [
    "PAD_HALF_HEIGHT",
    "FingerMotion",
    "Gripper",
    "find_gripper",
    "snap_to_axis",
]

PAD_DEPTH = 0.001
"""The pad of a finger is what lies within this depth (m) of its innermost point."""

PAD_HALF_HEIGHT = 0.002
"""Pads are measured where z of the tool frame is within this distance (m) of 0."""

HULL_MARGIN = 0.001
"""Margin (m) that Bullet keeps around the hulls of a URDF."""

SNAP_COSINE = np.cos(np.deg2rad(15))
"""Directions within 15° of a coordinate axis (this is the cosine) are taken to be that axis."""

MOST_JOINTS = 8
"""A hand whose fingers are moved by more joints than this is not taken for a parallel hand."""


class FingerMotion(NamedTuple):
    """The joints of a hand, moved by a parameter t: 0 at one end of their ranges, 1 at the other.

    Attributes:
        model: the URDF.
        base: the link whose frame everything is measured in.
        sources: (k,) indices of the joints into ``model.joint_names``.
        start: (k,) their values at t = 0.
        end: (k,) their values at t = 1.
    """

    model: RobotModel
    base: str
    sources: np.ndarray
    start: Array
    end: Array

    def joint_values(self, t: ArrayLike) -> Array:
        """Return the values (k,) of the joints at the parameter t, one for all or one for each (k,)."""
        return self.start + np.asarray(t) * (self.end - self.start)

    def part(self, start: float, end: float) -> FingerMotion:
        """Return the part of the motion between two values of t."""
        return self._replace(start=self.joint_values(start), end=self.joint_values(end))

    def hulls(self, links: Iterable[str], t: ArrayLike, T_base_frame: Array) -> list[Array]:
        """Return the vertices (n, 3) of the convex hulls of links' collision shapes.

        Args:
            links: names of the links.
            t: the parameter, one for all joints or one for each (k,).
            T_base_frame: pose (4, 4) in the base of the frame to express the vertices in.
        """
        return self.hulls_at(links, self.joint_values(t), T_base_frame)

    def hulls_at(self, links: Iterable[str], values: Array, T_base_frame: Array) -> list[Array]:
        """Return what `hulls` does, at given values (k,) of the joints."""
        q = self.model.default_values()
        q[self.sources] = values
        poses = self.model.forward(q)
        T_frame_root = inverse(poses[self.model.link_index(self.base)] @ T_base_frame)
        hulls = []
        for link in links:
            pose = T_frame_root @ poses[self.model.link_index(link)]
            hulls += [points @ pose[:3, :3].T + pose[:3, 3] for points in self.model.hulls(link)]
        return hulls

    def width_beside(self, links: Collection[str], values: Array, T_base_tool: Array, depth: float) -> float:
        """Return the extent (m) of fingers along x of the tool frame, symmetric about it, where objects are.

        Hulls count as far as objects reach behind the tool frame, with the margin that Bullet gives them.

        Args:
            links: names of the fingers' links.
            values: (m, k) values of the joints, for all openings at which objects are held.
            T_base_tool: pose (4, 4) of the tool frame in the base.
            depth: how far (m) objects reach behind the tool frame.
        """
        half = 0.0
        for at in values:
            for points in self.hulls_at(links, at, T_base_tool):
                cut = slab_corners(points, hull_edges(points), -depth, np.inf)
                half = max(half, float(np.abs(cut[:, 0]).max(initial=0.0)) + HULL_MARGIN)
        return 2 * half

    def centre(self, links: Iterable[str], t: ArrayLike) -> Array:
        """Return the mean (3,) of the hull vertices of links, in the base frame."""
        return np.concatenate(self.hulls(links, t, np.eye(4))).mean(axis=0)

    def moves(self, links: Iterable[str]) -> np.ndarray:
        """Return which of the joints (k,) move any of the links."""
        found = {joint.source for link in links for joint in self.model.chain(link)}
        return np.isin(self.sources, list(found))


class Gripper(NamedTuple):
    """The fingers of a hand in two opposing groups; they are closed at t = 0 and open at t = 1.

    Attributes:
        motion: the joints that open them.
        sides: the links of the fingers on the + and on the - side of the closing direction.
        closing: unit closing direction (3,) in the base.
        across: unit direction (3,) in the base of the axis that fingers curl about, which is that of the
            object that they hold; None for a parallel hand.
    """

    motion: FingerMotion
    sides: tuple[list[str], list[str]]
    closing: Array
    across: Array | None = None

    def outline(self, side: int, t: ArrayLike, T_base_tool: Array) -> Outline:
        """Return the fingers of one side as seen along x of the tool frame.

        Args:
            side: 0 or 1, index into `sides`.
            t: the parameter of the motion.
            T_base_tool: pose (4, 4) of the tool frame in the base.
        """
        return outline(self.motion.hulls(self.sides[side], t, T_base_tool), self._outwards(side, T_base_tool))

    def _outwards(self, side: int, T_base_tool: Array) -> float:
        return float(np.sign(T_base_tool[:3, 1] @ self.closing) * (1, -1)[side])

    def pad(self, side: int, t: ArrayLike, T_base_tool: Array) -> tuple[float, float, float]:
        """Return the ends of a pad along the tool's x, and its distance outwards from the plane y = 0 (m).

        Raises:
            UrdfError: no finger of that side reaches the tool frame.
        """
        hulls = self.motion.hulls(self.sides[side], t, T_base_tool)
        cuts = [slab_corners(h, hull_edges(h), -PAD_HALF_HEIGHT, PAD_HALF_HEIGHT) for h in hulls]
        corners = np.concatenate(cuts) * [1.0, self._outwards(side, T_base_tool)]
        if not len(corners):
            path, link = self.motion.model.path, self.sides[side][-1]
            raise UrdfError(path, f"hand: link {link}", None, "fingers that reach the tool frame")
        x, y = corners.T
        face = x[y <= y.min() + PAD_DEPTH]
        return float(face.min()), float(face.max()), float(y.min())


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
        motion = motion._replace(start=motion.end, end=motion.start)
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
    lower, upper = model.lower[sources], model.upper[sources]
    for grows in product((True,), *[(True, False)] * (len(sources) - 1)):
        start, end = np.where(grows, lower, upper), np.where(grows, upper, lower)
        yield FingerMotion(model, structure.base, np.array(sources), start, end)


def snap_to_axis(direction: Array) -> Array:
    """Return the coordinate axis (3,) that is within 15° of a direction (3,), else the unit direction."""
    direction = direction / np.linalg.norm(direction)
    k = int(np.abs(direction).argmax())
    return np.sign(direction[k]) * np.eye(3)[k] if abs(direction[k]) > SNAP_COSINE else direction
