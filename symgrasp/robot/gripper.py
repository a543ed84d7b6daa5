"""The parts of a parallel hand in a URDF: palm, fingers, and the joints that part them."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import combinations, product
from typing import NamedTuple

import numpy as np

from symgrasp.errors import UrdfError, one_of
from symgrasp.poses import Array, inverse
from symgrasp.robot.handprint import hull_edges, slab_corners
from symgrasp.robot.model import RobotModel

__all__ = ["Anatomy", "FingerMotion", "Gripper", "find_anatomy", "find_gripper", "snap", "solid_links"]

PAD_DEPTH = 0.001
"""What is no further back (m) than this from a finger's innermost point belongs to its pad."""

SLICE = 0.002
"""Pads are measured in a slice this thick (m) to either side of the tool frame."""

SNAP = np.cos(np.deg2rad(15))
"""Directions closer than this to an axis of the palm are meant to be that axis."""

MOST_JOINTS = 8
"""Joints that move the fingers of one hand; more is not a parallel hand."""


class Anatomy(NamedTuple):
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


def find_anatomy(model: RobotModel, tool: str | None) -> Anatomy:
    """Find the palm that two or more fingers hang on.

    Args:
        model: the URDF.
        tool: a link fixed to the palm; may be None where there is one palm only.

    Raises:
        UrdfError: there is no such palm, or several.
    """
    chains = {link: model.chain(link) for link in model.link_names}
    moving = {link: [j for j in chain if j.source >= 0] for link, chain in chains.items()}
    # Links that only fixed joints connect are one body, known by the last joint that moves it.
    found: dict[str | None, list[list[str]]] = {}
    for joint in model.joints:
        if joint.source >= 0:
            branch = [link for link in model.link_names if joint in chains[link]]
            above = moving[model.link_names[joint.parent]]
            if solid_links(model, branch):
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
    return Anatomy(base, palm, hands[mover], mover is None)


def solid_links(model: RobotModel, *links: Iterable[str]) -> tuple[str, ...]:
    """Return those of several groups of links that have a collision shape, in the model's order."""
    wanted = {link for group in links for link in group}
    return tuple(link for link in model.colliding_links() if link in wanted)


class FingerMotion(NamedTuple):
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


class Gripper(NamedTuple):
    """Two sides of fingers, closed at 0 and open at 1.

    Attributes:
        motion: how they move.
        sides: the links of the fingers on the + and on the - side of the closing direction.
        closing: unit closing direction (3,) in the base.
    """

    motion: FingerMotion
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


def find_gripper(model: RobotModel, anatomy: Anatomy) -> Gripper:
    """Find which way the joints turn to part the fingers, and along which direction.

    Among all combinations of directions, the one whose fingers part the most is meant.
    """
    branches = anatomy.branches
    best, found = 0.0, None
    for motion in _motions(model, anatomy):
        centres = np.array([[motion.centre(solid_links(model, b), t) for b in branches] for t in (0.0, 1.0)])
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
    closing = snap(parted / best)
    closing = closing * np.sign(closing[np.abs(closing).argmax()])
    along = centres.mean(axis=0) @ closing
    plus = along > 0.5 * (along[a] + along[b])
    sides = [[link for k, branch in enumerate(branches) if plus[k] == s for link in branch] for s in (1, 0)]
    return Gripper(motion, (sides[0], sides[1]), closing)


def _motions(model: RobotModel, anatomy: Anatomy) -> Iterable[FingerMotion]:
    moved = {link for branch in anatomy.branches for link in branch}
    sources = sorted({j.source for j in model.joints if j.source >= 0 and model.link_names[j.child] in moved})
    names = [model.joint_names[k] for k in sources]
    if len(names) > MOST_JOINTS or not np.isfinite(model.upper[sources] - model.lower[sources]).all():
        raise UrdfError(model.path, "hand: joints", names, f"at most {MOST_JOINTS} joints, with limits")
    for signs in product((1.0,), *[(1.0, -1.0)] * (len(sources) - 1)):
        yield FingerMotion(model, anatomy.base, np.array(sources), np.array(signs))


def snap(direction: Array) -> Array:
    """Return the axis of the frame that a direction (3,) is meant to be, or the direction itself."""
    direction = direction / np.linalg.norm(direction)
    k = int(np.abs(direction).argmax())
    return np.sign(direction[k]) * np.eye(3)[k] if abs(direction[k]) > SNAP else direction
