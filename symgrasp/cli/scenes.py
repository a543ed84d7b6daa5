"""``symgrasp scenes``: list what ships."""

from __future__ import annotations

import argparse

from symgrasp.cli.shared import Commands, add_command, say

__all__ = ["add_parser", "run"]


def add_parser(commands: Commands) -> None:
    """Add the command to the parser."""
    add_command(commands, "scenes", run, "List the shipped scenes.")


def run(args: argparse.Namespace) -> int:
    """Print a line for every shipped scene; return the exit status."""
    from symgrasp.scene.shipped import list_scenes, missing_extra, shipped_scenes

    scenes, files = list_scenes(), shipped_scenes()
    width = max(map(len, scenes))
    for name, description in scenes.items():
        extra = missing_extra(files[name])
        needs = f" (needs pip install 'symgrasp[{extra}]')" if extra else ""
        say(f"{name:{width}}  {description}{needs}")
    return 0
