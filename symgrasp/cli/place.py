"""``symgrasp place``: find where a robot should stand."""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from symgrasp.cli.shared import (
    Commands,
    add_command,
    add_out,
    add_scene,
    check_out,
    checked_scene,
    say,
    whole,
    write_out,
    write_picture,
)
from symgrasp.cli.survey import add_scheduler, need_extra, progress_of_points
from symgrasp.errors import InputError, one_of

if TYPE_CHECKING:
    from symgrasp.scene.scene import Scene
    from symgrasp.survey.placement import Base, Region

__all__ = ["add_parser", "run"]

PICTURES = (".png", ".svg")


def add_parser(commands: Commands) -> None:
    """Add the command to the parser."""
    text = "Find where a robot should stand, so that all tasks stay feasible; needs symgrasp[survey]."
    command = add_command(commands, "place", run, text)
    add_scene(command)
    command.add_argument("--robot", metavar="NAME", help="the robot that is moved (default: the first)")
    for name, what in (("x", "x (m)"), ("y", "y (m)"), ("z", "height (m)"), ("yaw", "turn (°)")):
        default = {"z": "as it is", "yaw": "any"}.get(name, "as far as the arm is long from the tasks")
        text = f"region of the base: {what} (default: {default})"
        command.add_argument(f"--{name}", metavar=("LOW", "HIGH"), nargs=2, type=_number, help=text)
    text = "distance (m) of the bases that are tried first (default: %(default)s)"
    command.add_argument("--step", metavar="M", type=_number, default=0.2, help=text)
    text = "rectangle (m) in which no base stands; may be given several times"
    metavar = ("X0", "X1", "Y0", "Y1")
    command.add_argument("--keep-out", metavar=metavar, nargs=4, type=_number, action="append", help=text)
    text = "folder of the surveys, to go on with after an interruption (default: none is kept)"
    command.add_argument("--store", metavar="DIR", type=Path, help=text)
    text = "processes on this machine (default: as many as it has cores)"
    command.add_argument("--workers", metavar="N", type=whole(1), help=text)
    add_scheduler(command)
    add_out(command, "write the scene with the robot at the best base: .yaml")
    add_out(command, "write the plan from there: .json", option="--plan")
    add_out(command, "write a picture of the bases from above: .png or .svg", option="--picture")


def run(args: argparse.Namespace) -> int:
    """Find bases, list the best and write what is asked for; return the exit status."""
    need_extra()
    for option, endings in (("out", (".yaml", ".yml")), ("plan", (".json",)), ("picture", PICTURES)):
        check_out(getattr(args, option), endings, f"--{option}")
    scene = checked_scene(args.scene)
    robot = args.robot or next(iter(scene.robots))
    if robot not in scene.robots:
        raise InputError("command line", "--robot", robot, one_of(scene.robots, robot))
    region = _region(args, scene, robot)

    import yaml

    from symgrasp.survey.placement import place_base
    from symgrasp.survey.placement_picture import draw_placement
    from symgrasp.survey.running import cluster, plan_margins_on

    with (
        _folder(args.store) as store,
        progress_of_points("bases") as progress,
        cluster(args.workers, args.scheduler) as client,
    ):
        found = place_base(scene, robot, region, partial(plan_margins_on, client, store, progress))
    served = sum(not math.isnan(margin) for margin in found.margins.values())
    say(f"{served} of {len(found.margins)} bases of {robot} that were tried serve all tasks; the best:")
    for number, own in enumerate(found.proposals, start=1):
        say(f"{number:3}  {_where(own.base)}: margin {1e3 * own.margin:.1f} mm, planned and verified")
    for base, why in found.refused.items():
        say(f"left out  {_where(base)}: {why}")
    best = found.proposals[0]
    if args.out:
        options = {"sort_keys": False, "default_flow_style": None, "allow_unicode": True, "width": 120}
        write_out(args.out, yaml.safe_dump(best.scene.content, **options).encode())
    if args.plan:
        best.plan.save(args.plan)
        say(f"written to {args.plan}")
    if args.picture:
        write_picture(args.picture, draw_placement(scene, robot, found))
    return 0


def _where(base: Base) -> str:
    x, y, z, yaw = base
    return f"x {x:.3f}, y {y:.3f}, z {z:.3f} m, turned by {yaw:.1f}°"


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not abs(value) <= 1e4:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a number")
    return value


def _region(args: argparse.Namespace, scene: Scene, robot: str) -> Region:
    """Return the region that the options say."""
    from dataclasses import replace

    from symgrasp.survey.format import KeepOut
    from symgrasp.survey.placement import reach_of

    if not 0.001 <= args.step <= 10:
        raise InputError("command line", "--step", args.step, "a length from 0.001 to 10 m")
    changes = {}
    for option, name in (("x", "x"), ("y", "y"), ("z", "z"), ("yaw", "yaw_deg")):
        given = getattr(args, option)
        if given is not None and given[0] > given[1]:
            raise InputError("command line", f"--{option}", given, "LOW HIGH, the lower one first")
        if option == "yaw" and given is not None and given[1] - given[0] > 360:
            raise InputError("command line", "--yaw", given, "LOW HIGH, a full turn apart at most")
        if given is not None:
            changes[name] = tuple(given)
    outs = []
    for x0, x1, y0, y1 in args.keep_out or ():
        if not (x0 < x1 and y0 < y1):
            raise InputError("command line", "--keep-out", [x0, x1, y0, y1], "X0 X1 Y0 Y1, lower ones first")
        outs.append(KeepOut(x=(x0, x1), y=(y0, y1)))
    return replace(reach_of(scene, robot, args.step), keep_out=tuple(outs), **changes)


@contextmanager
def _folder(store: Path | None) -> Iterator[Path]:
    """Make the folder of the stores, or one that is there for as long as the ``with`` block."""
    from symgrasp.files import temporary_folder

    if store is None:
        with temporary_folder() as folder:
            yield folder
        return
    if not store.absolute().parent.is_dir():
        expected = f"a folder in an existing folder, not {store.parent}"
        raise InputError("command line", "--store", str(store), expected)
    store.mkdir(exist_ok=True)
    yield store
