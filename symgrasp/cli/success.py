"""``symgrasp success``: how probable grasps are where the object's pose is uncertain."""

from __future__ import annotations

import argparse
import math
from typing import TYPE_CHECKING

from symgrasp.cli.shared import (
    Commands,
    add_command,
    add_out,
    add_scene,
    add_task_and_arm,
    check_out,
    chosen,
    progress_of,
    say,
    whole,
    write_picture,
)

if TYPE_CHECKING:
    from symgrasp.robot.robot import Arm
    from symgrasp.scene.parts import Task
    from symgrasp.scene.scene import Scene
    from symgrasp.survey.success import PoseNoise

__all__ = ["add_parser", "run"]

ENDINGS = (".png", ".svg")


def add_parser(commands: Commands) -> None:
    """Add the command to the parser."""
    text = "Compute how probable it is that grasps are feasible where the object's pose is uncertain."
    command = add_command(commands, "success", run, text)
    add_scene(command)
    add_task_and_arm(command)
    text = "standard deviation of each coordinate of the object (default: %(default)s)"
    command.add_argument("--position", metavar="MM", type=_size, default=5.0, help=text)
    text = "the same of its rotations about the world's x and y (default: %(default)s)"
    command.add_argument("--tilt", metavar="DEG", type=_size, default=0.0, help=text)
    text = "uniform draws, at most so far off; otherwise normal ones"
    command.add_argument("--uniform", action="store_true", help=text)
    text = "all tasks are off alike, as by an error of calibration; otherwise each on its own"
    command.add_argument("--shared", action="store_true", help=text)
    text = "number of draws (default: %(default)s)"
    command.add_argument("--samples", metavar="N", type=whole(1, 100_000), default=100, help=text)
    command.add_argument("--seed", metavar="N", type=whole(0), default=0, help="(default: %(default)s)")
    add_out(command, "write a picture of the probability of every cell: .png or .svg")
    text = "write the sequential plan that is feasible with the largest probability: .json"
    add_out(command, text, option="--plan")


def run(args: argparse.Namespace) -> int:
    """Compute what is asked for and say the most probable grasps; return the exit status."""
    for option, endings in (("out", ENDINGS), ("plan", (".json",))):
        check_out(getattr(args, option), endings, f"--{option}")
    scene, task, arm = chosen(args)

    from symgrasp.survey.evaluation import plan_margin
    from symgrasp.survey.success import CONFIDENCE, PoseNoise, plan_for_success

    kind = "uniform" if args.uniform else "normal"
    noise = PoseNoise(args.position / 1e3, math.radians(args.tilt), kind, args.shared)
    if args.plan:
        with progress_of("plan") as progress:
            found = plan_for_success(scene, noise, args.arm, args.samples, args.seed, progress)
        found.plan.save(args.plan)
        low, high = (100 * p for p in found.interval)
        say(f"{scene.name}: all tasks feasible at {100 * found.probability:.1f} % of {args.samples} draws")
        say(f"  probability {low:.1f} to {high:.1f} % ({100 * CONFIDENCE:.0f} % confidence)")
        say(f"  margin where the object is expected: {1e3 * plan_margin(found.plan, scene.profile):.1f} mm")
        say(f"written to {args.plan}")
        if not args.out:
            return 0
    _map(args, noise, scene, task, arm)
    return 0


def _map(args: argparse.Namespace, noise: PoseNoise, scene: Scene, task: Task, arm: Arm) -> None:
    """Compute, describe and draw the probability of every cell."""
    from symgrasp.feasibility.create import MapMaker
    from symgrasp.survey.success import success_map
    from symgrasp.survey.success_picture import draw_success
    from symgrasp.world import open_world

    with open_world(scene) as world, progress_of(f"maps of {task.name}") as progress:
        found = success_map(MapMaker(world), arm.name, task, noise, args.samples, args.seed, progress)
    share = found.probability
    say(f"{scene.name}: {task.name} with {arm.name}, {args.samples} draws")
    for least in (0.99, 0.9, 0.5):
        say(f"  feasible with at least {100 * least:.0f} %: {int((share >= least).sum()):6} cells")
    say(f"  feasible where the object is expected: {int(found.nominal.feasible.sum()):6} cells")
    if args.out:
        write_picture(args.out, draw_success(found))


def _size(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0 <= value <= 1000:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a number from 0 to 1000")
    return value
