"""Hands of two jaws, of which one is fixed on the hand and the other turns, such as that of the SO-101.

All is seen along the axis that the jaw turns about, in the plane (y, z): z is the approach, y points from
the fixed jaw to the other. An object of radius R lies with its axis at ``z = max(0, R - depth)`` of the tool
frame, as in any hand, and touches the fixed jaw there: so y of its axis follows from R. The other jaw turns
until it touches it too.

Jaws are taken as their meshes show them, seen from that side, not as convex hulls: those fill the room that a
hooked jaw leaves for the object.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import shapely
from scipy.spatial import ConvexHull

from symgrasp.errors import UrdfError
from symgrasp.hands.gripper import PAD_HALF_HEIGHT, FingerMotion
from symgrasp.hands.jaw_plane import LARGEST_RADIUS, RADIUS_STEP, Jaws, hold, holding_depth, longest_run
from symgrasp.hands.structure import HandStructure, links_with_shapes
from symgrasp.poses import Array, from_rotation, inverse
from symgrasp.robot.handprint import slab_corners
from symgrasp.robot.joint import Joint
from symgrasp.robot.model import RobotModel

__all__ = ["JawFit", "fit_jaw"]

WIDEST_TURN = np.deg2rad(200)
"""A joint that turns further than this moves no jaw."""

ALONG_AXIS = np.cos(np.deg2rad(30))
"""The approach is the coordinate axis that is within 30° of the closed jaw (this is the cosine)."""

LEAST_SHARE = 0.6
"""The fixed jaw reaches at least this share as far from the joint as the one that turns."""

TIP_DISTANCE = 0.010
"""Distance (m) of the tool frame behind the tips of the jaws where no link marks it."""

LEAST_OPENING = 0.010
"""A hand that opens by less than this (m) is none."""

LEAST_AREA = 1e-12
"""Triangles that show less than this (m²) are seen edge on."""

SIMPLER = 5e-5
"""Corners of an outline that change it by less than this (m) are left out."""


class JawFit(NamedTuple):
    """Where a hand with one jaw that turns holds objects.

    Attributes:
        motion: its joint: closed at 0, open at 1.
        T_base_tool: pose (4, 4) of the tool frame in the base.
        openings: (m,) diameters of objects (m), growing.
        values: (m, 1) joint values (rad) there.
        shifts: (m,) y of the object's axis in the tool frame there.
        depth: how far (m) an object may reach behind the tool frame.
        pad_width: extent (m) of the jaws along x where they touch objects.
        palm_width: extent (m) along x of what carries the jaws.
        palm_depth: its distance (m) behind the tool frame.
        fixed: the links of the fixed jaw.
    """

    motion: FingerMotion
    T_base_tool: Array
    openings: Array
    values: Array
    shifts: Array
    depth: float
    pad_width: float
    palm_width: float
    palm_depth: float
    fixed: tuple[str, ...]


def fit_jaw(model: RobotModel, structure: HandStructure, tool: str | None) -> JawFit:
    """Measure a hand of which one jaw turns.

    Args:
        model: the URDF.
        structure: the hand, with one finger: the jaw.
        tool: a link of the palm, whose origin is that of the tool frame where it is between the jaws.

    Raises:
        UrdfError: the jaw does not turn against a part of the palm, or they hold nothing.
    """
    joint, palm = _joint(model, structure), links_with_shapes(model, structure.palm)
    turning = links_with_shapes(model, structure.fingers[0])
    if not palm:
        raise UrdfError(model.path, f"link {structure.base}: collision", None, "the shape of a fixed jaw")
    motion, T_base_joint = _closing(model, structure.base, joint, palm, turning)
    tips = _tips(motion, palm, turning, T_base_joint)
    fixed, opened = (_outline(motion, links, T_base_joint) for links in (palm, turning))
    way = float(np.sign(T_base_joint[:3, 0] @ _axis(motion, joint)))
    jaws = Jaws(fixed, opened, way * float((motion.start - motion.end)[0]))
    x, y, z = 0.0, 0.0, min(tips) - TIP_DISTANCE
    marked = _marked(motion, tool, T_base_joint)
    if marked is not None and 0 < marked[2] < min(tips):
        x, y, z = marked
    depth, limit = holding_depth(model.path, jaws, z)
    radii = np.arange(RADIUS_STEP, LARGEST_RADIUS, RADIUS_STEP)
    holds = hold(jaws, radii, z, depth)
    run = longest_run(holds.held)
    radii, across, closed = radii[run], holds.y[run], holds.closed[run]
    depth = min(depth, float(radii.max(initial=0.0)))
    if len(radii) < 2 or 2 * np.ptp(radii) < LEAST_OPENING or (np.diff(closed) >= 0).any():
        shown = (2e3 * radii[[0, -1]]).round(1).tolist() if len(radii) else []
        raise UrdfError(model.path, "hand: opening (mm)", shown, "a jaw that parts from the fixed one")
    front = max(0.0, float(radii[-1]) - depth)
    T_base_plane = T_base_joint @ from_rotation(np.eye(3), np.array([0.0, 0.0, z]))
    if marked is None or z != marked[2]:
        y = float(across[0] - radii[0])
        low, high = _extent(motion, palm, 0.0, T_base_plane, -PAD_HALF_HEIGHT, front)
        x = 0.5 * (low + high)
    T = T_base_joint @ from_rotation(np.eye(3), np.array([x, y, z]))
    T[:3, 3] = T[:3, 3].round(4)
    x, y, z = (inverse(T_base_joint) @ T)[:3, 3]
    sides = [
        _extent(motion, links, t, T, -PAD_HALF_HEIGHT, front) for links, t in ((palm, 0.0), (turning, 0.0))
    ]
    behind = _extent(motion, palm, 0.0, T, -np.inf, -limit)
    return JawFit(
        motion, T, 2 * radii, motion.joint_values(1 - closed[:, None]), across - y, depth,
        2 * float(np.abs(sides).max()), 2 * float(np.abs(behind).max()), limit,
        tuple(link for link in palm if _reaches(motion, link, T, -limit)),
    )  # fmt: skip


def _joint(model: RobotModel, structure: HandStructure) -> Joint:
    """Return the joint of the jaw."""
    moved = [j for j in model.joints if j.source >= 0 and model.link_names[j.child] in structure.fingers[0]]
    joint = moved[0]
    if len({j.source for j in moved}) > 1 or joint.kind != "revolute" or joint.ratio != 1:
        names = [j.name for j in moved]
        raise UrdfError(model.path, "hand: joints", names, "two fingers, or a jaw that one joint turns")
    if not joint.upper - joint.lower < WIDEST_TURN:
        shown = round(float(np.rad2deg(joint.upper - joint.lower)), 1)
        expected = f"a jaw, which turns less than {np.rad2deg(WIDEST_TURN):.0f}"
        raise UrdfError(model.path, f"joint {joint.name}: range (degrees)", shown, expected)
    return joint


def _axis(motion: FingerMotion, joint: Joint) -> Array:
    """Return the axis (3,) of the jaw's joint in the base."""
    return _base_pose(motion, joint)[:3, :3] @ joint.axis


