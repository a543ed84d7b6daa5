"""The catalogue against the URDFs that it names, as ElementTree reads them."""

from __future__ import annotations

import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from symgrasp.robot.catalogue import CATALOGUE, CatalogueRobot
from symgrasp.robot.hand import HANDS, SIDED_HANDS

NAMES = [robot.name for robot in CATALOGUE]


def urdf(robot: CatalogueRobot) -> Path:
    """Return the file, found by hand: among the Python packages, or the data packages beside them."""
    inner = robot.urdf.removeprefix("package://")
    places = [Path(entry) / part / inner for entry in sys.path for part in ("", "cmeel.prefix/share")]
    return next(place for place in places if place.is_file())


def link(joint: ET.Element, end: str) -> str:
    element = joint.find(end)
    assert element is not None
    return element.attrib["link"]


def test_names_are_told_apart():
    assert len(set(NAMES)) == len(NAMES)
    assert all(len({arm.name for arm in robot.arms}) == len(robot.arms) for robot in CATALOGUE)


@pytest.mark.parametrize("name", NAMES)
def test_arms_are_there(name):
    """From the tool back to the last joint nothing turns, and five to seven joints are between the two."""
    robot = CATALOGUE[NAMES.index(name)]
    root = ET.parse(urdf(robot)).getroot()
    above = {link(joint, "child"): joint for joint in root.findall("joint")}
    for arm in robot.arms:
        assert arm.hand is None or arm.hand in {**HANDS, **SIDED_HANDS}
        chain, at = [], arm.tool
        while at in above:
            joint = above[at]
            if joint.get("type") != "fixed":
                chain.insert(0, joint)
            at = link(joint, "parent")
        names = [joint.get("name") for joint in chain]
        assert names[-1] == arm.joints[1]
        own = chain[names.index(arm.joints[0]) :]
        assert len(own) in (5, 6, 7)
        assert {joint.get("type") for joint in own} <= {"revolute", "continuous"}
