"""``symgrasp export``: write a plan for another tool."""

from __future__ import annotations

import argparse

from symgrasp.cli.shared import Commands, add_command, add_out, add_plan, check_out, say, verified, write_out

__all__ = ["FORMATS", "add_parser", "run"]

FORMATS = ("csv", "trajectory", "tsr", "motion", "motion-csv", "html", "moveit-scene", "srdf")
"""The keys of `EXPORTS` and `MOTION_EXPORTS` of the modules ``exports``, which take long to import."""


def add_parser(commands: Commands) -> None:
    """Add the command to the parser."""
    text = "Check a plan, and write it in the format of another tool: 0 written, 1 the plan does not hold."
    command = add_command(commands, "export", run, text)
    command.add_argument("format", choices=FORMATS)
    add_plan(command)
    add_out(command, "the file to write", required=True)


def run(args: argparse.Namespace) -> int:
    """Write the plan in the other format if all of it holds; return the exit status."""
    check_out(args.out)

    from symgrasp.motion.exports import MOTION_EXPORTS
    from symgrasp.plan.exports import EXPORTS
    from symgrasp.plan.plan import Plan

    plan = Plan.load(args.plan)
    if not verified(plan, args.plan).holds:
        say(f"nothing is written to {args.out}")
        return 1
    write = {**EXPORTS, **MOTION_EXPORTS}[args.format]
    write_out(args.out, write(plan).encode())
    return 0
