"""Scenes that many tests share, loaded once; and compiling before the tests begin in several processes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterable
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


def some(count: int, values: Iterable[Any]) -> list[Any]:
    """Return parameters of which every run takes the first so many, and a thorough one all."""
    rows = [value if isinstance(value, tuple) else (value,) for value in values]
    return [
        pytest.param(*row, marks=[pytest.mark.thorough] if k >= count else []) for k, row in enumerate(rows)
    ]


@pytest.fixture
def thorough(pytestconfig: pytest.Config) -> bool:
    """Whether the run asks of all cases."""
    return bool(pytestconfig.getoption("thorough"))


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out what only a thorough run asks of; pytest says how many tests were deselected."""
    if not config.getoption("thorough"):
        left = [item for item in items if item.get_closest_marker("thorough")]
        config.hook.pytest_deselected(items=left)
        items[:] = [item for item in items if not item.get_closest_marker("thorough")]


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add how much is asked, and what `tests/fuzz` tries."""
    parser.addoption(
        "--thorough", action="store_true", help="ask of every case, where other runs ask of some"
    )
    group = parser.getgroup("fuzz", "damaged input, see tests/fuzz")
    group.addoption(
        "--fuzz-cases", type=int, help="number of cases of each kind of input; 15, or 50 with --thorough"
    )
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
