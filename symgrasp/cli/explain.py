"""``symgrasp explain``: why a cell of a map is feasible or not."""

from __future__ import annotations

import argparse
import math

from symgrasp.cli.shared import Commands, add_command, add_scene, add_task_and_arm, chosen, progress_of, say

__all__ = ["add_parser", "run"]


def add_parser(commands: Commands) -> None:
    """Add the command to the parser."""
    text = "List every candidate of one cell of a map and what becomes of it."
    command = add_command(commands, "explain", run, text)
    add_scene(command)
    command.add_argument("--h", metavar="M", type=float, required=True, help="height along the axis (m)")
    command.add_argument(
        "--theta", metavar="DEG", type=float, required=True, help="angle around it (degrees)"
    )
    command.add_argument(
        "--roll", type=int, choices=(0, 180), default=0, help="degrees (default: %(default)s)"
    )
    add_task_and_arm(command)


def run(args: argparse.Namespace) -> int:
    """Print the cell's candidates; return the exit status."""
    from symgrasp.errors import InputError, ProfileError
    from symgrasp.feasibility.create import MapMaker
    from symgrasp.reason import Reason
    from symgrasp.world import open_world

    scene, task, arm = chosen(args)
    try:
        row, column = scene.manifold.cell(args.h, math.radians(args.theta))
    except ProfileError as error:
        raise InputError("command line", "--h", error.value, error.expected) from None
    with open_world(scene) as world, progress_of("candidates") as progress:
        cell = (args.roll // 180, row, column)
        found = MapMaker(world).explain(arm.name, task, cell, progress=progress)
    h, theta = 100 * scene.manifold.h[row], math.degrees(scene.manifold.theta[column])
    say(
        f"{scene.name}: {task.name} with {arm.name}, the cell at "
        f"h = {h:.1f} cm, θ = {theta:.1f}°, roll {args.roll}°: {found.reason.legend}"
    )
    if found.reason < Reason.UNREACHABLE:
        say("no candidates: the hand rules the cell out, whatever the arm does")
        return 0
    counts = [f"{count} {reason.label}" for reason, count in found.counts().items()]
    text = f"{len(found.candidates)} candidates: {', '.join(counts)}" if counts else "no candidates"
    say(f"{text}; {found.unreachable} of {len(found.phi)} redundancy samples have none")
    if found.reason != Reason.FEASIBLE:
        say(f"that none is feasible rests on {found.rests_on}")
    for result in found.candidates:
        say(f"  {result.where}  {result.reason.label:18}  {result.why}")
    return 0
