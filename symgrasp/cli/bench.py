"""``symgrasp bench``: measure maps and planners."""

from __future__ import annotations

import argparse
import json

from symgrasp.cli.shared import Commands, add_command, add_out, check_out

__all__ = ["add_parser", "run"]


def add_parser(commands: Commands) -> None:
    """Add the command to the parser."""
    text = "Measure maps and planners against what one would do otherwise."
    add_out(add_command(commands, "bench", run, text), "write the figures as JSON")


def run(args: argparse.Namespace) -> int:
    """Print every figure as it is measured, and write them if asked to; return the exit status."""
    check_out(args.out)

    from symgrasp import bench
    from symgrasp.files import write_atomically

    figures = []
    for figure in bench.run():
        print(figure.line(), flush=True)
        figures.append(figure)
    if args.out:
        with write_atomically(args.out) as file:
            file.write((json.dumps(bench.report(figures), indent=2, ensure_ascii=False) + "\n").encode())
    return 0
