"""``symgrasp schema``: print the JSON Schema of a file format."""

from __future__ import annotations

import argparse
from pathlib import Path

from symgrasp.cli.shared import Commands, add_command

__all__ = ["SCHEMAS_DIR", "add_parser", "run"]

SCHEMAS_DIR = Path(__file__).resolve().parent.parent / "schemas"
"""Where the schemas are, as files that editors and other tools can use."""


def add_parser(commands: Commands) -> None:
    """Add the command to the parser."""
    command = add_command(commands, "schema", run, "Print the JSON Schema of a file format.")
    command.add_argument("format", choices=("scene", "plan", "survey"))


def run(args: argparse.Namespace) -> int:
    """Print the schema that ships, a copy of what the format's classes give; return the exit status."""
    path = SCHEMAS_DIR / f"{args.format}.schema.json"
    print(path.read_text(encoding="utf-8"), end="")
    return 0
