"""Runs what a page of the documentation shows, from top to bottom, in one folder.

- ``sh``: every line that begins with ``symgrasp`` is run, except ``symgrasp app``, which stays.
- ``python``: is run as a file of its own.
- ``yaml``: is written to the file that its first line names, as in ``# vase.yaml``.
- ``text``: is what the block before it prints; a last line ``…`` stands for more.
"""

from __future__ import annotations

import io
import re
import shlex
from collections.abc import Iterator
from contextlib import chdir, redirect_stderr, redirect_stdout
from itertools import zip_longest
from pathlib import Path
from typing import NamedTuple

from symgrasp.cli.main import main
from symgrasp.files import write_atomically

__all__ = ["PAGES", "Block", "Step", "blocks", "commands", "put_between", "refresh", "run", "shown"]

ROOT = Path(__file__).parent.parent

PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))
"""All pages."""

MORE = "…"

NOT_RUN = ("symgrasp app", "make ", "pip install ", "symgrasp bench")
"""Commands that take over the terminal, install something or take minutes."""


class Block(NamedTuple):
    """A block of code: its language and text."""

    language: str
    text: str


class Step(NamedTuple):
    """What happened at a block.

    Attributes:
        block: the block.
        printed: what it printed.
        expected: what the page says that it prints, or None.
        status: the largest exit status of its commands.
    """

    block: Block
    printed: str
    expected: str | None
    status: int


def blocks(page: Path) -> list[Block]:
    """Return the blocks of a page, in order."""
    text = page.read_text(encoding="utf-8")
    found = re.findall(r"^```(\w+)\n(.*?)^```", text, flags=re.DOTALL | re.MULTILINE)
    return [Block(*block) for block in found]


def commands(block: Block) -> list[str]:
    """Return the commands of a ``sh`` block, without comments."""
    lines = (line.split("  #")[0].strip() for line in block.text.splitlines())
    return [line for line in lines if line]


def shown(printed: str, expected: str) -> str:
    """Return as much of what was printed as the page shows."""
    lines = expected.splitlines()
    if lines and lines[-1] == MORE:
        return "".join(f"{line}\n" for line in [*printed.splitlines()[: len(lines) - 1], MORE])
    return printed


def refresh(page: Path, folder: Path) -> None:
    """Write into a page what its blocks print now."""
    text, done = page.read_text(encoding="utf-8"), 0
    for step in run(page, folder):
        if step.expected is not None:
            start = text.index("```text\n", done) + len("```text\n")
            done = start + len(step.expected)
            text = text[:start] + shown(step.printed, step.expected) + text[done:]
            done = start
    page.write_text(text, encoding="utf-8")


def put_between(page: Path, begin: str, end: str, lines: str) -> None:
    """Put lines between two markers of a page, in place of what is there."""
    text = page.read_text(encoding="utf-8")
    before = text.index(begin) + len(begin)
    after = text.index(end, before)
    with write_atomically(page) as file:
        file.write(f"{text[:before]}\n{lines}{text[after:]}".encode())


def run(page: Path, folder: Path) -> Iterator[Step]:
    """Run a page in a folder."""
    found = blocks(page)
    for block, after in zip_longest(found, found[1:]):
        if block.language == "text":
            continue
        output = io.StringIO()
        with chdir(folder), redirect_stdout(output), redirect_stderr(output):
            status = _run(block)
        expected = after.text if after and after.language == "text" else None
        yield Step(block, output.getvalue(), expected, status)


def _run(block: Block) -> int:
    if block.language == "sh":
        wanted = [command for command in commands(block) if not command.startswith(NOT_RUN)]
        return max((main(shlex.split(command)[1:]) for command in wanted), default=0)
    if block.language == "python":
        exec(compile(block.text, "<page>", "exec"), {"__name__": "__main__"})
    if block.language == "yaml":
        name = re.match(r"# (\S+\.yaml)$", block.text, flags=re.MULTILINE)
        if name:
            Path(name[1]).write_text(block.text, encoding="utf-8")
    return 0
