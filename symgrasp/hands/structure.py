"""Which links of a URDF are the palm of a hand, and which its fingers."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import NamedTuple

from scipy.spatial import ConvexHull

from symgrasp.errors import UrdfError, one_of
from symgrasp.poses import Array
from symgrasp.robot.model import RobotModel

__all__ = [
    "HandStructure",
    "check_fingers",
    "find_hand_structure",
    "jaw_candidates",
    "links_with_shapes",
    "palm_candidates",
]

LARGEST_GAP = 0.015
"""Largest distance (m) between the shapes of successive links of a finger."""


class HandStructure(NamedTuple):
    """Which links of a URDF are the palm and which the fingers of a hand, by name.

    Attributes:
        base: the link that carries all fingers.
        palm: the links that are fixed to the base, and the base.
        fingers: for each moving joint on the palm, the links that it moves; one where a jaw closes on a part
            of the palm.
        standalone: whether the URDF holds the hand only, and no robot.
        beside: the other links that move with the palm.
    """

    base: str
    palm: list[str]
    fingers: list[list[str]]
    standalone: bool
    beside: list[str]


def find_hand_structure(model: RobotModel, tool: str | None) -> HandStructure:
    """Find the palm that carries two or more fingers, or one jaw.

    Args:
        model: the URDF.
        tool: a link fixed to the palm; may be None where there is only one palm that carries fingers.

    Raises:
        UrdfError: there is no such palm, or several.
    """
    parts = _parts(model)
    if tool is not None:
        mover = parts.group[model.link_index(tool)]
        if len(parts.firsts.get(mover, ())) < 2 and mover not in _innermost(parts, parts.firsts):
            raise UrdfError(model.path, "tool", tool, "a link of a palm that fingers or a jaw hang on")
    else:
        inner = _innermost(parts, _hands(parts))
        if len(inner) != 1:
            palms = [link for link, own in zip(model.link_names, parts.group, strict=True) if own in inner]
            expected = f"--tool, {one_of(palms)}" if palms else "two or more fingers, or --tool for one jaw"
            raise UrdfError(model.path, "hand", f"{len(inner)} hands", expected)
        mover = inner[0]
    together = [link for link, own in zip(model.link_names, parts.group, strict=True) if own == mover]
    fingers = [[model.link_names[k] for k in parts.below(first)] for first in parts.firsts[mover]]
    chains = [[joint.child for joint in model.chain(finger[0])[:-1]] for finger in fingers]
    shared = [link for link in chains[0] if all(link in chain for chain in map(set, chains[1:]))]
    base = shared[-1] if shared else 0
    # On a robot the last link of the arm moves with the palm, but is not part of the hand.
    own = {model.link_names[k] for k in parts.below(base)}
    palm = [link for link in together if mover is None or link in own]
    beside = [link for link in together if not (mover is None or link in own)]
    return HandStructure(model.link_names[base], palm, fingers, mover is None, beside)


def palm_candidates(model: RobotModel) -> list[str]:
    """Return a link of each rigid group that two or more moving parts hang on, none of them such a group.

    Palms are among them, and so may be the body of a robot whose arms and legs carry no hands.
    """
    parts = _parts(model)
    return _first_links(model, parts, _innermost(parts, _hands(parts)))


def jaw_candidates(model: RobotModel) -> list[str]:
    """Return a link of each rigid group that one moving part hangs on, on which nothing moves.

    Those that carry a jaw are among them, and so is the link before the last of any arm.
    """
    parts = _parts(model)
    single = [mover for mover in _innermost(parts, parts.firsts) if len(parts.firsts[mover]) == 1]
    return _first_links(model, parts, single)


class _Parts(NamedTuple):
    """The links of a URDF that move as one, by index.

    Links that only fixed joints connect move as one rigid group. A group is named by the last joint that
    moves it, None where no joint does.

    Attributes:
        group: of each link, the group that it belongs to.
        children: of each link, the links that hang on it.
        firsts: group → the first link of each part with a shape that moves on it.
    """

    group: list[str | None]
    children: list[list[int]]
    firsts: dict[str | None, list[int]]

    def below(self, first: int) -> list[int]:
        """Return a link and all that hang on it, in order."""
        found = [first]
        for link in found:
            found += self.children[link]
        return sorted(found)


def _parts(model: RobotModel) -> _Parts:
    """Return which links move as one, and what moves on them."""
    names = model.link_names
    group: list[str | None] = [None] * len(names)
    children: list[list[int]] = [[] for _ in names]
    for joint in model.joints:  # parents before children
        group[joint.child] = joint.name if joint.source >= 0 else group[joint.parent]
        children[joint.parent].append(joint.child)
    shaped = [model.has_shape(name) for name in names]
    for joint in reversed(model.joints):
        shaped[joint.parent] |= shaped[joint.child]
    firsts: dict[str | None, list[int]] = {}
    for joint in model.joints:
        if joint.source >= 0 and shaped[joint.child]:
            firsts.setdefault(group[joint.parent], []).append(joint.child)
    return _Parts(group, children, firsts)


def _hands(parts: _Parts) -> list[str | None]:
    """Return the groups that two or more parts move on."""
    return [mover for mover, firsts in parts.firsts.items() if len(firsts) > 1]


def _first_links(model: RobotModel, parts: _Parts, movers: Iterable[str | None]) -> list[str]:
    """Return the first link of each of some groups."""
    return [model.link_names[parts.group.index(mover)] for mover in movers]


def _innermost(parts: _Parts, hands: Collection[str | None]) -> list[str | None]:
    """Return the groups without those whose "fingers" carry fingers themselves: the torso is no palm."""
    among = set(hands)
    carries = [mover in among for mover in parts.group]
    for link in reversed(range(len(carries))):  # children after their parents
        carries[link] |= any(carries[child] for child in parts.children[link])
    return [mover for mover in hands if not any(carries[first] for first in parts.firsts[mover])]


def check_fingers(model: RobotModel, structure: HandStructure) -> None:
    """Check that every finger is in one piece: shapes that lie elsewhere than their links measure nothing.

    Raises:
        UrdfError: a link of a finger is far from the one that it hangs on.
    """
    poses = model.forward(model.default_values())
    placed = {
        link: [points @ poses[k][:3, :3].T + poses[k][:3, 3] for points in model.hulls(link)]
        for finger in structure.fingers
        for link in links_with_shapes(model, finger)
        for k in [model.link_index(link)]
    }
    for finger in structure.fingers:
        for link in finger:
            before = [name for name in _above(model, link) if name in finger and name in placed]
            if link not in placed or not before:
                continue
            gap = min(max(_apart(a, b), _apart(b, a)) for a in placed[link] for b in placed[before[-1]])
            if gap > LARGEST_GAP:
                where = f"hand: gap between the shapes of {before[-1]} and {link} (mm)"
                raise UrdfError(model.path, where, round(1e3 * gap, 1), "fingers in one piece")


def _above(model: RobotModel, link: str) -> list[str]:
    """Return the links from the root to the one that a link hangs on."""
    return [model.link_names[joint.parent] for joint in model.chain(link)]


def _apart(a: Array, b: Array) -> float:
    """Return how far (m) the faces of a convex hull of points (n, 3) at least part it from others (m, 3)."""
    planes = ConvexHull(a).equations
    return float((b @ planes[:, :3].T + planes[:, 3]).min(axis=0).max())


def links_with_shapes(model: RobotModel, *links: Iterable[str]) -> tuple[str, ...]:
    """Return the links of several groups that have a collision shape, in the model's order."""
    wanted = {link for group in links for link in group}
    return tuple(link for link in model.colliding_links() if link in wanted)