def _base_pose(motion: FingerMotion, joint: Joint) -> Array:
    poses = motion.model.forward(motion.model.default_values())
    return inverse(poses[motion.model.link_index(motion.base)]) @ poses[joint.child]


def _closing(
    model: RobotModel, base: str, joint: Joint, palm: Iterable[str], turning: Iterable[str]
) -> tuple[FingerMotion, Array]:
    """Return the motion of the jaw, and the frame (4, 4) in the base: at the joint, x along its axis."""
    ends = np.array([joint.lower]), np.array([joint.upper])
    motion = FingerMotion(model, base, np.array([joint.source]), *ends)
    pivot, axis = _base_pose(motion, joint)[:3, 3], _axis(motion, joint)
    plane = np.eye(3) - np.outer(axis, axis)
    tips = []
    for t in (0.0, 1.0):
        points = (np.concatenate(motion.hulls(turning, t, np.eye(4))) - pivot) @ plane
        tips.append(points[np.linalg.norm(points, axis=1).argmax()])
    fixed = (np.concatenate(motion.hulls(palm, 0.0, np.eye(4))) - pivot) @ plane
    gaps = [np.linalg.norm(fixed - tip, axis=1).min() for tip in tips]
    if gaps[1] < gaps[0]:
        motion, tips = motion._replace(start=motion.end, end=motion.start), tips[::-1]
    length = np.linalg.norm(tips[0])
    k = int(np.abs(tips[0]).argmax())
    z = np.sign(tips[0][k]) * np.eye(3)[k]
    if abs(tips[0][k]) < ALONG_AXIS * length or abs(axis[k]) > 1e-3:
        z = tips[0] / length
    y = np.cross(z, axis)
    y *= np.sign((tips[1] - tips[0]) @ y)
    return motion, from_rotation(np.column_stack([np.cross(y, z), y, z]), pivot)


