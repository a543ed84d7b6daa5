"""Parallel hands as data, how they fit a profile, and the prints they leave on the manifold.

The tool frame of a hand, between the finger tips:

        | |   palm | |            z  approach, out of the palm
        | |        | |            y  closing direction, from one finger to the other
        | |   +--y | |            x = y x z, out of the page
        |_|   |    |_|
              z (approach)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import ConvexHull

from symgrasp.manifold import ROLLS, Manifold, grasp_to_tool, wrap
from symgrasp.poses import Array
from symgrasp.profile import Profile

__all__ = ["HANDS", "Hand", "Handprint", "handprint"]


@dataclass(frozen=True)
class Hand:
    """A parallel hand. All lengths in metres.

    Args:
        name: what scenes call it.
        links: all links of the hand that have a body.
        touch_links: those that may touch the object (and nothing else): the fingers.
        joints: joint name → joint value for each metre of opening; mimic joints follow.
        min_opening: smallest distance between the finger pads.
        max_opening: largest distance between the finger pads.
        finger_depth: how deep an object may reach between the fingers, from the tool frame
            towards the palm.
        pad_width: extent of the finger pads along the object's axis (the tool's x).
        clearance: gap to leave on each side of the object.
        radius_tolerance: largest change of the radius under the pads that still holds.
    """

    name: str
    links: tuple[str, ...]
    touch_links: tuple[str, ...]
    joints: Mapping[str, float] = field(hash=False)
    min_opening: float
    max_opening: float
    finger_depth: float
    pad_width: float
    clearance: float = 0.005
    radius_tolerance: float = 0.003

    def opening(self, radius: float) -> float:
        """Return how far (m) the fingers stand open around a radius (m)."""
        return float(np.clip(2 * (radius + self.clearance), self.min_opening, self.max_opening))

    def joint_values(self, opening: float) -> dict[str, float]:
        """Return the values of the hand's joints at an opening (m)."""
        return {name: ratio * opening for name, ratio in self.joints.items()}

    def standoff(self, radius: float) -> float:
        """Return the distance d (m) of the tool frame from the axis that keeps the palm outside."""
        return max(0.0, radius - self.finger_depth)

    def spans(self, radius: float) -> bool:
        """Whether the fingers go around a radius (m)."""
        return self.min_opening <= 2 * radius <= self.max_opening

    def pads_rest(self, profile: Profile, h: float) -> bool:
        """Whether the pads rest on the surface around height h (m): not over an end, not on a step."""
        low, high = h - self.pad_width / 2, h + self.pad_width / 2
        if low < profile.h_min - 1e-9 or high > profile.h_max + 1e-9:
            return False
        smallest, largest = profile.radius_span(low, high)
        return largest - smallest <= self.radius_tolerance


HANDS: Mapping[str, Hand] = {
    # Franka hand of pybullet_data: the pads' middle is 0.105 m and the palm 0.066 m from the
    # flange, the pads are 17.5 mm wide, each finger travels 40 mm.
    "franka": Hand(
        name="franka",
        links=("panda_hand", "panda_leftfinger", "panda_rightfinger"),
        touch_links=("panda_leftfinger", "panda_rightfinger"),
        joints={"panda_finger_joint1": 0.5},
        min_opening=0.0,
        max_opening=0.08,
        finger_depth=0.035,
        pad_width=0.0175,
    ),
}
"""The hands that a scene may name."""


@dataclass(frozen=True, eq=False)
class Handprint:
    """The cells that a hand covers when it grasps row ``row`` at column 0.

    Every point of the hand's bodies is projected onto (h, θ). Rows go on with the same height
    beyond both ends of the object, so that hands that reach past an end are told apart as well.
    Off the axis (h, θ) fixes the direction of a point seen from the axis, and a point on the
    axis covers every angle; so hands whose prints share no cell do not touch.

    Attributes:
        cells: (rows, angles) bool, read-only; true where any point of the hand projects to.
        first_row: the manifold's row (possibly negative) that ``cells[0]`` lies on.
    """

    cells: np.ndarray
    first_row: int

    def overlap(self, other: Handprint, columns: int) -> int:
        """Return how many cells this print at column 0 shares with another at ``columns``."""
        first = max(self.first_row, other.first_row)
        last = min(self.first_row + len(self.cells), other.first_row + len(other.cells))
        if first >= last:
            return 0
        mine = self.cells[first - self.first_row : last - self.first_row]
        theirs = other.cells[first - other.first_row : last - other.first_row]
        return int(np.count_nonzero(mine & np.roll(theirs, columns, axis=1)))

    def on(self, manifold: Manifold, column: int) -> np.ndarray:
        """Return the covered cells (heights, angles) of the object itself, at a column."""
        covered = np.zeros((manifold.heights, manifold.angles), dtype=bool)
        first, last = max(self.first_row, 0), min(self.first_row + len(self.cells), manifold.heights)
        if first < last:
            covered[first:last] = self.cells[first - self.first_row : last - self.first_row]
        return np.roll(covered, column, axis=1)


