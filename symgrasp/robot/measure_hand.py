"""Measuring a parallel hand in its URDF: fingers, joint tables, tool frame and palm."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from scipy.spatial import ConvexHull

from symgrasp.errors import UrdfError, printable
from symgrasp.object.measure.outline import simplify
from symgrasp.poses import Array, from_rotation, inverse, quat_wxyz, rpy
from symgrasp.references import resolve, sought
from symgrasp.robot.assembly import Frame
from symgrasp.robot.gripper import (
    PAD_HALF_HEIGHT,
    Gripper,
    find_gripper,
    find_hand_structure,
    links_with_shapes,
    snap_to_axis,
)
from symgrasp.robot.hand import Hand, JointTable
from symgrasp.robot.handprint import hull_edges, slab_corners
from symgrasp.robot.model import RobotModel

__all__ = ["hand_yaml", "measure_hand"]

SAMPLES = 65
"""Number of finger configurations from closed to open that are measured."""

TIP_DISTANCE = 0.010
"""Distance (m) of the tool frame behind the finger tips where no link marks it: half a usual pad."""

PALM_CLEARANCE = 0.004
"""Distance (m) to keep between an object and the palm."""

PALM_FACE_DEPTH = 0.005
"""The width of the palm is measured this far (m) behind its foremost point, because fronts are rounded."""

CUT_THICKNESS = 1e-6
"""Thickness (m) of the slab that stands for a cut by a plane."""

WIDE_SHARE = 0.8
"""Objects may reach as deep as the open fingers keep this share of their opening: further back, pads that
tilt as they open stand too close together."""

ROOT_STEP = 5e-4
"""What stands further in than the pads by this (m, both sides together) belongs to a root of a finger."""

POSES = 9
"""Number of finger configurations from closed to open in which the roots are looked for."""

TABLE_ERROR = 2.5e-4
"""Largest error (m) of the opening that a joint table may cause."""


def measure_hand(urdf: RobotModel | str | Path, tool: str | None = None) -> Hand:
    """Measure a parallel hand.

    Args:
        urdf: the hand's URDF, or that of a robot with the hand on it: loaded, a path, or
            ``package://<package>/<path>``.
        tool: a link fixed to the palm, needed where a robot has several hands. Where its origin lies
            in front of the palm, it becomes that of the tool frame; the axes are measured.

    Raises:
        UrdfError: the URDF is unusable, there is no such link, or no part opens and closes like a
            parallel hand.
    """
    model = urdf if isinstance(urdf, RobotModel) else _load(urdf)
    structure = find_hand_structure(model, tool)
    gripper = find_gripper(model, structure)
    palm, fingers = links_with_shapes(model, structure.palm), links_with_shapes(model, *gripper.sides)
    T = _tool_pose(gripper, palm, tool)
    width, face, front = _palm_face(gripper.motion.hulls(palm, 1.0, T)) if palm else (0.0, 0.0, np.inf)
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
        tool=_tool_frame(model, T, structure.base, tool),
        urdf=str(model.path.resolve()) if structure.standalone else None,
    )


def _load(reference: str | Path) -> RobotModel:
    path = resolve(str(reference), Path())
    if path is None:
        raise UrdfError(reference, "urdf", str(reference), sought(str(reference), Path(), "URDF"))
    return RobotModel(path)


def hand_yaml(hand: Hand) -> str:
    """Return a hand as YAML in the notation of scene files, with a summary in comments."""
    mm = {key: f"{1e3 * value:.1f} mm" for key, value in vars(hand).items() if isinstance(value, float)}
    summary = [
        f"# fingers: {', '.join(hand.touch_links)}, moved by {', '.join(hand.joints)}",
        f"# they open from {mm['min_opening']} to {mm['max_opening']}; their pads are {mm['pad_width']} wide",
        f"# objects may reach {mm['finger_depth']} behind the tool frame; the palm is {mm['palm_depth']}"
        f" behind it, {mm['palm_width']} wide there",
    ]
    summary = [printable(line) for line in summary]  # a line break would end the comment
    if hand.urdf is not None:
        summary.append("# a hand of its own: the robot also needs mount: {link: LINK, pose: {…}}")
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
    return "\n".join([*summary, text])


def _frame_content(frame: Frame) -> dict[str, Any]:
    """Return a frame in the notation of scene files."""
    if frame.is_link:
        return {"link": frame.link}
    turn = np.rad2deg(rpy(frame.matrix())).round(4) + 0.0
    return {"link": frame.link, "pose": {"position": list(frame.position), "rpy_deg": turn.tolist()}}


def _tool_pose(gripper: Gripper, palm: Sequence[str], tool: str | None) -> Array:
    """Return the pose (4, 4) of the tool frame in the base: z approach, y closing direction."""
    motion, y = gripper.motion, gripper.closing
    fingers = [link for side in gripper.sides for link in side]
    behind = motion.centre(palm, 1.0) if palm else np.zeros(3)
    z = 0.5 * (motion.centre(fingers, 0.0) + motion.centre(fingers, 1.0)) - behind
    z = snap_to_axis(z - (z @ y) * y)
    z = z - (z @ y) * y
    z /= np.linalg.norm(z)
    if tool is not None:
        model = motion.model
        links = model.forward(model.default_values())
        T = inverse(links[model.link_index(motion.base)]) @ links[model.link_index(tool)]
        y = -y if y @ T[:3, 1] < 0 else y
        T = from_rotation(np.column_stack([np.cross(y, z), y, z]), T[:3, 3])
        if all(points[:, 2].max() < 0 for points in motion.hulls(palm, 1.0, T)):
            return T
    T = from_rotation(np.column_stack([np.cross(y, z), y, z]))
    reach = min(np.concatenate(motion.hulls(fingers, t, T))[:, 2].max() for t in (0.0, 1.0))
    T[:3, 3] = (reach - TIP_DISTANCE) * z
    (x0, _, out0), (x1, _, out1) = (gripper.pad(side, 1.0, T) for side in (0, 1))
    T[:3, 3] += T[:3, :3] @ [0.5 * (x0 + x1), 0.5 * (out0 - out1), 0.0]
    T[:3, 3] = T[:3, 3].round(4)
    return T


def _palm_face(hulls: Sequence[Array]) -> tuple[float, float, float]:
    """Measure the palm.

    The width is taken at y = 0, between the fingers, so an object that reaches behind the face
    within that width is certain to hit the palm.

    Args:
        hulls: vertices (n, 3) of the convex hulls of the palm in the tool frame.

    Returns:
        Width of the palm's face along x, distance of the face behind the tool frame, and distance of
        the palm's foremost point behind the tool frame (m).
    """
    front = max(float(points[:, 2].max()) for points in hulls)
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


def _finger_depth(gripper: Gripper, T_base_tool: Array, palm: float) -> float:
    """Return how deep (m) an object may reach: to the palm, the roots of the fingers, or where they narrow.

    Args:
        gripper: the fingers.
        T_base_tool: pose (4, 4) of the tool frame in the base.
        palm: distance (m) of the palm's foremost point behind the tool frame.

    Raises:
        UrdfError: no depth is left.
    """
    fingers = [link for side in gripper.sides for link in side]
    length = -min(float(p[:, 2].min()) for p in gripper.motion.hulls(fingers, 1.0, T_base_tool))
    deepest = min(palm - PALM_CLEARANCE, length)
    depth = _free_depth(gripper, T_base_tool, deepest) if deepest > 0 else 0.0
    if round(depth, 4) <= 0:
        where, expected = (
            gripper.motion.model.path,
            "fingers that stand apart from their pads back to the palm",
        )
        raise UrdfError(where, "hand: finger depth (mm)", round(1e3 * depth, 1), expected)
    return depth


def _free_depth(gripper: Gripper, T_base_tool: Array, deepest: float) -> float:
    """Return how far (m) behind the tool frame, at most ``deepest``, the pads stand apart without roots.

    A root stands further in than the pads. Pads of fingers that turn are tilted when the hand is open, and
    narrow evenly towards the palm, so it is their extension backwards that roots are told from.
    """
    depths = np.linspace(0.0, deepest, SAMPLES)
    free = np.ones(SAMPLES, dtype=bool)
    for t in np.linspace(0.0, 1.0, POSES):
        gaps = np.array([gripper.gap(t, T_base_tool, depth) for depth in depths])
        if gaps[0] < 0:  # not as far open as to touch
            continue
        ahead, behind = (gripper.gap(t, T_base_tool, z) for z in (-PAD_HALF_HEIGHT, PAD_HALF_HEIGHT))
        narrowing = min(ahead - gaps[0], gaps[0] - behind) / PAD_HALF_HEIGHT
        free &= gaps >= gaps[0] - narrowing * depths - ROOT_STEP
        if t == 1.0:
            free &= gaps >= WIDE_SHARE * gaps[0]
    return float(deepest if free.all() else depths[free.argmin() - 1])


def _openings(gripper: Gripper, T_base_tool: Array, depth: float) -> tuple[Array, Array]:
    """Return parameters t (m,) from where the fingers touch to fully open, and the openings (m,) there (m).

    Raises:
        UrdfError: the opening does not grow with t.
    """
    steps = np.linspace(0.0, 1.0, SAMPLES)
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


def _tables(gripper: Gripper, steps: Array, openings: Array) -> dict[str, JointTable]:
    """Return joint name → table over the opening, given the openings (m,) at the parameters steps (m,)."""
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
            table = tuple((_round(opening), round(float(value), 5)) for opening, value in knots)
            tables[motion.model.joint_names[source]] = table
    return tables


def _tool_frame(model: RobotModel, T_base_tool: Array, base: str, tool: str | None) -> Frame:
    """Return the tool frame relative to the given link, or to the base if none is given."""
    link = tool or base
    links = model.forward(model.default_values())
    pose = inverse(links[model.link_index(link)]) @ links[model.link_index(base)] @ T_base_tool
    if np.allclose(pose, np.eye(4), atol=1e-3):
        return Frame(link)
    position = tuple((_round(v) + 0.0) for v in pose[:3, 3])
    return Frame(link, (position[0], position[1], position[2]), tuple(quat_wxyz(pose).tolist()))


def _round(length: float) -> float:
    return round(float(length), 4)
