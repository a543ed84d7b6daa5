"""The command as a process: faults, Ctrl-C, full disks, and what is told of them."""

from __future__ import annotations

import errno
import os
import pty
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from symgrasp.cli.main import main
from tests.conftest import write_scene


def run(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "symgrasp", *arguments], cwd=cwd, capture_output=True, text=True, check=False
    )


def test_as_a_process_from_another_folder(tmp_path):
    done = run("map", "soda_can", "--out", "can.json", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert [p.name for p in tmp_path.iterdir()] == ["can.json"]


def test_a_bad_file_leaves_no_traceback(tmp_path):
    (tmp_path / "bad.yaml").write_text("a: [")
    done = run("map", "bad.yaml", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.startswith("symgrasp: bad.yaml: file: ")
    assert done.stderr.count("\n") == 1


def test_progress_on_a_terminal_and_cancel_with_ctrl_c(content, tmp_path):
    """On a terminal the share runs up; Ctrl-C ends it with one word and no file."""
    content["map"] = {"heights": 200, "angles": 360, "redundancy": 64}
    path = write_scene(tmp_path, content)
    master, slave = pty.openpty()
    arguments = [sys.executable, "-m", "symgrasp", "map", str(path), "--out", str(tmp_path / "map.npz")]
    process = subprocess.Popen(arguments, stdout=slave, stderr=slave)
    os.close(slave)
    seen = b""
    while b"map of pick:" not in seen:
        seen += os.read(master, 1024)
    process.send_signal(signal.SIGINT)
    try:
        while chunk := os.read(master, 1024):
            seen += chunk
    except OSError:  # the terminal closes with the process
        pass
    os.close(master)
    assert process.wait() == 130
    assert b"cancelled" in seen
    assert b"Traceback" not in seen
    assert list(tmp_path.iterdir()) == [path]


def test_a_fault_of_the_program_is_one_line_and_status_70(capsys, monkeypatch):
    def broken(*_: object) -> None:
        raise ZeroDivisionError("of\nthis" + 1000 * " and that")

    monkeypatch.setattr("symgrasp.scene.shipped.list_scenes", broken)
    assert main(["scenes"]) == 70
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(r"symgrasp: unexpected ZeroDivisionError: of\nthis and that")
    assert line.endswith("symgrasp --debug prints where")
    assert len(line) <= 300
    for arguments in (["--debug", "scenes"], ["scenes", "--debug"]):
        assert main(arguments) == 70
        traceback = capsys.readouterr().err
        assert traceback.startswith("Traceback")
        assert traceback.rstrip().endswith(line)


def test_help_lists_the_exit_statuses(capsys):
    with pytest.raises(SystemExit):
        main(["--help"])
    text = " ".join(capsys.readouterr().out.split())
    assert "exit status: 0 done; 1 no plan exists" in text
    assert "70 a fault of this program" in text
    assert "--debug" in text


def test_a_full_disk_names_the_file(small, tmp_path, capsys, monkeypatch):
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "replace", full)
    out = tmp_path / "map.json"
    assert main(["map", str(small), "--out", str(out)]) == 2
    assert capsys.readouterr().err == f"symgrasp: {out}: No space left on device\n"
    assert list(tmp_path.iterdir()) == [small]


def test_a_folder_that_cannot_be_written_is_told_before_anything_is_computed(small, capsys, monkeypatch):
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    out = small.parent / "map.json"
    assert main(["map", str(small), "--out", str(out)]) == 2
    captured = capsys.readouterr()
    assert captured.err.startswith("symgrasp: command line: --out: '")
    assert captured.err.endswith("map.json': expected a file that can be written\n")
    assert captured.out == ""


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_output_that_cannot_be_written(tmp_path):
    with Path("/dev/full").open("w") as nowhere:
        command = [sys.executable, "-m", "symgrasp", "scenes"]
        done = subprocess.run(command, stdout=nowhere, stderr=subprocess.PIPE, text=True, check=False)
    assert (done.returncode, done.stderr) == (2, "symgrasp: output: No space left on device\n")
