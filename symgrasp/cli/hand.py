"""``symgrasp hand``: measure a hand."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from textwrap import indent

from symgrasp.cli.shared import Commands, add_command, add_packages
from symgrasp.errors import InputError

__all__ = ["add_parser", "run"]


def add_parser(commands: Commands) -> None:
    """Add the command to the parser."""
    text = "Measure a parallel hand in a URDF; print it as a scene file takes it."
    command = add_command(commands, "hand", run, text)
    command.add_argument("urdf", metavar="URDF", help="a file, or package://<package>/<path>")
    add_packages(command)
    text = "a link fixed to the palm, best the tool frame (needed where a robot has several hands)"
    command.add_argument("--tool", metavar="LINK", nargs="+", default=[None], help=text)


def run(args: argparse.Namespace) -> int:
    """Print every hand that is asked for; return the exit status."""
    from symgrasp.references import portable, resolve, sought

    path = resolve(args.urdf, Path())
    if path is None:
        raise InputError("command line", "URDF", args.urdf, sought(args.urdf, Path(), "URDF"))

    from symgrasp.hands.measure import hand_yaml, measure_hand
    from symgrasp.robot.model import RobotModel

    model = RobotModel(path)
    for hand in [measure_hand(model, tool) for tool in args.tool]:
        if hand.urdf and (reference := portable(args.urdf, path)):
            hand = replace(hand, urdf=reference)
        print(indent(hand_yaml(hand), "    "))
    return 0
