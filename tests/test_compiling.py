from __future__ import annotations

import subprocess
import sys

from numba import njit

from symgrasp.cli import main
from symgrasp.compiling import COMPILING, telling_of_compiling

PROGRAM = """
from numba import njit
from symgrasp.compiling import telling_of_compiling

@njit(cache=True)
def twice(x):
    return 2 * x

with telling_of_compiling(lambda: print("compiling")):
    print(twice(21))
"""


def test_it_is_told_once_and_only_while_something_is_compiled():
    def add(x):
        return x + 1

    told = []
    one, two = njit(add), njit(add)
    with telling_of_compiling(lambda: told.append(True)):
        assert one(1) == two(1) == 2
    assert told == [True]
    with telling_of_compiling(lambda: told.append(True)):
        assert one(2) == 3
    assert told == [True]


def test_what_is_read_from_the_disk_does_not_count(tmp_path):
    program = tmp_path / "program.py"
    program.write_text(PROGRAM)
    outputs = [
        subprocess.run([sys.executable, program], capture_output=True, text=True, check=True).stdout
        for _ in range(2)
    ]
    assert outputs == ["compiling\n42\n", "42\n"]


def test_the_command_line_says_so(capsys, monkeypatch, tmp_path):
    """Not by compiling everything again, which takes a minute: something new is compiled meanwhile."""
    monkeypatch.setattr("symgrasp.maps.create_map", _compiles_something)
    assert main(["map", "soda_can"]) == 2
    assert COMPILING in capsys.readouterr().err


def _compiles_something(*args, progress, **options):
    njit(lambda x: x - 1)(1)
    raise FileNotFoundError(2, "stopped here", "test")
