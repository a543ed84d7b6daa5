from __future__ import annotations

import ast
import fcntl
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from numba import njit

import symgrasp
from symgrasp.cli.main import main
from symgrasp.compiling import COMPILING_MESSAGE, LOCK, SOURCES, _saving, notify_on_compile

PROGRAM = """
from numba import njit
from symgrasp.compiling import notify_on_compile

@njit(cache=True)
def twice(x):
    return 2 * x

with notify_on_compile(lambda: print("compiling")):
    print(twice(21))
"""


def test_it_is_told_whenever_something_is_compiled_and_once_for_all_that_it_calls():
    @njit
    def add(x):
        return x + 1

    @njit
    def twice(x):
        return 2 * add(x)

    told = []
    with notify_on_compile(lambda: told.append(True)):
        assert twice(1) == 4
        assert told == [True]
        assert njit(lambda x: x - 1)(1) == 0
        assert told == [True, True]
        assert add(2) == 3
        assert twice(2) == 6
    assert told == [True, True]


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
    monkeypatch.setattr("symgrasp.feasibility.create.create_map", _compiles_something)
    assert main(["map", "soda_can"]) == 2
    assert capsys.readouterr().err.count(COMPILING_MESSAGE) == 1


def _compiles_something(*args, progress, **options):
    for _ in range(2):
        njit(lambda x: x - 1)(1)
    raise FileNotFoundError(2, "stopped here", "test")


ROOT = Path(symgrasp.__file__).parent


def test_the_sources_of_compiled_code_are_known():
    """All modules that compile, and those that they take constants from."""
    known = {path for pattern in SOURCES for path in ROOT.glob(pattern)}
    compiling = [p for p in ROOT.rglob("*.py") if "import njit" in p.read_text()]
    assert len(compiling) > 5
    for path in compiling:
        assert path in known
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and any(alias.name.isupper() for alias in node.names):
                source = (ROOT.parent / str(node.module).replace(".", "/")).with_suffix(".py")
                assert source in known or not source.is_relative_to(ROOT), (path, node.module)


def test_changed_sources_are_compiled_anew(tmp_path):
    """A function in one file that calls one in another does not keep the old one."""
    package = tmp_path / "symgrasp"
    (package / "engine").mkdir(parents=True)
    for name in ("compiling.py", "caching.py", "files.py"):
        shutil.copy(ROOT / name, package)
    for name in ("__init__.py", "engine/__init__.py"):
        (package / name).touch()
    caller = "from symgrasp.compiling import njit\nfrom symgrasp.engine.inner import inner\n"
    (package / "engine" / "outer.py").write_text(
        caller + "@njit(cache=True)\ndef outer(x):\n    return inner(x)\n"
    )
    outputs = []
    for factor in (2, 2, 3):
        (package / "engine" / "inner.py").write_text(
            "from symgrasp.compiling import njit\n"
            f"@njit(cache=True)\ndef inner(x):\n    return {factor} * x\n"
        )
        program = (
            "from symgrasp.compiling import notify_on_compile\n"
            "from symgrasp.engine.outer import outer\n"
            "with notify_on_compile(lambda: print('compiling')):\n    print(outer(7))\n"
        )
        command = [sys.executable, "-B", "-c", program]  # Python's own cache tells files by the second
        done = subprocess.run(command, cwd=tmp_path, env={"PYTHONPATH": ""}, capture_output=True, check=True)
        outputs.append(done.stdout.decode())
    assert outputs == ["compiling\n14\n", "14\n", "compiling\n21\n"]


def test_only_one_process_at_a_time_writes_what_is_compiled(tmp_path):
    """numba itself reads which files there are, and writes the next one, with nothing to keep others out."""
    refused = []

    def save():
        with (tmp_path / LOCK).open() as other, pytest.raises(BlockingIOError) as error:
            fcntl.flock(other, fcntl.LOCK_EX | fcntl.LOCK_NB)
        refused.append(error)

    _saving(save, str(tmp_path))()
    assert len(refused) == 1
    with (tmp_path / LOCK).open() as other:
        fcntl.flock(other, fcntl.LOCK_EX | fcntl.LOCK_NB)  # afterwards others may


