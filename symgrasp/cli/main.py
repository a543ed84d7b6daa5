"""The entry point of the command line. Bad input is one line on stderr and exit status 2."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence

from symgrasp.cli import app, bench, explain, export, hand, plan, scenes, schema, verify
from symgrasp.cli import map as map_
from symgrasp.cli import object as object_
from symgrasp.errors import NoPlanError, SymgraspError

__all__ = ["main"]

COMMANDS = (app, scenes, map_, explain, plan, verify, object_, hand, export, bench, schema)
"""The modules of the commands, in the order in which ``--help`` lists them."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command.

    Args:
        argv: the arguments after the program's name; those of this process by default.

    Returns:
        The exit status: 0 done, 1 no plan exists or a plan does not hold, 2 bad input, 130 cancelled.
    """
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
    for command in COMMANDS:
        command.add_parser(commands)
    return parser
