"""Measuring a hand in its URDF: fingers, joint tables, tool frame and palm."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from scipy.spatial import ConvexHull

from symgrasp.errors import UrdfError, printable
from symgrasp.hands.finger_fit import SAMPLES, TABLE_ERROR, best_fit, openings_of
from symgrasp.hands.gripper import FingerMotion, find_gripper
from symgrasp.hands.jaw import fit_jaw
from symgrasp.hands.structure import HandStructure, check_fingers, find_hand_structure, links_with_shapes
from symgrasp.hands.thumb import find_thumb
from symgrasp.object.measure.outline import simplify
from symgrasp.poses import Array, inverse, quat_wxyz, rpy
from symgrasp.references import resolve, sought
from symgrasp.robot.assembly import Frame
from symgrasp.robot.hand import Hand, JointTable
from symgrasp.robot.model import RobotModel

__all__ = ["LENGTHS", "hand_yaml", "measure_hand"]

LENGTHS = (
    "min_opening",
    "max_opening",
    "finger_depth",
    "pad_width",
    "palm_width",
    "palm_depth",
    "finger_width",
)
"""The lengths (m) of a `Hand` that are measured."""

MOST_LISTED = 8
"""More names than this are counted, not listed."""


def measure_hand(urdf: RobotModel | str | Path, tool: str | None = None) -> Hand:
    """Measure a hand whose fingers close from two sides, or of which one jaw closes on one that is fixed.

    Args:
        urdf: the hand's URDF, or that of a robot with the hand on it: loaded, a path, or
            ``package://<package>/<path>``.
        tool: a link fixed to the palm, needed where a robot has several hands or only one jaw turns. Where
            its origin lies in front of the palm, and the fingers hold objects there, it becomes that of the
            tool frame; the axes are measured.

    Raises:
        UrdfError: the URDF is unusable, there is no such link, or no part opens and closes like a hand.
    """
    model = urdf if isinstance(urdf, RobotModel) else _load(urdf)
    structure = find_hand_structure(model, tool)
    check_fingers(model, structure)
    if len(structure.fingers) == 1:
        return _jaw_hand(model, structure, tool)
    gripper = find_thumb(model, structure) or find_gripper(model, structure)
    palm, fingers = links_with_shapes(model, structure.palm), links_with_shapes(model, *gripper.sides)
    fit = best_fit(gripper, palm, tool)
    openings, values = openings_of(fit, SAMPLES)
    pads = [fit.gripper.pad(side, 0.5, fit.T_base_tool)[:2] for side in (0, 1)]
    idle = links_with_shapes(model, *structure.fingers)
    return Hand(
        name=model.path.stem.removesuffix(".urdf"),  # also of .urdf.xacro
        links=(*palm, *fingers, *(link for link in idle if link not in fingers)),
        touch_links=(*fingers, *_around(model, structure, fit.T_base_tool)),
        joints=_tables(fit.gripper.motion, values, openings),
        min_opening=_round(openings[0]),
        max_opening=_round(openings[-1]),
        finger_depth=_round(fit.depth),
        pad_width=_round(2 * np.abs(pads).max()),
        palm_width=_round(fit.palm_width),
        palm_depth=_round(fit.palm_depth),
        finger_width=_round(fit.gripper.motion.width_beside(fingers, values, fit.T_base_tool, fit.depth)),
        tool=_tool_frame(model, fit.T_base_tool, structure.base, tool),
        urdf=str(model.path.resolve()) if structure.standalone else None,
    )


def _around(model: RobotModel, structure: HandStructure, T_base_tool: Array) -> list[str]:
    """Return the links beside the palm with a shape where objects are held: a coarse one around the hand."""
    links = model.forward(model.default_values())
    held = (links[model.link_index(structure.base)] @ T_base_tool)[:3, 3]
    found = []
    for link in links_with_shapes(model, structure.beside):
        T_link = links[model.link_index(link)]
        at = T_link[:3, :3].T @ (held - T_link[:3, 3])
        if any((ConvexHull(points).equations @ [*at, 1.0] < 0).all() for points in model.hulls(link)):
            found.append(link)
    return found


def _jaw_hand(model: RobotModel, structure: HandStructure, tool: str | None) -> Hand:
    fit = fit_jaw(model, structure, tool)
    palm, jaw = links_with_shapes(model, structure.palm), links_with_shapes(model, *structure.fingers)
    return Hand(
        name=model.path.stem.removesuffix(".urdf"),  # also of .urdf.xacro
        links=(*palm, *jaw),
        touch_links=(*fit.fixed, *jaw),
        joints=_tables(fit.motion, fit.values, fit.openings),
        min_opening=_round(fit.openings[0]),
        max_opening=_round(fit.openings[-1]),
        finger_depth=_round(fit.depth),
        pad_width=_round(fit.pad_width),
        palm_width=_round(fit.palm_width),
        palm_depth=_round(fit.palm_depth),
        finger_width=_round(fit.motion.width_beside(jaw, fit.values, fit.T_base_tool, fit.depth)),
        shift=_table(fit.openings, fit.shifts),
        tool=_tool_frame(model, fit.T_base_tool, structure.base, tool),
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
        f"# fingers: {_listed(hand.touch_links, 'links')}, moved by {_listed(hand.joints, 'joints')}",
        f"# they open from {mm['min_opening']} to {mm['max_opening']}; their pads are {mm['pad_width']} wide",
        f"# beside the object fingers are {mm['finger_width']} wide",
        f"# objects may reach {mm['finger_depth']} behind the tool frame; the palm is {mm['palm_depth']}"
        f" behind it, {mm['palm_width']} wide there",
    ]
    if hand.shift:
        summary.append("# one jaw is fixed: objects touch it, and shift is where their axis lies along y")
    if len(hand.joints) > 2:
        summary.append("# these joints are taken to move together; the URDF does not say whether they can")
    summary = [printable(line) for line in summary]  # a line break would end the comment
    if hand.urdf is not None:
        summary.append("# a hand of its own: the robot also needs mount: {link: LINK, pose: {…}}")
    content = {
        "name": hand.name,
        "urdf": hand.urdf,
        "tool": hand.tool and _frame_content(hand.tool),
        "links": list(hand.links),
        "touch_links": list(hand.touch_links),
        "joints": {name: _table_content(table) for name, table in hand.joints.items()},
    }
    for key in LENGTHS:
        content[key] = getattr(hand, key)
    if hand.shift:
        content["shift"] = _table_content(hand.shift)
    content = {key: value for key, value in content.items() if value is not None}
    text = yaml.safe_dump({"hand": content}, sort_keys=False, default_flow_style=None, width=100)
    return "\n".join([*summary, text])


def _listed(names: Collection[str], what: str) -> str:
    """Return the names with commas between them, or how many of ``what`` they are where they are many."""
    return ", ".join(names) if len(names) <= MOST_LISTED else f"{len(names)} {what}"


def _frame_content(frame: Frame) -> dict[str, Any]:
    """Return a frame in the notation of scene files."""
    if frame.is_link:
        return {"link": frame.link}
    turn = np.rad2deg(rpy(frame.matrix())).round(4) + 0.0
    return {"link": frame.link, "pose": {"position": list(frame.position), "rpy_deg": turn.tolist()}}


def _table_content(table: JointTable) -> Any:
    """Return a table in the notation of scene files."""
    return table if isinstance(table, float | int) else [list(knot) for knot in table]


def _tables(motion: FingerMotion, values: Array, openings: Array) -> dict[str, JointTable]:
    """Return joint name → table over the opening, given joint values (m, k) at openings (m,) (m)."""
    names = [motion.model.joint_names[source] for source in motion.sources]
    return {name: _table(openings, at) for name, at in zip(names, values.T, strict=True)}


def _table(openings: Array, at: Array) -> JointTable:
    """Return the table of values (m,) at openings (m,) (m)."""
    error = TABLE_ERROR * np.ptp(at) / np.ptp(openings)
    ratio = float(openings @ at / (openings @ openings))
    if np.abs(ratio * openings - at).max() <= error:
        return float(f"{ratio:.4g}")
    knots = simplify(np.column_stack([openings, at]), error)
    return tuple((_round(opening), round(float(value), 5)) for opening, value in knots)


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
