"""``symgrasp verify``: check a plan."""

from __future__ import annotations

import argparse

from symgrasp.cli.shared import Commands, add_command, add_plan, checked_scene, verified

__all__ = ["add_parser", "run"]


def add_parser(commands: Commands) -> None:
    """Add the command to the parser."""
    text = "Check a plan: 0 it holds, 1 it does not, 2 it cannot be read."
    command = add_command(commands, "verify", run, text)
    add_plan(command)
    text = "the scene that the plan must be for: a .yaml file, or the name of a shipped scene"
    command.add_argument("--scene", metavar="FILE", help=text)
    text = "let no number be overstated at all, not even by rounding"
    command.add_argument("--strict", action="store_true", help=text)


def run(args: argparse.Namespace) -> int:
    """Print what does not hold; return 0 if everything does, else 1."""
    from symgrasp.plan.plan import Plan

    plan = Plan.load(args.plan)
    scene = checked_scene(args.scene) if args.scene else None
    return 0 if verified(plan, args.plan, scene, strict=args.strict).holds else 1
