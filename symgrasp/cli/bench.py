"""``symgrasp bench``: measure maps and planners, or the inverse kinematics and maps of robots."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from symgrasp.cli.shared import Commands, add_command, add_out, check_out, say, whole, write_out
from symgrasp.errors import InputError

if TYPE_CHECKING:
    from symgrasp.bench import Figure

__all__ = ["add_parser", "run"]

POSES = 20_000
"""Random configurations of an arm that ``bench ik``, ``robots`` and ``singular`` look for, unless told
otherwise."""


RANDOM_MAPS = 100
"""Random scenes of ``bench guarantee``, unless told otherwise."""


def add_parser(commands: Commands) -> None:
    """Add the command to the parser."""
    text = "Measure maps and planners against what one would do otherwise, or the robots that packages ship."
    command = add_command(commands, "bench", run, text)
    text = (
        "measure the robots that packages ship instead: their inverse kinematics, or also a map of each, "
        "which an independent search then tries to refute; which singular poses are reached; what maps miss; "
        "what surveys cost; how fast motions are planned; or how long the plans of all shipped scenes take"
    )
    kinds = ("ik", "robots", "singular", "guarantee", "survey", "motion", "plans")
    command.add_argument("what", metavar="|".join(kinds), nargs="?", choices=kinds, help=text)
    text = "bench motion: with few runs of each"
    command.add_argument("--quick", action="store_true", help=text)
    text = "random configurations that `bench ik`, `robots` and `singular` look for (default: %(default)s)"
    command.add_argument("--poses", metavar="N", type=whole(1), default=POSES, help=text)
    text = "random scenes of `bench guarantee` (default: %(default)s)"
    command.add_argument("--random", metavar="N", type=whole(0), default=RANDOM_MAPS, help=text)
    add_out(command, "write the figures as JSON")
    text = "a run that `symgrasp bench --out` kept: say what became slower since, with exit status 1"
    command.add_argument("--compare", metavar="FILE", type=Path, help=text)


def run(args: argparse.Namespace) -> int:
    """Print every figure as it is measured, write and compare them if asked to; return the exit status."""
    check_out(args.out)
    if args.what:
        if args.compare:
            expected = "only times of maps and planners: no other kind of bench"
            raise InputError("command line", "--compare", args.what, expected)
        others = {
            "singular": _singular,
            "guarantee": _guarantee,
            "survey": _surveys,
            "motion": _motion,
            "plans": _plans,
        }
        _write(args.out, others.get(args.what, _robots)(args))
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


def _surveys(args: argparse.Namespace) -> dict[str, Any]:
    """Measure what surveys cost beside their maps."""
    from symgrasp.cli.survey import need_extra

    need_extra()
    from symgrasp.bench import survey

    return _told(survey.run())


def _guarantee(args: argparse.Namespace) -> dict[str, Any]:
    """Measure what maps miss."""
    from symgrasp.bench.maps import guarantee

    return _summed_up("maps", guarantee.run(args.random), guarantee.summary)


def _singular(args: argparse.Namespace) -> dict[str, Any]:
    """Measure which poses are reached inside the limits, singular ones and others."""
    from symgrasp.bench.arms import singular

    return _summed_up("arms", singular.run(args.poses), singular.summary)


def _summed_up(
    what: str, rows: Iterable[Any], summary: Callable[[list[Any]], Iterable[str]]
) -> dict[str, Any]:
    """Say the lines of rows as they come, then what they come to; return them with the machine."""
    from symgrasp.bench.figures import with_machine

    kept = []
    for row in rows:
        say(row.line())
        kept.append(row)
    for line in summary(kept):
        say(line)
    return with_machine(what, kept)


def _motion(args: argparse.Namespace) -> dict[str, Any]:
    """Measure how fast motions are planned."""
    from symgrasp.bench.motions import motion_times

    return _told(motion_times.run(args.quick))


def _plans(args: argparse.Namespace) -> dict[str, Any]:
    """Measure how long the plans of shipped scenes take."""
    from symgrasp.bench import plans

    return _told(plans.run())


def _told(measured: Iterable[Figure]) -> dict[str, Any]:
    """Print figures as they are measured; return them as plain data."""
    from symgrasp.bench import report

    figures = []
    for figure in measured:
        say(figure.line())
        figures.append(figure)
    return report(figures)


def _robots(args: argparse.Namespace) -> dict[str, Any]:
    """Measure the inverse kinematics of robots, or their maps."""
    from symgrasp.bench.arms import ik, robots
    from symgrasp.bench.figures import with_machine

    name, measured = ("arms", ik.run) if args.what == "ik" else ("robots", robots.run)
    rows = []
    for row in measured(args.poses):
        say(row.line())
        rows.append(row)
    return with_machine(name, rows)
