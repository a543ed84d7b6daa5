"""Writing files: in one piece or not at all, and nothing left behind."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from symgrasp.files import ABANDONED_AGE, TEMPORARY, temporary_folder, write_atomically


def full(*_: object) -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_full_disk_names_the_file_and_leaves_it_as_it_was(tmp_path):
    out = tmp_path / "map.png"
    out.write_text("precious")
    with pytest.raises(OSError, match="No space left") as caught, write_atomically(out) as file:
        file.write(b"half")
        full()
    assert caught.value.filename == str(out)
    assert [path.name for path in tmp_path.iterdir()] == ["map.png"]
    assert out.read_text() == "precious"


@pytest.mark.parametrize("function", ["mkstemp", "mkdtemp"])
def test_a_folder_that_cannot_be_written(function, tmp_path, monkeypatch):
    def refuse(suffix: str, prefix: str, folder: Path) -> None:
        raise PermissionError(errno.EACCES, "Permission denied", f"{folder}/{prefix}x")

    monkeypatch.setattr(f"tempfile.{function}", refuse)
    if function == "mkstemp":
        with pytest.raises(PermissionError) as caught, write_atomically(tmp_path / "map.png"):
            pass
        assert caught.value.filename == str(tmp_path / "map.png")
    else:
        with pytest.raises(PermissionError), temporary_folder():
            pass


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_a_full_device_is_named():
    with pytest.raises(OSError, match="No space left") as caught, write_atomically(Path("/dev/full")) as file:
        file.write(b"x" * 100_000)
    assert caught.value.filename == "/dev/full"


KILLED = """
import os, signal, sys
from pathlib import Path
from symgrasp.files import temporary_folder, write_atomically
with write_atomically(Path(sys.argv[1])) as file, temporary_folder() as folder:
    file.write(b"half")
    (folder / "robot.urdf").write_bytes(b"half")
    print("both", flush=True)
    if sys.argv[2] == "kill":
        os.kill(os.getpid(), signal.SIGKILL)
    sys.stdin.read()
"""


@pytest.fixture
def start(tmp_path) -> Callable[[str], subprocess.Popen[str]]:
    def start(how: str) -> subprocess.Popen[str]:
        command = [sys.executable, "-c", KILLED, str(tmp_path / "plan.json"), how]
        pipe = subprocess.PIPE
        environment = {**os.environ, "TMPDIR": str(tmp_path)}
        process = subprocess.Popen(command, env=environment, text=True, stdin=pipe, stdout=pipe)
        assert process.stdout
        assert process.stdout.readline() == "both\n"
        return process

    return start


def temporaries(folder: Path) -> list[Path]:
    """The temporary files and folders in a folder, made to look old."""
    found = sorted(folder.glob(f"{TEMPORARY}*"))
    for path in found:
        at = path.stat().st_mtime - 2 * ABANDONED_AGE
        os.utime(path, (at, at))
    return found


def test_what_a_killed_process_leaves_is_removed_by_the_next_and_what_is_in_use_is_not(
    start, tmp_path, monkeypatch
):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    killed = start("kill")
    assert killed.wait() == -signal.SIGKILL
    assert len(temporaries(tmp_path)) == 2
    alive = start("live")
    try:
        in_use = temporaries(tmp_path)
        assert len(in_use) == 2  # and those of the killed process are gone
        with temporary_folder() as folder:
            assert sorted([*in_use, folder]) == sorted(tmp_path.glob(f"{TEMPORARY}*"))
    finally:
        alive.communicate("")
    assert [path.name for path in tmp_path.iterdir()] == ["plan.json"]
    assert (tmp_path / "plan.json").read_bytes() == b"half"
