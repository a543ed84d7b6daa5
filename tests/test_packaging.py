"""What a user gets: a wheel that works from any folder, and the same names in every place."""

from __future__ import annotations

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from tests.conftest import SHIPPED

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    build = [
        sys.executable,
        "-m",
        "pip",
        "wheel",
        "--quiet",
        "--no-deps",
        "--wheel-dir",
        str(folder),
        str(ROOT),
    ]
    subprocess.run(build, check=True, capture_output=True)
    (path,) = folder.glob("*.whl")
    return path


def test_scenes_and_the_page_come_with_the_wheel(wheel):
    names = set(zipfile.ZipFile(wheel).namelist())
    assert {f"static_scenes/{name}.yaml" for name in SHIPPED} <= names
    assert {"static_scenes/bowl.obj", "app/__main__.py", "symgrasp/schemas/plan.schema.json"} <= names
    assert not any(name.startswith("tests/") for name in names)


def test_the_wheel_works_from_another_folder(wheel, tmp_path):
    """Unpacked far from the checkout, with the checkout off the path."""
    site = tmp_path / "site"
    zipfile.ZipFile(wheel).extractall(site)
    code = (
        "import sys; sys.path = [p for p in sys.path if p != sys.argv[1]]; sys.path.insert(0, sys.argv[2]);"
        "sys.meta_path = [f for f in sys.meta_path if 'editable' not in repr(f)];"
        "import symgrasp.cli as c, symgrasp.files as f; assert sys.argv[2] in c.__file__;"
        "assert str(f.SCENES_DIR).startswith(sys.argv[2]);"
        "sys.exit(c.main(['map', 'pick_pour_place', '--task', 'pour', '--out', 'pour.json']))"
    )
    work = tmp_path / "work"
    work.mkdir()
    done = subprocess.run(
        [sys.executable, "-I", "-c", code, str(ROOT), str(site)],
        cwd=work,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert (work / "pour.json").exists()
