"""The command line. Bad input is one line on stderr and exit status 2."""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import replace
from itertools import islice, repeat
from pathlib import Path
from textwrap import indent
from typing import TYPE_CHECKING, Any

from symgrasp.errors import InputError, NoPlanError, SymgraspError, one_of
from symgrasp.files import resolve, write_atomically
from symgrasp.scene.format import scene_schema
from symgrasp.scene.scene import Scene
from symgrasp.scene.shipped import shipped_scenes

if TYPE_CHECKING:
    from symgrasp.feasibility.map import FeasibilityMap
    from symgrasp.plan.plan import Plan
    from symgrasp.progress import Progress

__all__ = ["main"]

DEFAULT_SCENE = "bottle_on_table"
METHODS = {
    "sequential": ("best", "first", "regrasp"),
    "bimanual": ("exact", "hill_climb"),
    "handover": ("exact",),
}
EXPORT_FORMATS = ("csv", "trajectory", "tsr")
MAP_ENDINGS = (".npz", ".png", ".svg", ".json")

# The heavy imports (PyBullet, viser) stand inside the commands that need them: `--help`,
# `scenes` and error messages answer at once.


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; return its exit status: 0 done, 1 no plan exists, 2 bad input, 130 cancelled."""
    args = _parser().parse_args(argv)
    try:
        return args.run(args)
    except NoPlanError as error:
        print(f"symgrasp: {error}", file=sys.stderr)
        return 1
    except SymgraspError as error:
        print(f"symgrasp: {error}", file=sys.stderr)
        return 2
    except BrokenPipeError:  # whoever reads the output has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as error:
        print(f"symgrasp: {error.filename}: {error.strerror}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("\nsymgrasp: cancelled", file=sys.stderr)
        return 130


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="symgrasp",
        description="Where can a robot arm hold an object of revolution, and why not elsewhere?",
    )
    commands = parser.add_subparsers(metavar="COMMAND", required=True)

    def add(name: str, run: Callable[[argparse.Namespace], int], text: str) -> argparse.ArgumentParser:
        command = commands.add_parser(name, help=text, description=text)
        command.set_defaults(run=run)
        return command

    def add_scene(command: argparse.ArgumentParser, nargs: str | None = None) -> None:
        text = "name of a shipped scene, or a .yaml file"
        command.add_argument("scene", metavar="SCENE", help=text, nargs=nargs, default=DEFAULT_SCENE)

    app = add("app", _app, "Start the page and print its address.")
    add_scene(app, "?")
    app.add_argument("--host", default="127.0.0.1", help="address to listen on (default: %(default)s)")
    app.add_argument("--port", type=int, default=8080, help="port to listen on (default: %(default)s)")

    add("scenes", _scenes, "List the shipped scenes.")

    map_ = add("map", _map, "Compute a feasibility map and count its cells by reason.")
    add_scene(map_)
    map_.add_argument("--task", metavar="NAME", help="task (default: the first)")
    map_.add_argument("--arm", metavar="NAME", help="arm (default: the task's first)")
    map_.add_argument("--out", metavar="FILE", type=Path, help="write the map: .npz, .png, .svg or .json")

    explain = add("explain", _explain, "List every candidate of one cell of a map and what becomes of it.")
    add_scene(explain)
    explain.add_argument("--h", metavar="M", type=float, required=True, help="height along the axis (m)")
    explain.add_argument(
        "--theta", metavar="DEG", type=float, required=True, help="angle around it (degrees)"
    )
    explain.add_argument(
        "--roll", type=int, choices=(0, 180), default=0, help="degrees (default: %(default)s)"
    )
    explain.add_argument("--task", metavar="NAME", help="task (default: the first)")
    explain.add_argument("--arm", metavar="NAME", help="arm (default: the task's first)")

    plan = add("plan", _plan, "Plan grasps: write a plan as JSON, or list all there are.")
    plan.add_argument("kind", choices=tuple(METHODS), help="which planner")
    add_scene(plan)
    plan.add_argument("--out", metavar="FILE", type=Path, help="the plan file to write")
    plan.add_argument("--list", metavar="N", type=_whole(1), help="list the N best plans, one a line")
    text = "write the K-th best plan (default: 1), as numbered by --list"
    plan.add_argument("--number", metavar="K", type=_whole(1), default=1, help=text)
    plan.add_argument("--arm", metavar="NAME", help="sequential: the arm (default: the first task's)")
    text = "; ".join(f"{kind}: {', '.join(methods)}" for kind, methods in METHODS.items())
    plan.add_argument("--method", metavar="METHOD", help=f"{text}; the first is the default")
    plan.add_argument("--task", metavar="NAME", help="bimanual: the task that several arms do")
    plan.add_argument("--seed", type=_whole(0), default=0, help="hill_climb: seed (default: %(default)s)")

    verify = add("verify", _verify, "Check a plan: 0 it holds, 1 it does not, 2 it cannot be read.")
    verify.add_argument("plan", metavar="PLAN", type=Path, help="a plan file")

    thing = add(
        "object", _object, "Say how an object is shaped, how symmetric it is and which hand holds it."
    )
    thing.add_argument("object", metavar="OBJECT", help="name of the library, a mesh, or a .yaml profile")
    thing.add_argument("--scale", type=float, default=1.0, help="metres in one unit of a mesh (default: 1)")
    thing.add_argument("--out", metavar="FILE", type=Path, help="write a picture of the profile (.png)")
    thing.add_argument("--fit", metavar="FILE", type=Path, help="write a picture of openings (.png)")

    hand = add("hand", _hand, "Measure a parallel hand in a URDF; print it as a scene file takes it.")
    hand.add_argument("urdf", metavar="URDF", help="a file, or package://<python package>/<path>")
    text = "a link fixed to the palm, best the tool frame (needed where a robot has several hands)"
    hand.add_argument("--tool", metavar="LINK", nargs="+", default=[None], help=text)

    export = add("export", _export, "Write a plan in the format of another tool.")
    export.add_argument("format", choices=EXPORT_FORMATS)
    export.add_argument("plan", metavar="PLAN", type=Path, help="a plan file")
    export.add_argument("--out", metavar="FILE", type=Path, required=True, help="the file to write")

    bench = add("bench", _bench, "Measure maps and planners against what one would do otherwise.")
    bench.add_argument("--out", metavar="FILE", type=Path, help="write the figures as JSON")

    schema = add("schema", _schema, "Print the JSON Schema of a file format.")
    schema.add_argument("format", choices=("scene", "plan"))
    return parser


def _app(args: argparse.Namespace) -> int:
    from app.__main__ import serve  # the page is started only when asked for

    serve(args.scene, host=args.host, port=args.port)
    return 0


def _scenes(args: argparse.Namespace) -> int:
    names = shipped_scenes()
    width = max(map(len, names))
    for name in names:
        print(f"{name:{width}}  {Scene.load(name).file.description}")
    return 0


def _map(args: argparse.Namespace) -> int:
    from symgrasp.feasibility.create import create_map

    if args.out:
        _check_folder(args.out)
        if args.out.suffix not in MAP_ENDINGS:
            raise InputError("command line", "--out", str(args.out), "an ending: " + one_of(MAP_ENDINGS))
    scene = _checked(args.scene)
    task = scene.task(args.task)
    arm = scene.arm(args.arm or task.arms[0])
    with _computing(f"map of {task.name}") as progress:
        the_map = create_map(scene, arm.name, task.name, progress=progress)
    cells = the_map.reason.size
    print(f"{scene.name}: {task.name} with {arm.name}, {cells} cells")
    for reason, count in the_map.counts().items():
        print(f"  {reason.label:20} {count:6}  {100 * count / cells:5.1f} %")
    if args.out:
        with write_atomically(args.out) as file:
            file.write(_map_content(the_map, args.out.suffix))
        print(f"written to {args.out}")
    return 0


def _explain(args: argparse.Namespace) -> int:
    from symgrasp.feasibility.create import MapMaker
    from symgrasp.reason import Reason
    from symgrasp.world import BulletWorld

    scene = _checked(args.scene)
    task = scene.task(args.task)
    arm = scene.arm(args.arm or task.arms[0])
    row, column = scene.manifold.cell(args.h, math.radians(args.theta))
    with BulletWorld(scene) as world, _computing("candidates") as progress:
        cell = (args.roll // 180, row, column)
        found = MapMaker(world, scene).explain(arm.name, task, cell, progress=progress)
    h, theta = 100 * scene.manifold.h[row], _deg(scene.manifold.theta[column])
    print(
        f"{scene.name}: {task.name} with {arm.name}, the cell at "
        f"h = {h:.1f} cm, θ = {theta:.1f}°, roll {args.roll}°: {found.reason.label}"
    )
    if found.reason < Reason.UNREACHABLE:
        print("no candidates: the hand rules the cell out, whatever the arm does")
        return 0
    counts = [f"{count} {reason.label}" for reason, count in found.counts().items()]
    text = f"{len(found.candidates)} candidates: {', '.join(counts)}" if counts else "no candidates"
    print(f"{text}; {found.unreachable} of {len(found.phi)} redundancy samples have none")
    for furthest in found.candidates:
        phi = _deg(furthest.phi)
        print(f"  φ {phi:7.1f}°  branch {furthest.branch}  {furthest.reason.label:18}  {furthest.why}")
    return 0


def _map_content(the_map: FeasibilityMap, ending: str) -> bytes:
    from symgrasp.feasibility.pictures import to_svg

    if ending == ".png":
        return the_map._repr_png_()
    if ending == ".svg":
        return to_svg(the_map.plot())
    if ending == ".json":
        return (json.dumps(the_map.to_dict(), allow_nan=False) + "\n").encode()
    return the_map.to_npz()


def _plan(args: argparse.Namespace) -> int:
    from symgrasp.plan.listing import place_in_words
    from symgrasp.planners.planning import plan_bimanual, plan_sequential

    if args.out:
        _check_folder(args.out)
    elif not args.list:
        raise InputError("command line", "--out", None, "the plan file to write, or --list")
    methods = METHODS[args.kind]
    method: Any = args.method or methods[0]
    if method not in methods:
        raise InputError("command line", "--method", method, one_of(methods, method))
    if method != methods[0] and (args.list or args.number > 1):
        raise InputError("command line", "--method", method, f"{methods[0]}: {method} finds one plan only")
    scene = _checked(args.scene)
    with _computing(f"{args.kind} plan") as progress:
        if method == methods[0]:
            plan = _listed(args, scene, progress)
        elif args.kind == "sequential":
            plan = plan_sequential(scene, args.arm, method=method, progress=progress)
        else:
            plan = plan_bimanual(scene, args.task, method=method, seed=args.seed, progress=progress)
    if args.out:
        plan.save(args.out)
        for task in plan.tasks:
            print(f"{task.name}: turn the object by {_deg(task.delta):.1f}°")
            for hold in task.holds:
                print(
                    f"  {hold.arm} holds at {place_in_words(hold.grasp)}, {1e3 * hold.clearance:.1f} mm clear"
                )
        print(f"written to {args.out}")
    return 0


def _listed(args: argparse.Namespace, scene: Scene, progress: Progress | None) -> Plan:
    """Print the best plans as far as asked for; return the one whose number is asked for."""
    from symgrasp.plan.listing import plan_in_words
    from symgrasp.planners.planning import bimanual_plans, handover_plans, sequential_maps, sequential_plans
    from symgrasp.planners.sequential import common_grasps, intervals_in_words

    notes: Iterator[str] = repeat("")
    if args.kind == "sequential":
        maps = sequential_maps(scene, args.arm, progress)
        plans = sequential_plans(scene, args.arm, maps)
        grasps = common_grasps(list(maps.values()))  # in the order of the plans
        notes = (f"\n      {intervals_in_words(grasp, list(maps.values()))}" for grasp in grasps)
    elif args.kind == "bimanual":
        plans = bimanual_plans(scene, args.task, progress=progress)
    else:
        plans = handover_plans(scene, progress=progress)
    chosen, count = None, 0
    with closing(plans):
        for count, plan in enumerate(islice(plans, max(args.list or 0, args.number)), start=1):
            note = next(notes)
            if count <= (args.list or 0):
                print(f"{count:4}  {plan_in_words(plan)}{note}")
            if count == args.number:
                chosen = plan
    if chosen is None:
        raise InputError("command line", "--number", args.number, f"at most {count}: there are no more plans")
    return chosen


def _verify(args: argparse.Namespace) -> int:
    from symgrasp.plan.plan import Plan
    from symgrasp.plan.verify import verify

    plan = Plan.load(args.plan)
    with _computing(f"verifying {args.plan.name}") as progress:
        report = verify(plan, progress)
    for failure in report.failures:
        print(failure)
    furthest = "the plan holds" if report.holds else f"{len(report.failures)} do not hold"
    print(f"{report.checks} statements checked: {furthest}")
    return 0 if report.holds else 1


def _hand(args: argparse.Namespace) -> int:
    from symgrasp.robot.measure_hand import hand_yaml, measure_hand
    from symgrasp.robot.model import RobotModel

    path = resolve(args.urdf, Path())
    if path is None:
        raise InputError("command line", "URDF", args.urdf, "an existing URDF file")
    model = RobotModel(path)
    for hand in [measure_hand(model, tool) for tool in args.tool]:
        if hand.urdf and args.urdf.startswith("package://"):
            hand = replace(hand, urdf=args.urdf)
        print(indent(hand_yaml(hand), "    "))
    return 0


def _object(args: argparse.Namespace) -> int:
    from symgrasp.feasibility.fit import plot_openings
    from symgrasp.feasibility.object_report import describe_object
    from symgrasp.feasibility.pictures import to_png
    from symgrasp.robot.hand import HANDS

    for option, out in (("--out", args.out), ("--fit", args.fit)):
        if out:
            _check_folder(out)
            if out.suffix != ".png":
                raise InputError("command line", option, str(out), "a file that ends in .png")
    report = describe_object(args.object, args.scale)
    for line in report.lines():
        print(line)
    pictures = [(args.out, report.plot), (args.fit, lambda: plot_openings(report.profile, HANDS))]
    for out, draw in pictures:
        if out:
            with write_atomically(out) as file:
                file.write(to_png(draw()))
            print(f"written to {out}")
    return 0


def _export(args: argparse.Namespace) -> int:
    from symgrasp.plan.exports import EXPORTS
    from symgrasp.plan.plan import Plan

    _check_folder(args.out)
    text = EXPORTS[args.format](Plan.load(args.plan))
    with write_atomically(args.out) as file:
        file.write(text.encode())
    print(f"written to {args.out}")
    return 0


def _bench(args: argparse.Namespace) -> int:
    from symgrasp.bench import report, run

    if args.out:
        _check_folder(args.out)
    figures = []
    for figure in run():
        print(figure.line(), flush=True)
        figures.append(figure)
    if args.out:
        with write_atomically(args.out) as file:
            file.write((json.dumps(report(figures), indent=2, ensure_ascii=False) + "\n").encode())
    return 0


def _schema(args: argparse.Namespace) -> int:
    if args.format == "scene":
        schema = scene_schema()
    else:
        from symgrasp.plan.plan import plan_schema

        schema = plan_schema()
    print(json.dumps(schema, indent=2))
    return 0


def _checked(name: str) -> Scene:
    from symgrasp.world import check_tasks

    scene = Scene.load(name)
    check_tasks(scene)
    return scene


def _check_folder(out: Path) -> None:
    if not out.parent.is_dir():
        raise InputError("command line", "--out", str(out), f"a file in an existing folder, not {out.parent}")
    if out.is_dir():
        raise InputError("command line", "--out", str(out), "a file, not a folder")


def _whole(lowest: int) -> Callable[[str], int]:
    """Return what reads a whole number of an option, from the lowest on."""

    def read(text: str) -> int:
        if not text.isdecimal() or int(text) < lowest:
            raise argparse.ArgumentTypeError(f"{text!r}: expected a whole number from {lowest} on")
        return int(text)

    return read


@contextmanager
def _computing(what: str) -> Iterator[Callable[[float], None] | None]:
    """Say on stderr that code is compiled, if so; give a callback that shows a percentage on a terminal."""
    from symgrasp.compiling import COMPILING_MESSAGE, notify_on_compile

    def show(share: float) -> None:
        end = "\n" if share >= 1 else ""
        print(f"\r{what}: {100 * share:3.0f} %", end=end, file=sys.stderr, flush=True)

    with notify_on_compile(lambda: print(f"symgrasp: {COMPILING_MESSAGE} …", file=sys.stderr, flush=True)):
        yield show if sys.stderr.isatty() else None


def _deg(angle: float) -> float:
    return math.degrees(angle)
