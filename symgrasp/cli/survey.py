"""``symgrasp survey``: thousands of maps along axes, kept in a store."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

from symgrasp.cli.shared import (
    Commands,
    add_command,
    add_out,
    add_packages,
    check_out,
    say,
    warn,
    whole,
    write_picture,
)
from symgrasp.errors import InputError, SymgraspError

if TYPE_CHECKING:
    from symgrasp.survey.running import Done

__all__ = ["add_parser", "need_extra", "progress_of_points", "run"]

VALUES = ("share", "margin", "plan", "plan_margin", "state")
ENDINGS = (".png", ".svg")


def add_parser(commands: Commands) -> None:
    """Add the command to the parser."""
    text = "Compute maps and plans over grids of poses, objects, hands and places; needs symgrasp[survey]."
    command = add_command(commands, "survey", run, text)
    actions = command.add_subparsers(metavar="list|run|show", required=True, dest="action")
    add_command(actions, "list", _list, "List the surveys that come with the package.")
    text = "Run a survey; run again, it goes on where it was."
    running = add_command(actions, "run", _run, text)
    running.add_argument("survey", metavar="SURVEY", help="name of a shipped survey, or a .yaml file")
    add_packages(running)
    text = "folder of the store of the results"
    running.add_argument("--out", metavar="DIR.zarr", type=Path, required=True, help=text)
    text = "processes on this machine (default: as many as it has cores)"
    running.add_argument("--workers", metavar="N", type=whole(1), help=text)
    add_scheduler(running)
    showing = add_command(actions, "show", _show, "Say what a survey found, and draw it.")
    showing.add_argument("store", metavar="DIR.zarr", type=Path, help="a store of results")
    text = "what to draw (default: plan if there is one, else share)"
    showing.add_argument("--value", choices=VALUES, help=text)
    text = "draw where a grasp at this height (cm) on the object is feasible instead: its workspace"
    showing.add_argument("--grasp", metavar="CM", type=float, help=text)
    text = "of --grasp: turn of the hand about its approach (default: %(default)s)"
    showing.add_argument("--roll", type=int, choices=(0, 180), default=0, help=text)
    add_out(showing, "write the picture: .png or .svg")


def add_scheduler(command: argparse.ArgumentParser) -> None:
    """Add ``--scheduler``, the address of a cluster."""
    text = "run on the Dask cluster of this scheduler, which is trusted: it can run anything here"
    command.add_argument("--scheduler", metavar="tcp://HOST:PORT", help=text)


def run(args: argparse.Namespace) -> int:
    """Do what the action says; return the exit status."""
    return args.run(args)


def need_extra() -> None:
    """Raise SymgraspError where the packages that surveys need are not installed."""
    from importlib.util import find_spec

    missing = [name for name in ("distributed", "xarray", "zarr", "cryptography") if find_spec(name) is None]
    if missing:
        raise SymgraspError(f"surveys need {', '.join(missing)}: pip install 'symgrasp[survey]'")


def _list(args: argparse.Namespace) -> int:
    from symgrasp.survey.shipped import list_surveys

    for name, description in list_surveys().items():
        say(f"{name:20} {description}")
    return 0


def _run(args: argparse.Namespace) -> int:
    need_extra()
    if args.workers and args.scheduler:
        raise InputError("command line", "--workers", args.workers, "only one of --workers and --scheduler")
    if not args.out.absolute().parent.is_dir():
        expected = f"a folder in an existing folder, not {args.out.parent}"
        raise InputError("command line", "--out", str(args.out), expected)
    from symgrasp.survey.running import run_survey
    from symgrasp.survey.survey import Survey

    survey = Survey.load(args.survey)
    for note in (*survey.scene.notes, *survey.notes):
        warn(f"{survey.file.name}: {note}")
    try:
        with progress_of_points(survey.file.name) as progress:
            run_survey(survey, args.out, workers=args.workers, scheduler=args.scheduler, progress=progress)
    except KeyboardInterrupt:
        print(file=sys.stderr)
        say(f"stopped: what is computed is in {args.out}; run it again to go on")
        return 130
    say(f"{survey.file.name}: {survey.points} points in {args.out}")
    return 0


@contextmanager
def progress_of_points(what: str) -> Iterator[Callable[[Done], None] | None]:
    """Tell about points that are computed inside the ``with`` block: how many, how fast, and the time left.

    Yields:
        A callback; None where stderr is no terminal.
    """
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    rate = TextColumn("{task.fields[rate]}")
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), rate)
    with Progress(*columns, console=Console(stderr=True)) as shown:
        row = shown.add_task(what, total=None, rate="")
        start: list[tuple[float, int]] = []

        def show(done: Done) -> None:
            start[:] = start or [(perf_counter(), done.points)]
            (began, before), now = start[0], perf_counter()
            rate = ""
            if done.points > before:  # over all of the run: batches arrive in bursts
                each = (now - began) / (done.points - before)
                left = timedelta(seconds=round(each * (done.of - done.points)))
                rate = f"{1 / each:.1f} points/s, {left} left"
            shown.update(row, total=done.of, completed=done.points, rate=rate)

        yield show


def _show(args: argparse.Namespace) -> int:
    need_extra()
    check_out(args.out, ENDINGS)
    from symgrasp.feasibility.pictures import to_png
    from symgrasp.page import show_picture
    from symgrasp.survey.pictures import draw_survey
    from symgrasp.survey.results import in_words, values_of, workspace
    from symgrasp.survey.store import open_results

    survey, results = open_results(args.store)
    for line in in_words(survey, results):
        say(line)
    if args.grasp is None:
        shown = values_of(results, args.value)
    else:
        shown = workspace(survey, results, args.grasp / 100, args.roll)
    figure = draw_survey(survey, shown)
    if args.out:
        write_picture(args.out, figure)
    else:
        show_picture(to_png(figure), survey.file.name)
    return 0
