"""``symgrasp verify``: check a plan."""

from __future__ import annotations

import argparse

from symgrasp.cli.shared import Commands, add_command, add_plan, progress_of, say

__all__ = ["add_parser", "run"]


def add_parser(commands: Commands) -> None:
    """Add the command to the parser."""
    text = "Check a plan: 0 it holds, 1 it does not, 2 it cannot be read."
    add_plan(add_command(commands, "verify", run, text))


def run(args: argparse.Namespace) -> int:
    """Print what does not hold; return 0 if everything does, else 1."""
    from symgrasp.plan.plan import Plan
    from symgrasp.plan.verify import verify

    plan = Plan.load(args.plan)
    with progress_of(f"verifying {args.plan.name}") as progress:
        report = verify(plan, progress)
    for failure in report.failures:
        say(failure)
    result = "the plan holds" if report.holds else f"{len(report.failures)} do not hold"
    say(f"{report.checks} statements checked: {result}")
    return 0 if report.holds else 1