def _tips(
    motion: FingerMotion, palm: Iterable[str], turning: Iterable[str], T_base_joint: Array
) -> tuple[float, float]:
    """Return how far (m) the fixed jaw and the closed one reach from the joint.

    Raises:
        UrdfError: the fixed one is much shorter: it is none.
    """
    fixed, closed = (
        1e3 * float(np.concatenate(motion.hulls(links, 0.0, T_base_joint))[:, 2].max())
        for links in (palm, turning)
    )
    if fixed < LEAST_SHARE * closed:
        expected = f"a fixed jaw that reaches as far as the one that turns, {closed:.0f}"
        where = "hand: reach of the fixed jaw from the joint (mm)"
        raise UrdfError(motion.model.path, where, round(fixed), expected)
    return 1e-3 * fixed, 1e-3 * closed


def _marked(motion: FingerMotion, tool: str | None, T_base_joint: Array) -> Array | None:
    """Return where (3,) the origin of the tool link is."""
    if tool is None:
        return None
    model = motion.model
    poses = model.forward(model.default_values())
    T_base_tool = inverse(poses[model.link_index(motion.base)]) @ poses[model.link_index(tool)]
    return (inverse(T_base_joint) @ T_base_tool)[:3, 3]


def _triangles(motion: FingerMotion, link: str, t: float, T_base_frame: Array) -> list[tuple[Array, Array]]:
    """Return vertices (n, 3) in a frame and faces (m, 3) of a link's shapes."""
    model = motion.model
    q = model.default_values()
    q[motion.sources] = motion.joint_values(t)
    poses = model.forward(q)
    pose = inverse(poses[model.link_index(motion.base)] @ T_base_frame) @ poses[model.link_index(link)]
    found = []
    for shape, hulls in zip(model.shapes(link), model.shape_hulls(link), strict=True):
        if shape.path is None:
            parts = [(points, ConvexHull(points).simplices) for points in hulls]
        else:
            mesh = shape.mesh(f"link {link}: mesh")
            parts = [(mesh.vertices @ shape.pose[:3, :3].T + shape.pose[:3, 3], mesh.faces)]
        found += [(points @ pose[:3, :3].T + pose[:3, 3], faces) for points, faces in parts]
    return found


def _outline(motion: FingerMotion, links: Iterable[str], T_base_frame: Array) -> shapely.Geometry:
    """Return the shapes of links in the plane (y, z), with the jaw open."""
    polygons = []
    for link in links:
        for points, faces in _triangles(motion, link, 1.0, T_base_frame):
            polygons.append(shapely.polygons(points[:, 1:][faces.astype(int)]))
    flat = np.concatenate(polygons)
    with np.errstate(divide="ignore", invalid="ignore"):  # GEOS leaves such flags behind
        joined = shapely.union_all(flat[shapely.area(flat) > LEAST_AREA])
        outline = shapely.simplify(joined, SIMPLER)
    shapely.prepare(outline)
    return outline


def _extent(
    motion: FingerMotion, links: Iterable[str], t: float, T_base_frame: Array, bottom: float, top: float
) -> tuple[float, float]:
    """Return the ends along x of what links have between two heights z of a frame (m)."""
    ends = [
        slab_corners(points, edges, bottom, top)[:, 0]
        for link in links
        for points, faces in _triangles(motion, link, t, T_base_frame)
        for edges in [np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])]
    ]
    x = np.concatenate(ends)
    return (float(x.min()), float(x.max())) if len(x) else (0.0, 0.0)


def _reaches(motion: FingerMotion, link: str, T_base_frame: Array, z: float) -> bool:
    return any(points[:, 2].max() > z for points, _ in _triangles(motion, link, 0.0, T_base_frame))
