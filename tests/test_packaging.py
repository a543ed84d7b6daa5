"""What a user gets: a wheel that works from any folder and puts nothing in anybody's way."""

from __future__ import annotations

import ast
import os
import re
import signal
import subprocess
import sys
import sysconfig
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

from app.server.door.viser_server import any_port
from symgrasp.files import SCENES_DIR
from tests.app.server.session.served import picture, ready
from tests.app.wire import Wire
from tests.conftest import SHIPPED, write_scene

ROOT = Path(__file__).parent.parent

PIP = [sys.executable, "-m", "pip", "--quiet"]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    build = [*PIP, "wheel", "--no-deps", "--wheel-dir", str(folder), str(ROOT)]
    subprocess.run(build, check=True, capture_output=True)
    (path,) = folder.glob("*.whl")
    return path


@pytest.fixture(scope="module")
def contents(wheel) -> zipfile.ZipFile:
    return zipfile.ZipFile(wheel)


@pytest.fixture(scope="module")
def symgrasp(wheel, tmp_path_factory) -> Callable[..., subprocess.Popen[str]]:
    """Install the wheel far from the checkout, and return what starts its command in a folder.

    That folder comes first on the path, as with ``python -m``. What the wheel depends on is taken from
    where this Python has it. As the folders on the path come from the environment and not from `site`,
    no ``.pth`` file there leads back to the checkout. Compiled code belongs to where a module lies, so
    all of it would be compiled anew here: it is interpreted.
    """
    folder = tmp_path_factory.mktemp("site")
    install = [*PIP, "install", "--no-deps", "--no-compile", "--target", str(folder), str(wheel)]
    subprocess.run(install, check=True, capture_output=True)
    folders = [str(folder), sysconfig.get_path("purelib"), sysconfig.get_path("platlib")]
    others = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}

    def start(*arguments: str, cwd: Path) -> subprocess.Popen[str]:
        path = os.pathsep.join([str(cwd), *dict.fromkeys(folders)])
        env = {**others, "PYTHONPATH": path, "NUMBA_DISABLE_JIT": "1"}
        command = [sys.executable, "-S", str(folder / "bin" / "symgrasp"), *arguments]
        pipe = subprocess.PIPE
        return subprocess.Popen(command, cwd=cwd, env=env, stdout=pipe, stderr=pipe, text=True)

    return start


@pytest.fixture
def small(tmp_path) -> Path:
    """A scene of a user's own that refers to a shipped file, with a map that is computed at once."""
    content: dict[str, Any] = yaml.safe_load((SCENES_DIR / "pick_pour_place.yaml").read_text())
    assert "package://static_scenes/bowl.obj" in str(content)
    return write_scene(tmp_path, content | {"map": {"heights": 4, "angles": 8, "redundancy": 4}})


def test_only_names_of_ours_stand_at_the_top(contents):
    tops = {name.split("/")[0] for name in contents.namelist()}
    assert len(tops) == 3
    assert tops >= {"symgrasp", "symgrasp_app"}
    assert all(re.match(r"symgrasp(_app|-[\d.]+\.dist-info)?$", top) for top in tops)


def test_everything_needed_comes_with_the_wheel_and_nothing_else(contents):
    names = set(contents.namelist())
    assert {f"symgrasp/static_scenes/{name}.yaml" for name in SHIPPED} <= names
    assert {"symgrasp/static_scenes/bowl.obj", "symgrasp/schemas/plan.schema.json"} <= names
    assert {"symgrasp/py.typed", "symgrasp_app/py.typed", "symgrasp_app/shell/static/index.html"} <= names
    endings = {Path(name).suffix for name in names if ".dist-info/" not in name}
    assert endings == {".css", ".html", ".js", ".json", ".obj", ".py", ".srdf", ".typed", ".urdf", ".yaml"}
    assert not any("test" in name for name in names)


def test_no_module_imports_a_name_that_only_a_checkout_has(contents):
    """Modules in ``app/`` import each other relatively: in a wheel they belong to ``symgrasp_app``."""
    found = []
    for name in contents.namelist():
        if not name.endswith(".py"):
            continue
        for node in ast.walk(ast.parse(contents.read(name))):
            if isinstance(node, ast.Import):
                modules = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and not node.level:
                modules = [node.module or ""]
            else:
                continue
            found += [f"{name}: {m}" for m in modules if m.split(".")[0] in ("app", "tests", "docs")]
    assert not found


def test_the_command_line_works_from_another_folder(symgrasp, small):
    """Also where something else has the names of the checkout's folders."""
    folder = small.parent
    for name in ("app", "static_scenes"):
        (folder / name).mkdir()
        (folder / name / "__init__.py").write_text("raise SystemExit('a foreign package')")
    scenes = symgrasp("scenes", cwd=folder)
    listed, errors = scenes.communicate()
    assert (scenes.returncode, errors) == (0, "")
    assert [line.split()[0] for line in listed.splitlines()] == SHIPPED
    pour = symgrasp("map", small.name, "--task", "pour", "--out", "pour.json", cwd=folder)
    counts, errors = pour.communicate()
    assert (pour.returncode, errors) == (0, "")
    assert "pour with panda, 64 cells" in counts
    assert (folder / "pour.json").is_file()


def test_the_page_opens_from_another_folder(symgrasp, small):
    """And its processes compute, which import everything anew."""
    (small.parent / "app.py").write_text("raise SystemExit('a foreign module')")
    port = any_port()
    page = symgrasp("app", small.name, "--port", str(port), cwd=small.parent)
    try:
        assert page.stdout
        told = page.stdout.readline()
        if told:
            with Wire(port) as visitor:
                first = picture(visitor.wait_for(ready))
                visitor.set("x (cm)", 70.0)
                visitor.wait_for(lambda html: picture(html) != first and ready(html))
    finally:
        page.send_signal(signal.SIGINT)
        rest, errors = page.communicate()
    assert (told, rest, errors) == (f"symgrasp: http://127.0.0.1:{port}\n", "\nsymgrasp: stopped\n", "")