def test_inner_functions_are_interpreted_by_python_and_compiled_as_a_part(tmp_path):
    """They are in no file of their own, and run interpreted from Python."""
    program = (
        "import os\n"
        "from symgrasp.compiling import ENTRY, notify_on_compile, njit\n"
        "@njit(inner=True, error_model='numpy', _nrt=False)\n"
        "def half(x): return x / 2\n"
        "@njit(**ENTRY)\n"
        "def quarter(x): return half(half(x))\n"
        "assert half(8.0) == 4.0\n"
        "with notify_on_compile(lambda: print('compiling')): print(quarter(8.0))\n"
    )
    (tmp_path / "program.py").write_text(program)
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    command = [sys.executable, str(tmp_path / "program.py")]
    outputs = [
        subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout
        for _ in range(2)
    ]
    assert outputs == ["compiling\n2.0\n", "2.0\n"]
    assert [path.name.split(".")[1].split("-")[0] for path in tmp_path.glob("cache/**/*.nbc")] == ["quarter"]


@pytest.mark.parametrize("full", [False, True])
def test_without_a_place_for_the_cache_it_compiles_without_and_says_so_once(full, tmp_path):
    """The folder cannot be made, or the disk is full as soon as something is compiled."""
    (tmp_path / "file").touch()
    program = (
        "import errno\n"
        "from numba.core import caching\n"
        "from symgrasp.compiling import njit\n"
        "def save(*_): raise OSError(errno.ENOSPC, 'No space left on device')\n"
        + ("caching.IndexDataCacheFile.save = save\n" if full else "")
        + "def one(x): return x + 1\n"
        "def two(x): return x + 2\n"
        "print(njit(cache=True)(one)(1) + njit(cache=True)(two)(1))\n"
    )
    (tmp_path / "program.py").write_text(program)
    place = tmp_path / ("folder" if full else "file")
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(place)}
    command = [sys.executable, str(tmp_path / "program.py")]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    assert done.stdout == "5\n"
    (line,) = done.stderr.splitlines()
    assert str(place) in line
    assert "cannot be kept" in line
    assert ("No space left" in line) == full


INNER = ("njit(**STRICT)", "njit(**FAST)")


def test_python_calls_no_inner_function():
    """It would be interpreted, a thousand times slower. The number of branches takes no time."""
    trees = {path: ast.parse(path.read_text()) for path in ROOT.rglob("*.py")}
    inner = {
        (path, node.name)
        for path, tree in trees.items()
        for node in tree.body
        if isinstance(node, ast.FunctionDef) and {*map(ast.unparse, node.decorator_list)} & {*INNER}
    }
    assert len(inner) > 50
    for path, tree in trees.items():
        known = {name: (path, name) for where, name in inner if where == path}
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom):
                source = (ROOT.parent / str(node.module).replace(".", "/")).with_suffix(".py")
                known |= {alias.asname or alias.name: (source, alias.name) for alias in node.names}
        for node in tree.body:
            if not any("njit" in ast.unparse(d) for d in getattr(node, "decorator_list", [])):
                called = {ast.unparse(call.func) for call in ast.walk(node) if isinstance(call, ast.Call)}
                bad = {name for name in called if known.get(name) in inner} - {"branch_count"}
                assert not bad, f"{path}: {bad}"


SHARED_INNER_FUNCTION = """
import math

import numba
import numpy as np

from symgrasp.collision.distance import distance_bounds
from symgrasp.collision.pieces import Piece, pack, pose_rows
from symgrasp.compiling import ENTRY, njit

@njit(**{**ENTRY, "cache": False})
def of_first(pieces, pose, work):
    lower, upper = distance_bounds(pieces, pose, 0, 1, math.inf, math.inf, -math.inf, work)
    return lower

@numba.njit
def of_any(pieces, pose, a, b, work):
    lower, upper = distance_bounds(pieces, pose, a, b, math.inf, math.inf, -math.inf, work)
    return lower

pieces = pack([Piece(np.random.default_rng(0).normal(size=(50, 3)))] * 2)
pose = pose_rows(np.tile(np.eye(4), (2, 1, 1)))
pose[1, 9] = 9.0
work = np.empty((4, 3))
print(of_first(pieces, pose, work) == of_any(pieces, pose, 0, 1, work) > 0.0)
"""


def test_functions_that_numba_compiles_in_its_own_way_have_their_own_copy_of_inner_ones():
    """As those of a program that uses the package may be; in its own process, as a wrong call ends it."""
    program = [sys.executable, "-c", SHARED_INNER_FUNCTION]
    assert subprocess.run(program, capture_output=True, text=True, check=True).stdout == "True\n"
