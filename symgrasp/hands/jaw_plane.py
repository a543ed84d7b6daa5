"""What two jaws hold that close on each other by turning, seen along the axis that one turns about.

In the plane (y, z) the joint is the origin, z is the approach, and y points from the fixed jaw to the other.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import ArrayLike

from symgrasp.errors import UrdfError
from symgrasp.poses import Array

__all__ = ["LARGEST_RADIUS", "RADIUS_STEP", "Jaws", "hold", "holding_depth", "longest_run"]

PALM_CLEARANCE = 0.004
"""Distance (m) to keep between an object and what carries the jaws."""

LEAST_DEPTH = 0.002
"""A hand into which objects may not reach this deep (m) is none."""

MOST_WEDGE = np.deg2rad(45)
"""Jaws hold an object as long as the surfaces that touch it are at most at this angle: half of it is the
angle of friction of a coefficient of 0.41, such as that of plastic on most things."""

LEANING = np.cos(np.deg2rad(45))
"""The fixed jaw is touched from the side of the other: the contact's normal is within 45° of y."""

LARGEST_RADIUS = 0.1
"""Radii up to this (m) are looked at."""

RADIUS_STEP = 5e-4
"""Distance (m) of the radii that are looked at."""

COARSE = 4
"""Depths are compared at every so many of them."""

DEPTHS = 9
"""Number of depths that are looked at."""

STEP = 1e-3
"""Distance (m) between places of an object where it may first touch the fixed jaw."""

TURNS = 65
"""Number of angles of the jaw at which it may first touch an object."""

HALVINGS = 16
"""Bisections between two places or angles."""


class Jaws(NamedTuple):
    """Two jaws in the plane, with the joint at the origin.

    Attributes:
        fixed: outline of the fixed jaw and of all that is rigid with it.
        turning: outline of the other one where it is open.
        closing: angle (rad) by which it turns from there to where it is closed, anticlockwise from y to z.
    """

    fixed: shapely.Geometry
    turning: shapely.Geometry
    closing: float


class Holds(NamedTuple):
    """How objects (n,) are held: whether they are, y of their axes, and the share of the turn that closes."""

    held: np.ndarray
    y: Array
    closed: Array


