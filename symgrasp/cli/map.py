"""``symgrasp map``: compute a feasibility map."""

from __future__ import annotations

import argparse
import json
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
    write_out,
)

if TYPE_CHECKING:
    from symgrasp.feasibility.color_by import ColorBy
    from symgrasp.feasibility.map import FeasibilityMap

__all__ = ["add_parser", "run"]

COLORS = (
    "reason", "feasible", "clearance", "margin-along", "margin-around", "hand-opening", "elbow-window",
)  # fmt: skip
"""What `symgrasp.feasibility.color_by.ColorBy` calls them, but for the spaces."""

ENDINGS = (".npz", ".png", ".svg", ".json")


def add_parser(commands: Commands) -> None:
    """Add the command to the parser."""
    text = "Compute a feasibility map and count its cells by reason."
    command = add_command(commands, "map", run, text)
    add_scene(command)
    add_task_and_arm(command)
    text = "samples of what the arm leaves free, or auto: all of it is searched (default: the scene's)"
    command.add_argument("--redundancy", metavar="N|auto", type=_redundancy, help=text)
    text = "prove of every cell that it holds as a whole, where that can be proven"
    command.add_argument("--certify", action="store_true", default=None, help=text)
    text = "what the colours of a picture show (default: reason); elbow-window: how far the elbow may swing"
    command.add_argument("--color-by", choices=COLORS, default=COLORS[0], help=text)
    add_out(command, "write the map: .npz, .png, .svg or .json")


def run(args: argparse.Namespace) -> int:
    """Compute the map, print its counts and write it if asked to; return the exit status."""
    check_out(args.out, ENDINGS)

    scene, task, arm = chosen(args)
    if args.redundancy is not None:
        scene = scene.with_settings(redundancy=args.redundancy)

    from symgrasp.feasibility.color_by import ColorBy
    from symgrasp.feasibility.create import MapMaker, create_map
    from symgrasp.reason import Reason
    from symgrasp.world import open_world

    color_by = ColorBy(args.color_by.replace("-", " "))
    with progress_of(f"map of {task.name}") as progress:
        the_map = create_map(scene, task=task.name, arm=arm.name, progress=progress, certify=args.certify)
    if color_by is ColorBy.WINDOW:
        with progress_of("windows of its cells") as progress, open_world(scene) as world:
            the_map = MapMaker(world).with_windows(the_map, progress)
    cells = the_map.reason.size
    say(f"{scene.name}: {task.name} with {arm.name}, {cells} cells")
    for reason, count in the_map.counts().items():
        say(f"  {reason.label:20} {count:6}  {100 * count / cells:5.1f} %")
    if the_map.resolution:
        proven = the_map.proven.sum() / max(1, (~the_map.feasible).sum())
        say(
            f"  {100 * proven:.1f} % of the infeasible cells are proven to be, the others to "
            f"{the_map.resolution:.0e} rad of the redundancy"
        )
    if the_map.certified is not None:
        whole = the_map.certified
        for what, these in (("feasible", the_map.feasible), ("infeasible", ~the_map.feasible)):
            count, proven = int(these.sum()), int((whole & these).sum())
            share = 100 * proven / max(1, count)
            say(f"  {proven} of {count} {what} cells ({share:.1f} %) are proven to be so as a whole")
    if the_map.refined is not None:
        split = "" if scene.settings.resolution is None else ", with cells split to parts"
        say(f"  feasible area{split}: {the_map.refined.area}")
    if Reason.NOT_FOUND in the_map.counts():
        say("  (not found: by a search for configurations, which is no proof that there is none)")
    if the_map.widest is not None and the_map.feasible.any():
        widths = sorted(map(math.degrees, the_map.widest[the_map.feasible].tolist()))
        middle, most = widths[len(widths) // 2], widths[-1]
        say(f"  widest elbow window of a feasible cell: {middle:.1f}° in the median, at most {most:.1f}°")
    if args.out:
        write_out(args.out, _content(the_map, args.out.suffix, color_by))
    return 0


def _redundancy(text: str) -> int | str:
    """Return a number of samples, or auto."""
    return text if text == "auto" else whole(1)(text)


def _content(the_map: FeasibilityMap, ending: str, color_by: ColorBy) -> bytes:
    """Return what a file of this ending holds."""
    from symgrasp.feasibility.pictures import to_png, to_svg

    if ending == ".png":
        return to_png(the_map.plot(color_by))
    if ending == ".svg":
        return to_svg(the_map.plot(color_by))
    if ending == ".json":
        return (json.dumps(the_map.to_dict(), allow_nan=False) + "\n").encode()
    return the_map.to_npz()
