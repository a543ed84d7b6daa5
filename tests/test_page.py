"""Finding the page's package: the one beside the library, whatever else is called so."""

from __future__ import annotations

import subprocess
import sys
from types import ModuleType

import pytest

from symgrasp.errors import SymgraspError
from symgrasp.page import page_module

PROGRAM = """
import multiprocessing
from symgrasp.page import page_module

if __name__ == "__main__":
    palette = page_module("render.palette")
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        print(pool.apply(palette.rgb, ("#ff0000",)))
"""


def test_it_is_the_folder_beside_the_library():
    assert page_module("render.palette").__name__ == "app.render.palette"


def test_a_package_of_the_same_name_in_the_way_is_passed_by(tmp_path):
    """Also by the processes that the page starts."""
    (tmp_path / "app").mkdir()
    (tmp_path / "app" / "__init__.py").write_text("raise SystemExit('a foreign package')")
    program = tmp_path / "program.py"
    program.write_text(PROGRAM)
    done = subprocess.run(
        [sys.executable, program], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert (done.stdout, done.returncode) == ("(255, 0, 0)\n", 0), done.stderr


def test_a_package_of_the_same_name_in_use_is_an_error(monkeypatch):
    foreign = ModuleType("app")
    monkeypatch.setitem(sys.modules, "app", foreign)
    path = [*sys.path]
    with pytest.raises(SymgraspError, match="another 'app' is in use"):
        page_module("render.palette")
    assert sys.path == path


def test_the_page_s_own_command_is_the_command_app():
    """Its options stand once."""
    commands = (["app"], ["symgrasp", "app"])
    helps = [
        subprocess.run([sys.executable, "-m", *command, "--help"], capture_output=True, text=True, check=True)
        for command in commands
    ]
    assert helps[0].stdout == helps[1].stdout
    assert helps[0].stdout.startswith("usage: symgrasp app")
