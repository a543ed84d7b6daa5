"""Robots of many links: finding their arms takes as many steps as they have links, and no more."""

from __future__ import annotations

import sys
from collections.abc import Callable
from types import FrameType
from typing import Any

import pytest

from symgrasp.found_arms import find_arms
from symgrasp.robot.model import RobotModel

BOX = "<collision><geometry><box size='0.01 0.01 0.01'/></geometry></collision>"


class TooMuchWork(Exception):
    """More bytecodes were executed than allowed."""


def work(call: Callable[[], object], most: float = float("inf")) -> int:
    """Return how many bytecodes Python executes in a call: the same on every machine, busy or not."""
    count = 0

    def trace(frame: FrameType, event: str, argument: object) -> Any:
        nonlocal count
        frame.f_trace_opcodes, frame.f_trace_lines = True, False
        count += event == "opcode"
        if count > most:
            raise TooMuchWork
        return trace

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        call()
    finally:
        sys.settrace(before)
    return count


def urdf(links: int, kind: str, shape: str, branches: int = 1, at: int = 0) -> str:
    """Return a URDF of branches that hang on a link of the first one, each of so many links."""
    text = [f"<link name='l0'>{shape}</link>"]
    for branch in range(branches):
        parent = f"l0_{at}" if branch and at else "l0"
        for k in range(1, links):
            name = f"l{branch}_{k}"
            text.append(
                f"<link name='{name}'>{shape}</link><joint name='j{branch}_{k}' type='{kind}'>"
                f"<parent link='{parent}'/><child link='{name}'/><origin xyz='0 0 0.1'/>"
                f"<axis xyz='0 {k % 2} {1 - k % 2}'/>"
                "<limit lower='-1' upper='1' velocity='1' effort='1'/></joint>"
            )
            parent = name
    return f"<robot name='many'>{''.join(text)}</robot>"


def group(links: int, branches: int) -> str:
    """Return an SRDF with a group of all joints, one of all links, and a chain from end to end."""
    joints = "".join(f"<joint name='j{b}_{k}'/>" for b in range(branches) for k in range(1, links))
    names = "".join(f"<link name='l{b}_{k}'/>" for b in range(branches) for k in range(1, links))
    chain = f"<chain base_link='l0' tip_link='l0_{links - 1}'/>"
    return (
        f"<robot name='many'><group name='all'>{joints}</group><group name='links'>{names}</group>"
        f"<group name='chain'>{chain}</group></robot>"
    )


@pytest.mark.parametrize(
    ("kind", "shape", "branches", "at", "srdf"),
    [
        ("revolute", "", 1, 0, False),
        ("fixed", "", 1, 0, False),
        ("fixed", BOX, 1, 0, False),
        ("revolute", "", 4, 0, False),
        ("revolute", "", 4, 40, False),
        ("revolute", "", 2, 40, True),
    ],
)
def test_twice_the_links_take_twice_the_steps(tmp_path, kind, shape, branches, at, srdf):
    def model(links: int) -> RobotModel:
        path = tmp_path / f"many_{links}.urdf"
        path.write_text(urdf(links, kind, shape, branches, at))
        if not srdf:
            return RobotModel(path)
        described = path.with_suffix(".srdf")
        described.write_text(group(links, branches))
        return RobotModel(path, srdf=described)

    small, large = model(150), model(300)
    find_arms(small)  # what is computed once
    steps = work(lambda: find_arms(small))
    assert steps > 1000
    work(lambda: find_arms(large), most=2.3 * steps)


def test_loading_takes_as_many_steps_as_there_are_links(tmp_path):
    for links in (150, 300):
        (tmp_path / f"{links}.urdf").write_text(urdf(links, "revolute", BOX))
    RobotModel(tmp_path / "150.urdf")
    steps = work(lambda: RobotModel(tmp_path / "150.urdf"))
    work(lambda: RobotModel(tmp_path / "300.urdf"), most=2.3 * steps)
