"""What several commands have in common: options, checks of their values, and progress on a terminal.

The modules of the commands import packages that take long to load (numpy, numba, pydantic, PyBullet,
viser) inside the functions that need them, so that ``--help`` and wrong options are answered at once.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from symgrasp.errors import InputError, one_of, printable, shortened

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from symgrasp.plan.plan import Plan
    from symgrasp.plan.report import Report
    from symgrasp.robot.robot import Arm
    from symgrasp.scene.parts import Task
    from symgrasp.scene.scene import Scene

__all__ = [
    "Commands",
    "add_command",
    "add_out",
    "add_packages",
    "add_plan",
    "add_scene",
    "add_task_and_arm",
    "check_out",
    "checked_scene",
    "chosen",
    "progress_of",
    "say",
    "verified",
    "warn",
    "whole",
    "write_out",
    "write_picture",
]

Commands: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"
"""What `argparse.ArgumentParser.add_subparsers` returns."""

LONGEST_LINE = 300
"""Most characters of a message."""


def add_command(
    commands: Commands, name: str, run: Callable[[argparse.Namespace], int], text: str
) -> argparse.ArgumentParser:
    """Add a command to the parser.

    Args:
        commands: where to add it.
        name: what is typed to run it.
        run: does the command's work and returns its exit status.
        text: one line of help.

    Returns:
        The command's own parser, for its options.
    """
    command = commands.add_parser(name, help=text, description=text)
    command.add_argument("--debug", action="store_true", default=argparse.SUPPRESS, help=argparse.SUPPRESS)
    command.set_defaults(run=run)
    return command


def add_scene(command: argparse.ArgumentParser, *, optional: bool = False) -> None:
    """Add the argument SCENE; one that is optional is None where it is not given."""
    text = "name of a shipped scene, or a .yaml file"
    command.add_argument("scene", metavar="SCENE", help=text, nargs="?" if optional else None)
    add_packages(command)


def add_packages(command: argparse.ArgumentParser) -> None:
    """Add ``--package``, which names the folders of packages that files refer to."""
    text = "folder of what files refer to as package://NAME/…; may be given several times"
    command.add_argument("--package", metavar="NAME=DIR", type=_package, action="append", help=text)


def _package(text: str) -> str:
    """Read a value of ``--package``, which counts from then on."""
    from symgrasp.references import give_packages

    try:
        give_packages([text])
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    return text


def add_plan(command: argparse.ArgumentParser) -> None:
    """Add the argument PLAN, a file that is read."""
    command.add_argument("plan", metavar="PLAN", type=Path, help="a plan file")
    add_packages(command)


def add_task_and_arm(command: argparse.ArgumentParser) -> None:
    """Add ``--task`` and ``--arm``, which `chosen` reads."""
    command.add_argument("--task", metavar="NAME", help="task (default: the first)")
    command.add_argument("--arm", metavar="NAME", help="arm (default: the task's first)")


def add_out(
    command: argparse.ArgumentParser, text: str, *, option: str = "--out", required: bool = False
) -> None:
    """Add an option that names a file to write."""
    command.add_argument(option, metavar="FILE", type=Path, required=required, help=text)


def whole(lowest: int, highest: int | None = None) -> Callable[[str], int]:
    """Return the type of an option that takes a whole number from the lowest on, to the highest if any."""
    to = "on" if highest is None else f"to {highest:,}"

    def read(text: str) -> int:
        value = int(text) if text.isdecimal() and len(text) <= 20 else -1
        if value < lowest or (highest is not None and value > highest):
            raise argparse.ArgumentTypeError(f"{text!r}: expected a whole number from {lowest} {to}")
        return value

    return read


def check_out(out: Path | None, endings: Sequence[str] = (), option: str = "--out") -> None:
    """Check, before anything is computed, that a file can be written if one is asked for.

    Args:
        out: the file.
        endings: of its name, of which it must have one; any if there are none.
        option: that names it.

    Raises:
        InputError: its name has another ending, its folder does not exist or cannot be written, or it is a
            folder itself.
    """
    if out is None:
        return
    if not out.parent.is_dir():
        raise InputError("command line", option, str(out), f"a file in an existing folder, not {out.parent}")
    if out.is_dir():
        raise InputError("command line", option, str(out), "a file, not a folder")
    if not os.access(out if out.exists() and not out.is_file() else out.parent, os.W_OK):
        raise InputError("command line", option, str(out), "a file that can be written")
    if endings and out.suffix not in endings:
        raise InputError("command line", option, str(out), "an ending: " + one_of(endings))


def say(text: str) -> None:
    """Print a line; what names in it could do to a terminal is escaped."""
    print(printable(text), flush=True)


def warn(text: str) -> None:
    """Print a line of at most `LONGEST_LINE` characters about the command itself on stderr."""
    print(shortened(f"symgrasp: {printable(text)}", LONGEST_LINE), file=sys.stderr, flush=True)


def verified(plan: Plan, path: Path, scene: Scene | None = None, *, strict: bool = False) -> Report:
    """Check a plan, and print what does not hold and how much was checked.

    Args:
        plan: the plan.
        path: of its file.
        scene: the scene that it must be for; any if None.
        strict: let no number be overstated at all.
    """
    from symgrasp.plan.verify import verify

    with progress_of(f"verifying {path.name}") as progress:
        report = verify(plan, progress, scene=scene, strict=strict)
    for failure in report.failures:
        say(failure)
    result = "the plan holds" if report.holds else f"{len(report.failures)} do not hold"
    say(f"{report.checks} statements checked: {result}")
    return report


def write_out(out: Path, content: bytes) -> None:
    """Write a file in one piece and say so."""
    from symgrasp.files import write_atomically

    with write_atomically(out) as file:
        file.write(content)
    say(f"written to {out}")


def write_picture(out: Path, figure: Figure) -> None:
    """Draw a figure into a file that ends in .png or .svg, and say so."""
    from symgrasp.feasibility.pictures import to_png, to_svg

    write_out(out, to_svg(figure) if out.suffix == ".svg" else to_png(figure))


def checked_scene(name: str) -> Scene:
    """Load a scene and check that its tasks can be computed.

    Args:
        name: of a shipped scene, or of a file.

    Raises:
        SymgraspError: the scene is unusable, or the object collides with something in a task.
    """
    from symgrasp.scene.scene import Scene

    scene = Scene.load(name)

    from symgrasp.world import prepared  # PyBullet, which a scene that is refused does not need

    scene = prepared(scene)
    for note in scene.notes:
        warn(f"{scene.name}: {note}")
    return scene


def chosen(args: argparse.Namespace) -> tuple[Scene, Task, Arm]:
    """Return what SCENE, ``--task`` and ``--arm`` mean.

    Raises:
        SymgraspError: as `checked_scene`; or the scene has no such task or arm.
    """
    scene = checked_scene(args.scene)
    task = scene.task(args.task)
    return scene, task, scene.arm(args.arm or task.arms[0])


@contextmanager
def progress_of(what: str) -> Iterator[Callable[[float], None] | None]:
    """Tell about a computation inside the ``with`` block.

    If code is compiled meanwhile, stderr says so.

    Args:
        what: is being computed.

    Yields:
        A callback that shows a percentage; None where stderr is no terminal.
    """
    from symgrasp.compiling import COMPILING_MESSAGE, notify_on_compile

    label = shortened(printable(what), 60)

    def show(share: float) -> None:
        end = "\n" if share >= 1 else ""
        print(f"\r{label}: {100 * share:3.0f} %", end=end, file=sys.stderr, flush=True)

    with notify_on_compile(cache(lambda: warn(f"{COMPILING_MESSAGE} …"))):  # once
        yield show if sys.stderr.isatty() else None
