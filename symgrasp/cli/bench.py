"""``symgrasp bench``: measure maps and planners, or the inverse kinematics and maps of robots."""

from __future__ import annotations

import argparse
import json
from typing import Any

from symgrasp.cli.shared import Commands, add_command, add_out, check_out, say, whole, write_out

__all__ = ["add_parser", "run"]

POSES = 20_000
"""Random configurations of an arm that ``bench ik`` and ``bench robots`` look for, unless told otherwise."""


def add_parser(commands: Commands) -> None:
    """Add the command to the parser."""
    text = "Measure maps and planners against what one would do otherwise, or the robots that packages ship."
    command = add_command(commands, "bench", run, text)
    text = (
        "measure the robots that packages ship instead: their inverse kinematics, or also a map of each, "
        "which an independent search then tries to refute"
    )
    command.add_argument("what", metavar="ik|robots", nargs="?", choices=("ik", "robots"), help=text)
    text = "random configurations that `bench ik` and `bench robots` look for (default: %(default)s)"
    command.add_argument("--poses", metavar="N", type=whole(1), default=POSES, help=text)
    add_out(command, "write the figures as JSON")


def run(args: argparse.Namespace) -> int:
    """Print every figure as it is measured, and write them if asked to; return the exit status."""
    check_out(args.out)
    content = _robots(args) if args.what else _figures()
    if args.out:
        write_out(args.out, (json.dumps(content, indent=2, ensure_ascii=False) + "\n").encode())
    return 0


def _figures() -> dict[str, Any]:
    """Measure maps and planners."""
    from symgrasp import bench

    figures = []
    for figure in bench.run():
        print(figure.line(), flush=True)
        figures.append(figure)
    return bench.report(figures)


def _robots(args: argparse.Namespace) -> dict[str, Any]:
    """Measure the inverse kinematics of robots, or their maps."""
    from symgrasp.bench import ik, robots
    from symgrasp.bench.figures import with_machine

    name, measured = ("arms", ik.run) if args.what == "ik" else ("robots", robots.run)
    rows = []
    for row in measured(args.poses):
        say(row.line())
        rows.append(row)
    return with_machine(name, rows)
