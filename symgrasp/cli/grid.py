"""``symgrasp grid``: how the maps and the plan of a scene depend on the grid."""

from __future__ import annotations

import argparse
import json
from typing import TYPE_CHECKING

from symgrasp.cli.shared import (
    Commands,
    add_command,
    add_out,
    add_scene,
    check_out,
    checked_scene,
    progress_of,
    say,
    write_out,
)

if TYPE_CHECKING:
    from symgrasp.bench.maps.grids import GridResult
    from symgrasp.scene.scene import Scene

__all__ = ["add_parser", "run"]

ENDINGS = (".png", ".svg", ".json")

ERROR = 10.0
"""Error (%) of the grid that is named, unless told otherwise."""


def add_parser(commands: Commands) -> None:
    """Add the command to the parser."""
    text = "Compare coarse and fine grids: what their maps get wrong, and what becomes of the plan."
    command = add_command(commands, "grid", run, text)
    add_scene(command)
    text = "name the coarsest grid that gets no more of the feasible area wrong (default: %(default)g)"
    command.add_argument("--error", metavar="PERCENT", type=_percent, default=ERROR, help=text)
    add_out(command, "write a picture or the figures: .png, .svg or .json")


def run(args: argparse.Namespace) -> int:
    """Compare the grids, print what was found and write it if asked to; return the exit status."""
    check_out(args.out, ENDINGS)
    scene = checked_scene(args.scene)

    from symgrasp.bench.maps.grids import HEADER, REFERENCE, coarsest, measure_grids

    count = sum(len(task.arms) for task in scene.tasks.values())
    say(f"{scene.name}: {count} map{'s' if count > 1 else ''}, compared with those on {_size(*REFERENCE)}")
    say(f"{HEADER}   plan: margins, clearance")
    results = []
    with progress_of("grids") as progress:
        for result in measure_grids(scene, progress=progress):
            say(result.line())
            results.append(result)
    if not any(result.counts.truly for result in results):
        say("nothing is feasible on the finest grid, so no grid can be compared with it")
    elif found := coarsest(results, args.error / 100):
        say(f"coarsest grid with an error of at most {args.error:g} %: {_size(found.heights, found.angles)}")
    else:
        say(f"no grid has an error of at most {args.error:g} %")
    if args.out:
        write_out(args.out, _content(scene, results, args.out.suffix))
    return 0


def _percent(text: str) -> float:
    """Read a value of ``--error``."""
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 < value < 100:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a number between 0 and 100")
    return value


def _size(heights: int, angles: int) -> str:
    return f"{heights} × {angles}"


def _content(scene: Scene, results: list[GridResult], ending: str) -> bytes:
    """Return what a file of this ending holds."""
    from symgrasp.bench.figures import with_machine
    from symgrasp.bench.maps.grids import draw
    from symgrasp.feasibility.pictures import to_png, to_svg

    if ending == ".json":
        content = {"scene": scene.name, **with_machine("grids", results)}
        return (json.dumps(content, indent=2, ensure_ascii=False) + "\n").encode()
    figure = draw(scene, results)
    return to_png(figure) if ending == ".png" else to_svg(figure)
