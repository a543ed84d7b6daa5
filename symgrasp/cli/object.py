"""``symgrasp object``: describe an object."""

from __future__ import annotations

import argparse

from symgrasp.cli.shared import Commands, add_command, add_out, check_out, say, write_out

__all__ = ["add_parser", "run"]


def add_parser(commands: Commands) -> None:
    """Add the command to the parser."""
    text = "Say how an object is shaped, how symmetric it is and which hand holds it."
    command = add_command(commands, "object", run, text)
    command.add_argument("object", metavar="OBJECT", help="name of the library, a mesh, or a .yaml profile")
    text = "metres in one unit of a mesh (default: 1)"
    command.add_argument("--scale", type=float, default=1.0, help=text)
    text = "how far a mesh may deviate from symmetry (default: the larger of 0.0015 and 3 %% of the radius)"
    command.add_argument("--tolerance", metavar="METRES", type=float, help=text)
    command.add_argument("--flip", action="store_true", help="stand the object of a mesh on its other end")
    add_out(command, "write a picture of the profile (.png)")
    add_out(command, "write a picture of openings (.png)", option="--fit")


def run(args: argparse.Namespace) -> int:
    """Print the report, and draw what is asked for; return the exit status."""
    for option, out in (("--out", args.out), ("--fit", args.fit)):
        check_out(out, (".png",), option)

    from symgrasp.feasibility.fit import plot_openings
    from symgrasp.feasibility.object_report import describe_object
    from symgrasp.feasibility.pictures import to_png
    from symgrasp.robot.hand import HANDS

    report = describe_object(args.object, args.scale, tolerance=args.tolerance, flip=args.flip)
    for line in report.lines():
        say(line)
    pictures = [(args.out, report.plot), (args.fit, lambda: plot_openings(report.profile, HANDS))]
    for out, draw in pictures:
        if out:
            write_out(out, to_png(draw()))
    return 0