def handprint(bodies: Sequence[Array], manifold: Manifold, row: int, roll: int, standoff: float) -> Handprint:
    """Project the bodies of a hand that grasps ``row`` at column 0 onto the manifold.

    Exact for each convex body and row, then rounded up to whole cells: the slice of a convex
    body between two heights is convex, so seen from the axis it covers one interval of angles,
    which its corners bound.

    Args:
        bodies: vertices (n, 3) of each convex body in the tool frame, at the right opening.
        manifold: the grid.
        row: height index of the grasp.
        roll: index into `ROLLS`.
        standoff: distance (m) of the tool frame from the axis.
    """
    T_object_tool = grasp_to_tool(np.eye(4), manifold.h[row], 0.0, ROLLS[roll], standoff)
    placed = [points @ T_object_tool[:3, :3].T + T_object_tool[:3, 3] for points in bodies]
    lowest = min(points[:, 2].min() for points in placed)
    highest = max(points[:, 2].max() for points in placed)
    to_row = lambda h: int(np.floor((h - manifold.profile.h_min) / manifold.dh))  # noqa: E731
    # A hair is added on both sides so that rounding never loses a touched cell.
    first, last = to_row(lowest - 1e-9), to_row(highest + 1e-9)
    cells = np.zeros((last - first + 1, manifold.angles), dtype=bool)
    for points in placed:
        edges = _edges(points)
        for k in range(len(cells)):
            bottom = manifold.profile.h_min + (first + k) * manifold.dh
            corners = _slab_corners(points, edges, bottom - 1e-9, bottom + manifold.dh + 1e-9)
            if len(corners):
                cells[k] |= _covered_columns(corners, manifold)
    cells.setflags(write=False)
    return Handprint(cells, first)


def _edges(points: Array) -> np.ndarray:
    """Return the index pairs (m, 2) of the edges of the convex hull's triangles."""
    triangles = ConvexHull(points).simplices
    pairs = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    return np.unique(np.sort(pairs, axis=1), axis=0)


def _slab_corners(points: Array, edges: np.ndarray, bottom: float, top: float) -> Array:
    """Return the xy corners (n, 2) of a convex body cut to ``bottom <= z <= top``."""
    inside = (points[:, 2] >= bottom) & (points[:, 2] <= top)
    corners = [points[inside, :2]]
    a, b = points[edges[:, 0]], points[edges[:, 1]]
    for level in (bottom, top):
        crosses = (a[:, 2] - level) * (b[:, 2] - level) < 0
        s = (level - a[crosses, 2]) / (b[crosses, 2] - a[crosses, 2])
        corners.append(a[crosses, :2] + s[:, None] * (b[crosses, :2] - a[crosses, :2]))
    return np.concatenate(corners)


def _covered_columns(corners: Array, manifold: Manifold) -> np.ndarray:
    """Return the columns (angles,) covered by the convex hull of xy points, grasp at column 0."""
    distance = np.hypot(corners[:, 0], corners[:, 1])
    angles = np.arctan2(corners[:, 1], corners[:, 0])
    relative = wrap(angles - angles[0])
    low, high = relative.min() - 1e-9, relative.max() + 1e-9
    # A convex region spans half a turn or more exactly when it holds the axis.
    if distance.min() < 1e-9 or high - low >= np.pi:
        return np.ones(manifold.angles, dtype=bool)
    columns = np.zeros(manifold.angles, dtype=bool)
    first = int(np.floor((angles[0] + low) / manifold.dtheta + 0.5))
    last = int(np.floor((angles[0] + high) / manifold.dtheta + 0.5))
    columns[np.arange(first, last + 1) % manifold.angles] = True
    return columns
