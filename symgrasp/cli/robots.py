"""``symgrasp robots``: list the robots that installed packages hold."""

from __future__ import annotations

import argparse
from pathlib import Path

from symgrasp.cli.shared import Commands, add_command, say

__all__ = ["add_parser", "run"]


def add_parser(commands: Commands) -> None:
    """Add the command to the parser."""
    add_command(commands, "robots", run, "List the robots of Python packages, and which are installed.")


def run(args: argparse.Namespace) -> int:
    """Print two lines for every robot of the catalogue; return the exit status."""
    from symgrasp.references import resolve
    from symgrasp.robot.arm_joints import joints_between
    from symgrasp.robot.catalogue import CATALOGUE
    from symgrasp.robot.model import RobotModel

    width = max(len(robot.name) for robot in CATALOGUE)
    for robot in CATALOGUE:
        path = resolve(robot.urdf, Path())
        if path is None:
            say(f"{robot.name:{width}}  {robot.title}: not installed; pip install {robot.package}")
            continue
        model = RobotModel(path)
        say(f"{robot.name:{width}}  {robot.title}: {robot.urdf}")
        for arm in robot.arms:
            joints = joints_between(model, arm.tool, *arm.joints)
            hand = f"hand {arm.hand}" if arm.hand else f"hand at {arm.tool}"
            say(f"{'':{width}}  {arm.name}: {len(joints)} joints, {joints[0]} to {joints[-1]}, {hand}")
    return 0