def holding_depth(path: Path, jaws: Jaws, z: float) -> tuple[float, float]:
    """Return how deep (m) objects may reach behind the tool frame, and where the palm begins.

    It is the deepest for which the jaws hold objects that are as thick as at any other depth.

    Args:
        path: the URDF, for errors.
        jaws: the jaws.
        z: height of the tool frame above the joint (m).
    """
    radii = np.arange(RADIUS_STEP, LARGEST_RADIUS, COARSE * RADIUS_STEP)
    thick = longest_run(hold(jaws, radii, z, LARGEST_RADIUS).held)
    # Thin objects are kept from going deeper by any rib of the jaw, not by the palm alone.
    thick = slice((thick.start + thick.stop) // 2, thick.stop)
    limit = min((float(radius) + _room(jaws, radius, z) for radius in radii[thick][::COARSE]), default=0.0)
    if limit - PALM_CLEARANCE < LEAST_DEPTH:
        expected = "jaws that hold something in front of the palm"
        raise UrdfError(path, "hand: finger depth (mm)", round(1e3 * limit, 1), expected)
    depths = np.linspace(limit - PALM_CLEARANCE, LEAST_DEPTH, DEPTHS)
    held = [hold(jaws, radii, z, depth).held for depth in depths]
    thickest = np.array([radii[longest_run(flags)].max(initial=0.0) for flags in held])
    return float(depths[np.argmax(thickest >= thickest.max() - COARSE * RADIUS_STEP / 2)]), limit


def _room(jaws: Jaws, radius: float, z: float) -> float:
    """Return how far (m) an object at the tool frame can go down the fixed jaw until it meets the palm."""
    down = np.arange(0.0, z, STEP)
    rests = _rest(jaws, np.full(len(down), radius), z - down, LARGEST_RADIUS)[0]
    return float(down[np.logical_and.accumulate(rests)].max(initial=0.0))


def hold(jaws: Jaws, radii: Array, z: float, depth: float) -> Holds:
    """Return how objects with radii (n,) (m) are held; see `holding_depth` for the other arguments."""
    rests, centres, normals = _rest(jaws, radii, z, depth)
    turns = np.linspace(0.0, 1.0, TURNS)

    def is_free(share: Array) -> np.ndarray:
        return _is_apart(jaws.turning, _turned(centres, -share * jaws.closing), radii)

    blocked = np.array([~is_free(np.full(len(radii), share)) for share in turns]).T
    first = blocked.argmax(axis=1)
    held = rests & blocked.any(axis=1) & (first > 0)
    closed = _bisect(is_free, turns[first - 1], turns[first])
    contacts = _nearest(jaws.turning, _turned(centres, -closed * jaws.closing))
    contacts = _turned(contacts, closed * jaws.closing)
    others = (centres - contacts) / radii[:, None]
    held &= -(normals * others).sum(axis=1) > np.cos(MOST_WEDGE)
    held &= centres[:, 1] <= shapely.bounds(jaws.fixed)[3]
    return Holds(held, centres[:, 0], closed)


def _rest(jaws: Jaws, radii: Array, z: ArrayLike, depth: float) -> tuple[np.ndarray, Array, Array]:
    """Return which objects (n,) rest on the fixed jaw, their centres (n, 2) there, and its normals (n, 2).

    They come from the side of the other jaw, until they touch something.
    """
    heights = np.asarray(z, dtype=float) + np.maximum(0.0, radii - depth)
    left, _, right, _ = shapely.bounds(jaws.fixed)
    places = np.arange(right + LARGEST_RADIUS, left, -STEP)

    def is_free(y: Array) -> np.ndarray:
        return _is_apart(jaws.fixed, np.column_stack([y, heights]), radii)

    blocked = np.array([~is_free(np.full(len(radii), y)) for y in places]).T
    first = blocked.argmax(axis=1)
    y = _bisect(is_free, places[first - 1], places[first])
    centres = np.column_stack([y, heights])
    normals = (centres - _nearest(jaws.fixed, centres)) / radii[:, None]
    return blocked.any(axis=1) & (first > 0) & (normals[:, 0] > LEANING), centres, normals


def _bisect(free: Callable[[Array], np.ndarray], good: Array, bad: Array) -> Array:
    """Return the last places (n,) that are free, between places that are and others that are not."""
    for _ in range(HALVINGS):
        middle = 0.5 * (good + bad)
        is_free = free(middle)
        good, bad = np.where(is_free, middle, good), np.where(is_free, bad, middle)
    return good


def _is_apart(outline: shapely.Geometry, points: Array, radii: Array) -> np.ndarray:
    """Return whether points (n, 2) are further than radii (n,) from an outline."""
    return ~shapely.dwithin(outline, shapely.points(points), radii)  # pyright: ignore[reportCallIssue, reportArgumentType]


def _nearest(outline: shapely.Geometry, points: Array) -> Array:
    """Return the points (n, 2) of an outline that are nearest to others (n, 2)."""
    lines = shapely.shortest_line(outline, shapely.points(points))
    return shapely.get_coordinates(lines)[::2]


def _turned(points: Array, angle: Array) -> Array:
    """Return points (n, 2), each turned about the origin by an angle of its own (n,), from y to z."""
    c, s = np.cos(angle), np.sin(angle)
    return np.column_stack([c * points[:, 0] - s * points[:, 1], s * points[:, 0] + c * points[:, 1]])


def longest_run(flags: np.ndarray) -> slice:
    """Return where the longest run of true flags (n,) is."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    starts, ends = edges[::2], edges[1::2]
    if not len(starts):
        return slice(0, 0)
    k = int((ends - starts).argmax())
    return slice(int(starts[k]), int(ends[k]))
