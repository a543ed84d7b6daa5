"""Where the fingers of a hand hold objects: tool frame, depth, palm, and how far they open."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import ConvexHull

from symgrasp.errors import UrdfError
from symgrasp.hands.gripper import Gripper, snap_to_axis
from symgrasp.hands.held import Outline, held_radius, outline
from symgrasp.poses import Array, from_rotation, inverse
from symgrasp.robot.handprint import hull_edges, slab_corners

__all__ = ["SAMPLES", "TABLE_ERROR", "FingerFit", "best_fit", "openings_of"]

SAMPLES = 65
"""Number of finger configurations from closed to open that are measured."""

COARSE = 9
"""Number of them while parts of the motion are compared."""

STARTS, ENDS = (0.0, 0.2, 0.4), (1.0, 0.8, 0.6)
"""Where those parts start and end, as shares of the whole motion."""

WORTH = 0.002
"""A part is preferred if the fingers open by this (m) more in it."""

TIP_DISTANCE = 0.010
"""Distance (m) of the tool frame behind the finger tips where no link marks it: half a usual pad."""

PALM_CLEARANCE = 0.004
"""Distance (m) to keep between an object and the palm."""

LEAST_DEPTH = 0.002
"""A hand into which objects may not reach this deep (m) is none."""

ROUNDING = 1e-6
"""What distances are given away to rounding (m)."""

PALM_FACE_DEPTH = 0.005
"""The width of the palm is measured this far (m) behind its foremost point, because fronts are rounded."""

CUT_THICKNESS = 1e-6
"""Thickness (m) of the slab that stands for a cut by a plane."""

NARROWER = 5e-4
"""A hand may hold deeper as long as that costs no more of its opening than this (m)."""

OFF_CENTRE = 0.003
"""Fingers that one joint moves may be this far (m) from the middle between them: as far as an object is moved
when they close."""

TABLE_ERROR = 2.5e-4
"""Largest error (m) of the opening that a joint table may cause."""


class FingerFit(NamedTuple):
    """Where objects are held by fingers that move in a given range.

    Attributes:
        gripper: the fingers.
        T_base_tool: pose (4, 4) of the tool frame in the base.
        depth: how far (m) an object may reach behind it.
        palm_width: width (m) of the palm's face.
        palm_depth: its distance (m) behind the tool frame.
    """

    gripper: Gripper
    T_base_tool: Array
    depth: float
    palm_width: float
    palm_depth: float


def best_fit(gripper: Gripper, palm: Sequence[str], tool: str | None) -> FingerFit:
    """Return the part of the fingers' motion with which they open and close the most.

    Some joints open fingers until they point away from each other, or close them until they cross. Where they
    hold nothing at the tool link, the tool frame is where they do.

    Raises:
        UrdfError: in no part of it the fingers hold anything.
    """
    try:
        return _best_fit(gripper, palm, tool)
    except UrdfError:
        if tool is None:
            raise
        return _best_fit(gripper, palm, None)


def _best_fit(gripper: Gripper, palm: Sequence[str], tool: str | None) -> FingerFit:
    best, found, problem = 0.0, None, None
    for start, end in product(STARTS, ENDS):
        part = gripper._replace(motion=gripper.motion.part(start, end))
        try:
            T = _tool_pose(part, palm, tool)
            hulls = part.motion.hulls(palm, 1.0, T)
            width, face, front = _palm_face(hulls)
            fit = FingerFit(part, T, _finger_depth(part, T, hulls, front), width, face)
            openings, _ = openings_of(fit, COARSE)
        except UrdfError as error:
            problem = problem or error
            continue
        if np.ptp(openings) > best + WORTH:
            best, found = np.ptp(openings), fit
    if found is None:
        assert problem is not None
        raise problem
    return found


def _tool_pose(gripper: Gripper, palm: Sequence[str], tool: str | None) -> Array:
    """Return the pose (4, 4) of the tool frame in the base: z approach, y closing direction."""
    motion, y = gripper.motion, gripper.closing
    fingers = [link for side in gripper.sides for link in side]
    behind = motion.centre(palm, 1.0) if palm else np.zeros(3)
    z = 0.5 * (motion.centre(fingers, 0.0) + motion.centre(fingers, 1.0)) - behind
    if gripper.across is None:
        z = snap_to_axis(z - (z @ y) * y)
        z = z - (z @ y) * y
    else:
        across = np.cross(gripper.across, y)
        z = across * np.sign(across @ z)
    z /= np.linalg.norm(z)
    if tool is not None and gripper.across is None:
        model = motion.model
        links = model.forward(model.default_values())
        T = inverse(links[model.link_index(motion.base)]) @ links[model.link_index(tool)]
        y = -y if y @ T[:3, 1] < 0 else y
        T = from_rotation(np.column_stack([np.cross(y, z), y, z]), T[:3, 3])
        if all(points[:, 2].max() < 0 for points in motion.hulls(palm, 1.0, T)):
            return T
    T = from_rotation(np.column_stack([np.cross(y, z), y, z]))
    reach = min(gripper.outline(side, t, T).reach for side in (0, 1) for t in (0.0, 1.0))
    T[:3, 3] = (reach - TIP_DISTANCE) * z
    # Between the pads: of a parallel hand where it is open, of one that curls where it is closed.
    at = 1.0 if gripper.across is None else 0.0
    (low0, high0, out0), (low1, high1, out1) = (gripper.pad(side, at, T) for side in (0, 1))
    T[:3, 3] += T[:3, :3] @ [0.25 * (low0 + high0 + low1 + high1), 0.5 * (out0 - out1), 0.0]
    T[:3, 3] = T[:3, 3].round(4)
    return T


def _palm_face(hulls: Sequence[Array]) -> tuple[float, float, float]:
    """Measure the palm.

    Front and width are taken at y = 0, between the fingers, so an object that reaches behind the face within
    that width is certain to hit the palm.

    Args:
        hulls: vertices (n, 3) of the convex hulls of the palm in the tool frame.

    Returns:
        Width of the palm's face along x, distance of the face behind the tool frame, and distance of the
        palm's foremost point behind the tool frame (m); no width, and infinity, where it has none at y = 0.
    """
    front = -np.inf
    for points in hulls:
        turned = points[:, [0, 2, 1]]
        cut = slab_corners(turned, hull_edges(turned), -CUT_THICKNESS, CUT_THICKNESS)
        front = max([front, *cut[:, 1]])
    if not np.isfinite(front):
        return 0.0, 0.0, np.inf
    face = front - PALM_FACE_DEPTH
    width = 0.0
    for points in hulls:
        corners = slab_corners(points, hull_edges(points), face, face + CUT_THICKNESS)
        width = max(width, _width_at_middle(corners))
    return width, -face, -front


def _width_at_middle(corners: Array) -> float:
    """Return the width (m) along y = 0, symmetric about the origin, of the hull of xy corners (n, 2)."""
    if len(corners) < 3:
        return 0.0
    a, b = corners[ConvexHull(corners).simplices].transpose(1, 0, 2)
    crosses = a[:, 1] * b[:, 1] < 0
    a, b = a[crosses], b[crosses]
    x = a[:, 0] - a[:, 1] * (b[:, 0] - a[:, 0]) / (b[:, 1] - a[:, 1])
    return max(0.0, 2 * float(min(x.max(), -x.min()))) if len(x) else 0.0


def _finger_depth(gripper: Gripper, T_base_tool: Array, palm: Sequence[Array], front: float) -> float:
    """Return how deep (m) an object may reach behind the tool frame.

    It is the deepest for which the open hand holds objects that are as thick as at any other depth.

    Args:
        gripper: the fingers.
        T_base_tool: pose (4, 4) of the tool frame in the base.
        palm: vertices (n, 3) of the convex hulls of the palm in the tool frame.
        front: distance (m) of the palm's foremost point, between the fingers, behind the tool frame.

    Raises:
        UrdfError: no depth is left.
    """
    fingers = [link for side in gripper.sides for link in side]
    length = -min(float(p[:, 2].min()) for p in gripper.motion.hulls(fingers, 1.0, T_base_tool))
    deepest = front - PALM_CLEARANCE if np.isfinite(front) else length
    if deepest < LEAST_DEPTH:
        raise UrdfError(
            gripper.motion.model.path,
            "hand: finger depth (mm)",
            round(1e3 * deepest, 1),
            "fingers that reach beyond the palm",
        )
    depths = np.linspace(deepest, LEAST_DEPTH, SAMPLES)
    sides = [gripper.outline(side, 1.0, T_base_tool) for side in (0, 1)]
    held = np.min([np.minimum(held_radius(s, depths), _reach(s, depths)) for s in sides], axis=0)
    if palm:
        behind = outline(palm, 1.0)
        room = behind.distance(np.maximum(0.0, held - depths)) >= held + PALM_CLEARANCE - ROUNDING
        held = np.where(room, held, 0.0)
    return float(depths[np.argmax(held >= held.max() - NARROWER / 2)])


def openings_of(fit: FingerFit, samples: int) -> tuple[Array, Array]:
    """Return openings (m,), from where the fingers touch to fully open, and the joint values (m, k) there.

    Sides that no joint moves both are opened equally far, each by a parameter of its own.

    Args:
        fit: the fingers and where they hold objects.
        samples: number of configurations that are looked at.

    Raises:
        UrdfError: the opening does not grow, or the middle between the fingers moves too much.
    """
    gripper, T_base_tool, depth, *_ = fit
    motion = gripper.motion
    steps = np.linspace(0.0, 1.0, samples)
    outlines = [[gripper.outline(side, t, T_base_tool) for t in steps] for side in (0, 1)]
    radii = np.array([[held_radius(outline, depth) for outline in side] for side in outlines])
    reach = np.array([[_reach(outline, depth) for outline in side] for side in outlines])
    around = reach.min(axis=0)
    if (radii.min(axis=0) > around).all():
        expected = f"less: they reach around {2e3 * around.max():.0f}"
        raise UrdfError(
            motion.model.path, "hand: room between the fingers (mm)", round(2e3 * radii.min()), expected
        )
    moved = [motion.moves(links) for links in gripper.sides]
    if not (moved[0] & moved[1]).any():
        ranges = [_growing(steps, *side) for side in zip(radii, reach, strict=True)]
        low, high = (f(r[end] for _, r in ranges) for f, end in ((max, 0), (min, -1)))
        held = np.linspace(low, high, samples)
        own = [np.interp(held, r, t)[:, None] for t, r in ranges]
        t = np.where(moved[0], *own)
    else:
        t, held = _growing(steps, radii.min(axis=0), around)
        within = (steps >= t[0]) & (steps <= t[-1])
        # What is thicker than they reach around is not held, whatever room one of them leaves for it.
        room = np.minimum(radii, around)
        apart = float(np.abs(room[0] - room[1])[within].max(initial=0.0))
        if apart > OFF_CENTRE:
            where, expected = (
                "hand: how far one finger is ahead of the other (mm)",
                "fingers that meet in the middle",
            )
            raise UrdfError(motion.model.path, where, round(1e3 * apart, 1), expected)
        t = t[:, None]
    if held[-1] - held[0] < TABLE_ERROR:
        shown = (2e3 * held[[0, -1]]).round(1).tolist()
        raise UrdfError(
            motion.model.path, "hand: opening (mm)", shown, "fingers that part as their joints move"
        )
    if held[0] < TABLE_ERROR / 2:
        held[0] = 0.0
    return 2 * held, motion.joint_values(t)


def _reach(side: Outline, depth: ArrayLike) -> Array:
    """Return the radii (...) (m) of the thickest objects with axes no further out than the tips of fingers.

    From fingers that end behind its axis an object would slip.
    """
    return np.asarray(depth) + side.reach if side.reach > 0 else np.zeros_like(depth)


def _growing(steps: Array, radii: Array, reach: Array) -> tuple[Array, Array]:
    """Return the steps (n,) and radii (n,) from where the fingers touch to where they are open.

    Args:
        steps: (m,) parameters of the motion.
        radii: (m,) what the fingers leave room for there.
        reach: (m,) the thickest object that they reach around.
    """
    last = int(np.minimum(radii, reach).argmax())
    if last and radii[last] > reach[last]:  # they reach around it a little before
        ahead, behind = radii[last] - reach[last], reach[last - 1] - radii[last - 1]
        share = behind / (ahead + behind) if behind > 0 else 0.0
        steps, radii = steps.copy(), radii.copy()
        for values in (steps, radii):
            values[last] = values[last - 1] + share * (values[last] - values[last - 1])
    falls = np.flatnonzero(np.diff(radii[: last + 1]) <= 0)
    first = int(falls[-1]) + 1 if len(falls) else 0
    steps, radii = steps[first : last + 1], radii[first : last + 1]
    if first and len(steps) > 1 and falls[-1] == first - 1:  # they touch a little before
        step = steps[1] - steps[0]
        before = min(step, radii[0] * step / (radii[1] - radii[0]))
        steps, radii = np.append(steps[0] - before, steps), np.append(0.0, radii)
    return steps, radii
