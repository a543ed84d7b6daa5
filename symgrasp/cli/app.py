"""``symgrasp app``: start the page."""

from __future__ import annotations

import argparse
import logging

from symgrasp.cli.shared import Commands, add_command, add_scene
from symgrasp.errors import printable

__all__ = ["add_parser", "run"]


def add_parser(commands: Commands) -> None:
    """Add the command to the parser."""
    command = add_command(commands, "app", run, "Start the page and print its address.")
    add_scene(command, optional=True)
    command.add_argument("--host", default="127.0.0.1", help="address to listen on (default: %(default)s)")
    command.add_argument("--port", type=int, default=8080, help="port to listen on (default: %(default)s)")
    command.add_argument(
        "--max-sessions",
        type=int,
        default=16,
        help="how many browsers may use it at the same time (default: %(default)s)",
    )


def run(args: argparse.Namespace) -> int:
    """Serve the page until interrupted; return the exit status."""
    from symgrasp.page import page_module

    handler = logging.StreamHandler()
    handler.setFormatter(_PlainFormatter("symgrasp: %(message)s"))
    logging.basicConfig(level=logging.WARNING, handlers=[handler])
    serve = page_module("server.serve").serve
    serve(args.scene, host=args.host, port=args.port, max_sessions=args.max_sessions)
    return 0


class _PlainFormatter(logging.Formatter):
    """Formats records like its base class, and shows what names in them could do to a terminal as escapes."""

    def format(self, record: logging.LogRecord) -> str:
        return "\n".join(map(printable, super().format(record).split("\n")))
