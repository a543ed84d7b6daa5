"""No message tells a browser where the server has its files."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from app.files.shown_paths import shown_paths
from symgrasp.errors import MeshError, UrdfError
from symgrasp.files import SCENES_DIR

SITE = next(entry for entry in sys.path if entry.endswith("-packages"))


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("/home/me/scenes/my.yaml: task: 'x': expected 'y'", "my.yaml: task: 'x': expected 'y'"),
        ("[Errno 2] No such file: '/tmp/symgrasp-1/a.stl'", "[Errno 2] No such file: 'a.stl'"),
        ("/home/My Files/a robot.urdf: links", "a robot.urdf: links"),
        ("mesh file:///srv/data/a.stl (/srv/data/b.stl)", "mesh a.stl (b.stl)"),
        (r"C:\Users\me\a.stl: content", "a.stl: content"),
        (f"{SITE}/cmeel.prefix/share/arms/a.urdf: link a", "package://arms/a.urdf: link a"),
        (f"{SCENES_DIR}/hands/pr2.urdf: link a", "package://static_scenes/hands/pr2.urdf: link a"),
    ],
)  # fmt: skip
def test_a_path_of_the_server_is_shown_as_people_know_the_file(text, shown):
    assert shown_paths(text) == shown


@pytest.mark.parametrize(
    "text",
    [
        "a.stl: size: '300 m': expected 0.005 to 10 m; h / r, 1/2, km/h/s, and/or",
        "package://pybullet_data/franka_panda/panda.urdf: link a: 'meshes/a/b.stl'",
        "link: scene: '../a/b.yaml': expected package://<python package>/<path>, or ~/a/b",
        "see http://127.0.0.1:8080/a/b",
        "",
    ],
)
def test_everything_else_stays(text):
    assert shown_paths(text) == text


def test_a_file_of_an_installed_package_is_shown_as_scenes_refer_to_it(monkeypatch, tmp_path):
    packages = tmp_path / "site-packages"
    monkeypatch.setattr(sys, "path", [*sys.path, str(packages)])
    error = UrdfError(packages / "some_robot" / "arm.urdf", "urdf", "no element", "a valid URDF document")
    assert str(tmp_path) in str(error)
    assert shown_paths(str(error)).startswith("package://some_robot/arm.urdf: urdf: ")


def test_no_folder_of_this_machine_is_left(tmp_path):
    here = Path(__file__)
    error = MeshError(here, str(tmp_path / "a.stl"), str(here), f"a file like {sys.executable}")
    assert not any(folder in shown_paths(str(error)) for folder in map(str, (here.parent, tmp_path)))
