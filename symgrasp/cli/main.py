"""The entry point of the command line. Bad input is one line on stderr and exit status 2."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from typing import NoReturn

from symgrasp.cli import (
    app,
    bench,
    explain,
    export,
    grid,
    hand,
    place,
    plan,
    robot,
    robots,
    scenes,
    schema,
    success,
    survey,
    verify,
)
from symgrasp.cli import map as map_
from symgrasp.cli import object as object_
from symgrasp.cli.shared import LONGEST_LINE, warn
from symgrasp.errors import NoPlanError, SymgraspError, printable, shortened

__all__ = ["main"]

COMMANDS = (
    app,
    scenes,
    map_,
    explain,
    grid,
    plan,
    verify,
    survey,
    place,
    success,
    object_,
    hand,
    robot,
    robots,
    export,
    bench,
    schema,
)
"""The modules of the commands, in the order in which ``--help`` lists them."""


INTERNAL_ERROR = 70
"""Exit status for a fault of this program; EX_SOFTWARE of sysexits.h."""

EPILOG = """exit status: 0 done; 1 no plan exists, or a plan does not hold; 2 bad input, or a file that cannot
be read or written; 70 a fault of this program; 130 cancelled with Ctrl-C"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command.

    Args:
        argv: the arguments after the program's name; those of this process by default.

    Returns:
        The exit status: 0 done, 1 no plan exists or a plan does not hold, 2 bad input, 70 a fault of this
        program, 130 cancelled.
    """
    args = _parser().parse_args(argv)
    try:
        status = args.run(args)
        sys.stdout.flush()  # while it can still be told that it cannot be written
        return status
    except BrokenPipeError:  # whoever reads the output has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except KeyboardInterrupt:
        print(file=sys.stderr)
        warn("cancelled")
        return 130
    except Exception as error:
        if args.debug:
            import traceback

            traceback.print_exc()
        return _told(error)


def _told(error: Exception) -> int:
    """Say in one line what went wrong; return the exit status."""
    if isinstance(error, SymgraspError):
        warn(str(error))
        return 1 if isinstance(error, NoPlanError) else 2
    if isinstance(error, OSError) and error.strerror:
        warn(f"{error.filename or 'output'}: {error.strerror}")
        return 2
    what = f"{type(error).__name__}: {error}".strip(": ")
    warn(f"unexpected {shortened(what, 200)}; symgrasp --debug prints where")
    return INTERNAL_ERROR


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        """Say in one line what is wrong with the arguments, and exit."""
        super().error(shortened(printable(message), LONGEST_LINE - len(f"{self.prog}: error: ")))


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="symgrasp",
        description="Where can a robot arm hold an object of revolution, and why not elsewhere?",
        epilog=EPILOG,
    )
    text = "print where an error comes from, not only what it says"
    parser.add_argument("--debug", action="store_true", help=text)
    commands = parser.add_subparsers(metavar="COMMAND", required=True)
    for command in COMMANDS:
        command.add_parser(commands)
    return parser
