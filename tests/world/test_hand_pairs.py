"""Links that overlap at every opening of a hand are told from those that the opening parts."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from symgrasp.errors import SceneError
from symgrasp.files import SCENES_DIR
from symgrasp.references import resolve
from symgrasp.robot.robot import Arm
from symgrasp.scene.scene import Scene
from symgrasp.world import check_homes, checked_self_pairs, own_pairs, prepared


def scene_with_box(tmp_path: Path, size: str) -> Scene:
    """The Panda of a shipped scene with a box (m) on its hand; fingers may slide further than it opens."""
    content = yaml.safe_load((SCENES_DIR / "bottle_on_table.yaml").read_text())
    source = resolve(content["robots"][0]["urdf"], Path())
    assert source is not None
    text = source.read_text().replace("package://", f"{source.parent}/")
    root = ET.fromstring(text)
    box = ET.SubElement(root, "link", name="safety_box")
    collision = ET.SubElement(box, "collision")
    ET.SubElement(ET.SubElement(collision, "geometry"), "box", size=size)
    joint = ET.SubElement(root, "joint", name="box_joint", type="fixed")
    ET.SubElement(joint, "parent", link="panda_hand")
    ET.SubElement(joint, "child", link="safety_box")
    ET.SubElement(joint, "origin", xyz="0 0 0.1")
    for finger in root.iter("joint"):
        if finger.get("type") == "prismatic" and (limit := finger.find("limit")) is not None:
            limit.set("upper", "0.4")
    path = tmp_path / "panda.urdf"
    path.write_bytes(ET.tostring(root))
    content["robots"][0]["urdf"] = str(path)
    return Scene.from_content(content)


def of_box(pairs) -> set[frozenset[str]]:
    return {frozenset(pair) for pair in pairs if "safety_box" in pair and any("finger" in x for x in pair)}


FINGERS = {frozenset(("safety_box", f"panda_{side}finger")) for side in ("left", "right")}


def test_a_box_around_the_fingers_bars_nothing_and_this_is_said(tmp_path):
    """The fingers leave the box only where they could slide, but the hand never takes them."""
    scene = scene_with_box(tmp_path, "0.06 0.2 0.05")
    assert of_box(checked_self_pairs(scene.robots["panda"].model)) == FINGERS
    assert not of_box(own_pairs(scene, "panda"))
    notes = [note for note in prepared(scene).notes if "every opening of hand franka" in note]
    assert len(notes) == 2
    assert all("safety_box" in note and "may touch" in note for note in notes)


def test_boxes_around_two_hands_of_one_name(tmp_path):
    """Hands that are measured are called what their robot is: both of it."""
    scene = scene_with_box(tmp_path, "0.06 0.2 0.05")
    first = scene.arm()
    other = Arm("other", first.robot, first.tool, replace(first.hand, joints={}))
    both = replace(scene, arms={"panda": first, "other": other})
    assert not of_box(own_pairs(both, "panda"))


def test_a_box_that_the_fingers_leave_is_checked(tmp_path):
    """Open fingers are beside it: only narrow grasps are barred."""
    scene = scene_with_box(tmp_path, "0.06 0.03 0.05")
    assert of_box(own_pairs(scene, "panda")) == FINGERS
    assert not any("every opening" in note for note in check_homes(scene))


def test_a_pair_that_no_hand_moves_is_checked(tmp_path):
    """A hand whose joints no arm lists: where the fingers are at home is left to whoever parks the robot."""
    scene = scene_with_box(tmp_path, "0.06 0.2 0.05")
    content = scene.file.model_dump(mode="json", exclude_none=True)
    content["robots"][0]["hand"] = {
        "name": "closed", "links": ["panda_hand"], "touch_links": [], "joints": {}, "min_opening": 0,
        "max_opening": 0.08, "finger_depth": 0.03, "pad_width": 0.02,
    }  # fmt: skip
    still = Scene.from_content(content)
    assert of_box(own_pairs(still, "panda")) == FINGERS
    assert np.isclose(still.robots["panda"].home[-1], 0)
    with pytest.raises(SceneError, match="finger"):
        check_homes(still)
