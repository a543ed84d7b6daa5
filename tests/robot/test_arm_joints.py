"""Which joints of a chain are an arm's, of trees that are made up and of robots that people have."""

from __future__ import annotations

from pathlib import Path

import pytest

from symgrasp.errors import UrdfError
from symgrasp.references import resolve
from symgrasp.robot.arm_joints import guess_arm_joints, joints_between, revolute_joints
from symgrasp.robot.catalogue import CATALOGUE
from symgrasp.robot.model import RobotModel

LIMIT = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'


def tree(tmp_path: Path, **branches: str) -> RobotModel:
    """Return a robot of branches: name=parent link, then a letter for each joint.

    The letters: r turns, p slides, f is fixed, m mimics the first joint of the trunk. Joint and link k of a
    branch a are called ak; the last link is the branch's tool.
    """
    links, joints = ['<link name="base"/>'], []
    for name, text in branches.items():
        parent, kinds = text.split(":")
        for k, kind in enumerate(kinds, 1):
            links.append(f'<link name="{name}{k}"/>')
            word = {"r": "revolute", "p": "prismatic", "f": "fixed", "m": "revolute"}[kind]
            mimic = '<mimic joint="trunk1"/>' if kind == "m" else ""
            joints.append(
                f'<joint name="{name}{k}" type="{word}"><parent link="{parent}"/><child link="{name}{k}"/>'
                f"{LIMIT}{mimic}</joint>"
            )
            parent = f"{name}{k}"
    path = tmp_path / "tree.urdf"
    path.write_text(f'<robot name="tree">{"".join(links + joints)}</robot>')
    return RobotModel(path)


def names(branch: str, *numbers: int) -> list[str]:
    return [f"{branch}{k}" for k in numbers]


@pytest.mark.parametrize(
    ("branches", "tool", "expected"),
    [
        ({"a": "base:rrrrrr"}, "a6", names("a", *range(1, 7))),
        ({"a": "base:prrfrrrrr"}, "a9", names("a", 2, 3, 5, 6, 7, 8, 9)),
        # Seven are an arm, also with a torso among them: it has always been so.
        ({"trunk": "base:r", "a": "trunk1:rrrrrr", "b": "trunk1:rrrrrr"}, "a6",
         ["trunk1", *names("a", *range(1, 7))]),
        ({"trunk": "base:rr", "a": "trunk2:rrrrrr", "b": "trunk2:rrrrrr"}, "a6", names("a", *range(1, 7))),
        ({"trunk": "base:rprr", "a": "trunk4:rrrrrrr", "b": "trunk4:rrrrr"}, "a7", names("a", *range(1, 8))),
        # Fingers of three joints, and even of five, are no other arm.
        ({"trunk": "base:rr", "a": "trunk2:rrrrrr", "b": "trunk2:rrrrrrr", "finger": "a6:rrrrr"}, "a6",
         names("a", *range(1, 7))),
        # Two forks, of legs and of arms.
        ({"trunk": "base:rrr", "leg": "base:rrrrrr", "a": "trunk3:rrrrrrr", "b": "trunk3:rrrrrrr"}, "a7",
         names("a", *range(1, 8))),
        # What mimics takes no value, and is no joint of the arm.
        ({"trunk": "base:rrm", "a": "trunk3:rrrrrr", "b": "trunk3:rrrrrr"}, "a6", names("a", *range(1, 7))),
    ],
)  # fmt: skip
def test_the_guess(tmp_path, branches, tool, expected):
    assert guess_arm_joints(tree(tmp_path, **branches), tool) == expected


@pytest.mark.parametrize(
    ("branches", "tool"),
    [
        ({"a": "base:rrrrrrrr"}, "a8"),  # nothing says which
        ({"trunk": "base:rr", "a": "trunk2:rrrrrr", "head": "trunk2:rrrr"}, "a6"),  # only a head beside it
        ({"trunk": "base:rrr", "a": "trunk3:rrrrr", "b": "trunk3:rrrrrr"}, "a5"),  # five would be left
        ({"trunk": "base:r", "a": "trunk1:rrrrrrrr", "b": "trunk1:rrrrrrrr"}, "a8"),  # and eight
        ({"a": "base:rrrrrrrr", "b": "a5:rrrrrr"}, "a8"),  # a branch so far out that this arm has three left
    ],
)
def test_what_is_not_certain_is_refused(tmp_path, branches, tool):
    with pytest.raises(UrdfError, match=rf"arm at {tool}: .*expected joints: \[first, last\] in the scene"):
        guess_arm_joints(tree(tmp_path, **branches), tool)


@pytest.mark.parametrize(
    ("robot", "arm"), [(robot, arm) for robot in CATALOGUE for arm in robot.arms], ids=lambda x: x.name
)
def test_the_guess_agrees_with_the_catalogue(robot, arm):
    path = resolve(robot.urdf, Path())
    assert path is not None
    model = RobotModel(path)
    assert guess_arm_joints(model, arm.tool) == joints_between(model, arm.tool, *arm.joints)


def test_joints_that_are_named(tmp_path):
    model = tree(tmp_path, trunk="base:rpm", a="trunk3:rrrrrr")
    assert revolute_joints(model, "a6") == ["trunk1", *names("a", *range(1, 7))]
    assert joints_between(model, "a6", "trunk1", "a5") == ["trunk1", *names("a", *range(1, 6))]
    for first, last, message in [
        ("a0", "a6", "joints: 'a0': expected a joint that turns between the base and a6: one of 'a1'"),
        ("trunk2", "a6", "joints: 'trunk2'"),
        ("trunk3", "a6", "joints: 'trunk3'"),
        ("a6", "a1", "first the one that is nearer to the base"),
    ]:
        with pytest.raises(UrdfError, match=message):
            joints_between(model, "a6", first, last)
