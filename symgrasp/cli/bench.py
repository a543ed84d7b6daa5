"""``symgrasp bench``: measure maps and planners, or the inverse kinematics and maps of robots."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from symgrasp.cli.shared import Commands, add_command, add_out, check_out, say, whole, write_out
from symgrasp.errors import InputError

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
    text = "a run that `symgrasp bench --out` kept: say what became slower since, with exit status 1"
    command.add_argument("--compare", metavar="FILE", type=Path, help=text)


def run(args: argparse.Namespace) -> int:
    """Print every figure as it is measured, write and compare them if asked to; return the exit status."""
    check_out(args.out)
    if args.what:
        if args.compare:
            expected = "no ik or robots: only times of maps and planners are compared"
            raise InputError("command line", "--compare", args.what, expected)
        _write(args.out, _robots(args))
        return 0
    from symgrasp import bench

    kept = bench.read_run(args.compare) if args.compare else None
    figures = []
    for figure in bench.run():
        say(figure.line())
        figures.append(figure)
    _write(args.out, bench.report(figures))
    lines = bench.slower(kept, figures) if kept else []
    for line in lines:
        say(f"slower than in {args.compare}: {line}")
    return 1 if lines else 0


def _write(out: Path | None, content: dict[str, Any]) -> None:
    if out:
        write_out(out, (json.dumps(content, indent=2, ensure_ascii=False) + "\n").encode())


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
