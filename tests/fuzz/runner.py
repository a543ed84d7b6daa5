"""Runs commands one after the other, each in a fork of a process that has everything imported.

Reads one JSON line for every run, ``{"argv", "folder"}``, and answers with one, a `Run`. A fork takes
milliseconds where a start takes seconds; what the command does is the same.
"""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import resource
import signal
import sys
import tempfile
import time
import traceback
from pathlib import Path
from typing import NamedTuple

__all__ = ["CPU_LIMIT", "WALL_LIMIT", "Run", "main"]

CPU_LIMIT = 20
"""CPU time (s) after which the system ends a command."""

WALL_LIMIT = 180
"""Time (s) after which a command that waits for something is ended."""


class Run(NamedTuple):
    """What became of a command.

    Attributes:
        status: exit status; negative for the signal that ended it.
        cpu: CPU time (s).
        peak: largest resident memory (bytes).
        seconds: time (s) from start to end.
        left: names of what it left in its folder for temporary files.
    """

    status: int
    cpu: float
    peak: int
    seconds: float
    left: list[str]


def main() -> None:
    """Answer every line of stdin, until it ends."""

    answers = os.fdopen(os.dup(1), "w", buffering=1)
    for line in sys.stdin:
        request = json.loads(line)
        print(json.dumps(_run(request["argv"], Path(request["folder"]))), file=answers)


def _run(argv: list[str], folder: Path) -> Run:
    """Run a command in a folder: its output goes to ``stdout`` and ``stderr``, temporary files to ``tmp``."""
    temporary = folder / "tmp"
    temporary.mkdir(exist_ok=True)
    started = time.monotonic()
    pid = os.fork()
    if pid == 0:
        os._exit(_command(argv, folder, temporary))
    _, status, usage = os.wait4(pid, 0)
    return Run(
        os.waitstatus_to_exitcode(status),
        usage.ru_utime + usage.ru_stime,
        1024 * usage.ru_maxrss,
        time.monotonic() - started,
        sorted(str(path.relative_to(temporary)) for path in temporary.rglob("*")),
    )


def _command(argv: list[str], folder: Path, temporary: Path) -> int:
    """Do in the fork what the program does in a process of its own; return the exit status."""
    from symgrasp.cli.main import main as command

    resource.setrlimit(resource.RLIMIT_CPU, (CPU_LIMIT, CPU_LIMIT))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    signal.alarm(WALL_LIMIT)
    os.chdir(folder)
    os.environ["TMPDIR"] = tempfile.tempdir = str(temporary)
    for descriptor, name in ((0, os.devnull), (1, "stdout"), (2, "stderr")):
        flags = os.O_RDONLY if descriptor == 0 else os.O_WRONLY | os.O_CREAT | os.O_TRUNC
        os.dup2(os.open(name, flags, 0o644), descriptor)
    status: object = 1
    try:
        status = command(argv)
    except SystemExit as end:
        status = end.code
    except BaseException:
        traceback.print_exc()
    atexit._run_exitfuncs()
    with contextlib.suppress(OSError):
        sys.stdout.flush()
        sys.stderr.flush()
    return status if isinstance(status, int) else 0 if status is None else 1


if __name__ == "__main__":
    main()
