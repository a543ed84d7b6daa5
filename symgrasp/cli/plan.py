"""``symgrasp plan``: plan grasps for the tasks of a scene."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import closing
from itertools import chain, islice, repeat
from typing import TYPE_CHECKING, Any

from symgrasp.cli.shared import (
    Commands,
    add_command,
    add_out,
    add_scene,
    check_out,
    checked_scene,
    progress_of,
    say,
    whole,
)
from symgrasp.errors import InputError, one_of
from symgrasp.plan.algorithms import ALGORITHMS

if TYPE_CHECKING:
    from symgrasp.plan.plan import Plan
    from symgrasp.progress import Progress
    from symgrasp.scene.scene import Scene

__all__ = ["add_parser", "run"]


def add_parser(commands: Commands) -> None:
    """Add the command to the parser."""
    command = add_command(commands, "plan", run, "Plan grasps: write a plan as JSON, or list all there are.")
    command.add_argument("kind", choices=tuple(ALGORITHMS), help="which planner")
    add_scene(command)
    add_out(command, "the plan file to write")
    command.add_argument("--list", metavar="N", type=whole(1), help="list the N best plans, one a line")
    text = "write the K-th best plan (default: 1), as numbered by --list"
    command.add_argument("--number", metavar="K", type=whole(1), default=1, help=text)
    command.add_argument("--arm", metavar="NAME", help="sequential: the arm (default: the first task's)")
    text = "; ".join(f"{kind}: {', '.join(methods)}" for kind, methods in ALGORITHMS.items())
    command.add_argument("--method", metavar="METHOD", help=f"{text}; the first is the default")
    command.add_argument("--task", metavar="NAME", help="bimanual: the task that several arms do")
    text = "with the motion of all arms: the first plan, from --number on, that has one"
    command.add_argument("--motion", action="store_true", help=text)
    text = "--motion: the fastest of the N first that have one (default: 1)"
    command.add_argument("--best", metavar="N", type=whole(1), default=1, help=text)
    text = "of hill_climb and --motion: seed (default: %(default)s)"
    command.add_argument("--seed", type=whole(0), default=0, help=text)


def run(args: argparse.Namespace) -> int:
    """Plan, list and write what is asked for; return the exit status."""
    check_out(args.out)
    method = _method(args)
    scene = checked_scene(args.scene)
    with progress_of(f"{args.kind} plan") as progress:
        if args.motion:
            plan = _moving(args, scene, method, progress)
        elif method == ALGORITHMS[args.kind][0]:
            plan = _listed(args, scene, progress)
        else:
            plan = _by_other_method(args, scene, method, progress)
    if args.out:
        plan.save(args.out)
        _print_holds(plan)
        _print_motion(plan)
        say(f"written to {args.out}")
    return 0


def _method(args: argparse.Namespace) -> Any:
    """Return the method, after a look at the options that exclude each other.

    Raises:
        InputError: an option is missing or does not go with another.
    """
    if not args.out and not args.list:
        raise InputError("command line", "--out", None, "the plan file to write, or --list")
    methods = ALGORITHMS[args.kind]
    method = args.method or methods[0]
    if method not in methods:
        raise InputError("command line", "--method", method, one_of(methods, method))
    if method != methods[0] and (args.list or args.number > 1):
        raise InputError("command line", "--method", method, f"{methods[0]}: {method} finds one plan only")
    if args.best > 1 and not args.motion:
        raise InputError("command line", "--best", args.best, "--motion: its duration is compared")
    if args.motion and args.list:
        raise InputError("command line", "--motion", True, "no --list, which lists plans without motions")
    return method


def _moving(args: argparse.Namespace, scene: Scene, method: Any, progress: Progress | None) -> Plan:
    """Return the plan with a motion that is asked for, and print why others have none."""
    from symgrasp.motion.choosing import best_motion, failures_in_words
    from symgrasp.planners.planning import bimanual_plans, handover_plans, regrasp_plans, sequential_plans

    if method == "regrasp":
        plans = regrasp_plans(scene, args.arm, progress=progress)
    elif method != ALGORITHMS[args.kind][0]:
        plans = (_by_other_method(args, scene, method, progress) for _ in range(1))
    elif args.kind == "sequential":
        plans = sequential_plans(scene, args.arm, progress=progress)
    elif args.kind == "bimanual":
        plans = bimanual_plans(scene, args.task, progress=progress)
    else:
        plans = handover_plans(scene, progress=progress)
    if len(list(islice(plans, args.number - 1))) < args.number - 1:
        raise InputError("command line", "--number", args.number, "fewer: there are no more plans")
    plan, failures = best_motion(scene, plans, args.best, args.seed, progress)
    for line in failures_in_words(failures):
        say(line)
    return plan


def _by_other_method(args: argparse.Namespace, scene: Scene, method: Any, progress: Progress | None) -> Plan:
    """Return the one plan that a method other than the default finds."""
    from symgrasp.planners.planning import plan_bimanual, plan_sequential

    if args.kind == "sequential":
        return plan_sequential(scene, args.arm, method=method, progress=progress)
    return plan_bimanual(scene, args.task, method=method, seed=args.seed, progress=progress)


def _listed(args: argparse.Namespace, scene: Scene, progress: Progress | None) -> Plan:
    """Print the best plans as far as asked for; return the one whose number is asked for."""
    from symgrasp.plan.listing import plan_in_words
    from symgrasp.planners.planning import bimanual_plans, handover_plans, sequential_maps, sequential_plans
    from symgrasp.planners.sequential import common_grasps, intervals_in_words

    notes: Iterator[str] = repeat("")
    if args.kind == "sequential":
        maps = sequential_maps(scene, args.arm, progress)
        plans = sequential_plans(scene, args.arm, maps)
        # In the order of the plans; those of an arm of five joints differ in pitch, too.
        grasps = [] if any(scene.arm(arm).pitched for _, arm in maps) else common_grasps(list(maps.values()))
        notes = chain((intervals_in_words(grasp, list(maps.values())) for grasp in grasps), notes)
    elif args.kind == "bimanual":
        plans = bimanual_plans(scene, args.task, progress=progress)
    else:
        plans = handover_plans(scene, progress=progress)
    chosen, count = None, 0
    with closing(plans):
        for count, plan in enumerate(islice(plans, max(args.list or 0, args.number)), start=1):
            note = next(notes)
            if count <= (args.list or 0):
                say(f"{count:4}  {plan_in_words(plan)}")
                if note:
                    say(f"      {note}")
            if count == args.number:
                chosen = plan
    if chosen is None:
        raise InputError("command line", "--number", args.number, f"at most {count}: there are no more plans")
    return chosen


def _print_holds(plan: Plan) -> None:
    """Print how the object is turned and held in every task."""
    from symgrasp.object.manifold import turn_text
    from symgrasp.plan.listing import place_in_words

    unsupported = {task["name"] for task in plan.scene.content["tasks"] if task.get("supported") is False}
    for task in plan.tasks:
        say(f"{task.name}: turn the object by {turn_text(task.delta)}")
        if task.name in unsupported:
            say("  nothing holds the object up but the hands (supported: false)")
        for hold in task.holds:
            say(f"  {hold.arm} holds at {place_in_words(hold.grasp)}, {1e3 * hold.clearance:.1f} mm clear")


def _print_motion(plan: Plan) -> None:
    """Print the parts of the motion of a plan that has one."""
    if plan.motion is None:
        return
    for segment in plan.motion.segments:
        where = dict.fromkeys((segment.task_from, segment.task_to))
        what = f"{segment.kind} {', '.join(segment.joints)}: {' → '.join(where)}"
        say(f"{what}, {segment.times[-1]:.2f} s, {1e3 * segment.clearance:.1f} mm clear")
    say(f"motion of {plan.motion.duration:.1f} s in {len(plan.motion.segments)} parts")
