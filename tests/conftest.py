"""Scenes that many tests share, loaded once; and compiling before the tests begin in several processes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import settings

from symgrasp.files import SCENES_DIR
from symgrasp.scene.scene import Scene
from symgrasp.scene.shipped import extra_of, shipped_scenes

# CI asks the same questions every time; elsewhere every run asks new ones.
# No deadlines: the first example may have to wait for code to be compiled.
settings.register_profile("ci", derandomize=True, deadline=None)
settings.register_profile("local", deadline=None)
settings.load_profile("ci" if os.environ.get("CI") else "local")

ROOT = Path(__file__).parent.parent

SHIPPED = list(shipped_scenes())

PLAIN = [name for name, path in shipped_scenes().items() if extra_of(path) is None]
"""Those whose robots come with PyBullet: what is slow is done for these alone."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add what `tests/fuzz` tries."""
    group = parser.getgroup("fuzz", "damaged input, see tests/fuzz")
    group.addoption("--fuzz-cases", type=int, default=50, help="number of cases of each kind of input")
    group.addoption("--fuzz-first", type=int, default=0, help="number of the first case")
    group.addoption("--fuzz-seed", type=int, default=0, help="seed of all cases")


def pytest_configure(config: pytest.Config) -> None:
    """Compile what is not compiled yet, unless the tests run in this process, which does so as it goes."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        # A shell's background job hands down that Ctrl-C is ignored; a person's terminal does not.
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if not config.getoption("numprocesses", None) or config.getoption("collectonly"):
        return  # in a worker it is not set
    from tests.compile_all import fingerprint

    key, compiled = "symgrasp/compiled", fingerprint()
    assert config.cache
    if config.cache.get(key, "") != compiled:
        subprocess.run([sys.executable, "-m", "tests.compile_all"], cwd=ROOT, check=True)
        config.cache.set(key, compiled)


@cache
def load_small(name: str, heights: int = 8, angles: int = 16, redundancy: int = 6) -> Scene:
    """Load a shipped scene with a grid that is quick to compute."""
    return Scene.load(name).with_settings(heights=heights, angles=angles, redundancy=redundancy)


@pytest.fixture(params=PLAIN)
def shipped(request: pytest.FixtureRequest) -> Scene:
    return load_small(request.param)


@pytest.fixture
def content() -> dict[str, Any]:
    """The content of a scene file, free to be changed."""
    return yaml.safe_load((SCENES_DIR / "bottle_on_table.yaml").read_text())


def write_scene(folder: Path, content: object, name: str = "scene.yaml") -> Path:
    path = folder / name
    path.write_text(content if isinstance(content, str) else yaml.safe_dump(content))
    return path
