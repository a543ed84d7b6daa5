"""``symgrasp robots``: list the robots that installed packages hold."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from symgrasp.cli.shared import Commands, add_command, say
from symgrasp.errors import SymgraspError

if TYPE_CHECKING:
    from symgrasp.found_arms import FoundArm
    from symgrasp.robot.catalogue import CatalogueArm, CatalogueRobot

__all__ = ["add_parser", "run"]


def add_parser(commands: Commands) -> None:
    """Add the command to the parser."""
    add_command(commands, "robots", run, "List the robots of Python packages, their arms, solvers and hands.")


def run(args: argparse.Namespace) -> int:
    """Print every robot of the catalogue with its arms, solvers and hands; return the exit status."""
    from symgrasp.found_arms import find_arms
    from symgrasp.references import resolve
    from symgrasp.robot.catalogue import CATALOGUE
    from symgrasp.robot.model import RobotModel

    width = max(len(robot.name) for robot in CATALOGUE)
    for robot in CATALOGUE:
        path = resolve(robot.urdf, Path())
        if path is None:
            say(f"{robot.name:{width}}  {robot.title}: not installed; pip install {robot.package}")
            continue
        say(f"{robot.name:{width}}  {robot.title}: {robot.urdf}")
        model = RobotModel(path, follow_up_axis=robot.follow_up_axis)
        for arm, found in zip(robot.arms, find_arms(model), strict=True):
            joints = f"{len(found.joints)} joints, {found.joints[0]} to {found.joints[-1]}"
            say(f"{'':{width}}  {arm.name}: {joints}; {_solver(robot, arm)}")
            say(f"{'':{width}}    {_hand(found)}")
    return 0


def _solver(robot: CatalogueRobot, arm: CatalogueArm) -> str:
    """Return how the configurations of an arm are found, and whether all of them are."""
    from symgrasp.bench.arms.ik import bare_arm
    from symgrasp.ik import ArmIK, PitchedIK, solver_for

    try:
        ik = solver_for(bare_arm(robot, arm), 1)
    except SymgraspError as error:
        return f"no solver: {str(error).partition(': ')[2]}"
    assert isinstance(ik, ArmIK | PitchedIK)  # a bare arm has no torso
    return f"{ik.family}, {'which finds all configurations' if ik.complete else 'which may miss some'}"


def _hand(arm: FoundArm) -> str:
    """Return how far the hand of an arm opens, and why another is mounted where it has none."""
    assert arm.hand is not None
    opening = f"opens from {1e3 * arm.hand.min_opening:.0f} to {1e3 * arm.hand.max_opening:.0f} mm"
    if not arm.named:
        return f"hand at {arm.tool} {opening}"
    trouble = f", for none of its own can be used: {arm.trouble}" if arm.trouble else ""
    return f"hand {arm.hand.name}, mounted on {arm.tool}, {opening}{trouble}"
