"""What `import symgrasp` gives: every name, nothing heavy until it is used, and each function works."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import symgrasp as sg
from symgrasp import page
from symgrasp.object.manifold import ROLLS
from symgrasp.scene.shipped import shipped_scenes
from tests.conftest import SHIPPED, load_small

NAMES = {
    "load_scene", "create_map", "plan_sequential", "plan_bimanual", "plan_handover", "verify", "explain",
    "self_motion",
    "measure_object", "measure_hand", "list_scenes", "Profile", "Manifold", "FeasibilityMap", "Reason",
    "Scene", "Plan", "SymgraspError",
}  # fmt: skip

HEAVY = {"numba", "scipy", "matplotlib", "pybullet", "trimesh", "pydantic", "numpy", "viser", "yourdfpy"}


def imported_by(code: str) -> set[str]:
    """The packages that a new interpreter has imported after running a line."""
    command = f"{code}\nimport sys\nprint(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", command], capture_output=True, text=True, check=True)
    return {name.split(".")[0] for name in done.stdout.split()}


@pytest.mark.parametrize("code", ["import symgrasp", "import symgrasp; symgrasp.list_scenes()"])
def test_nothing_heavy_is_imported_before_it_is_used(code):
    assert not imported_by(code) & HEAVY


def test_the_door_has_these_names_and_no_others():
    assert set(sg.__all__) == NAMES
    assert set(dir(sg)) >= NAMES
    for name in NAMES:
        assert getattr(sg, name).__doc__
    with pytest.raises(AttributeError, match="has no attribute 'plan_everything'"):
        _ = sg.plan_everything  # pyright: ignore[reportAttributeAccessIssue]


def test_type_checkers_see_what_is_imported():
    """The names under TYPE_CHECKING are the very ones that are imported when they are used."""
    tree = ast.parse(Path(sg.__file__).read_text())
    seen = {
        alias.asname or alias.name: (node.module, alias.name)
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("symgrasp.")
        for alias in node.names
    }
    assert seen.keys() == NAMES
    for name, (module, attribute) in seen.items():
        __import__(module)
        assert getattr(sg, name) is getattr(sys.modules[module], attribute)


def test_scenes_are_listed_with_what_they_show():
    assert sg.list_scenes() == {name: sg.load_scene(name).file.description for name in SHIPPED}
    assert all(sg.list_scenes().values())


def test_a_scene_by_name_path_and_content():
    scene = sg.load_scene("soda_can")
    for same in (str(shipped_scenes()["soda_can"]), shipped_scenes()["soda_can"], scene.content):
        assert sg.load_scene(same).sha256 == scene.sha256
    with pytest.raises(sg.SymgraspError, match="did you mean 'soda_can'"):
        sg.load_scene("soda_cam")


def test_a_cell_explained_has_the_reason_of_the_map():
    scene = load_small("pick_pour_place")
    m = sg.create_map(scene, task="pour", method="reference")
    for roll, row, column in np.argwhere(m.reason >= 0)[::29]:
        h, theta = float(m.manifold.h[row]), float(m.manifold.theta[column])
        found = sg.explain(scene, h, theta, ROLLS[roll], "pour")
        assert found.reason == m.reason[roll, row, column]
        assert str(found).startswith(found.reason.label)
        head = 2 if found.rests_on else 1
        assert len(str(found).splitlines()) == head + len(found.candidates)


@pytest.mark.parametrize(
    ("h", "theta", "roll", "expected"),
    [
        (0.1, 0.0, 1.0, "roll (rad): 1.0: expected 0 or π"),
        (0.1, 0.0, float("nan"), "expected 0 or π"),
        (0.1, float("nan"), 0.0, "expected a number"),
        (9.0, 0.0, 0.0, "expected within"),
    ],
)
def test_grasps_that_are_none_are_refused(h, theta, roll, expected):
    with pytest.raises(sg.SymgraspError) as caught:
        sg.explain(load_small("soda_can"), h, theta, roll)
    assert expected in str(caught.value)


def test_a_roll_may_be_whole_turns_away():
    scene = load_small("soda_can")
    reasons = {sg.explain(scene, 0.05, 0.3, roll).reason for roll in (np.pi, -np.pi, 3 * np.pi)}
    assert len(reasons) == 1


def test_plans_are_verified_from_file_and_from_memory(tmp_path):
    plan = sg.plan_sequential(load_small("pick_pour_place", 12, 24, 8))
    path = tmp_path / "plan.json"
    plan.save(path)
    assert sg.verify(plan)
    assert sg.verify(path)
    content = json.loads(path.read_text())
    content["tasks"][0]["holds"][0]["joints"]["panda_joint2"] += 0.05
    path.write_text(json.dumps(content))
    report = sg.verify(str(path))
    assert not report
    assert str(report).splitlines()[:-1] == report.failures
    with pytest.raises(sg.SymgraspError, match="readable JSON"):
        sg.verify(tmp_path / "none.json")


def test_objects_and_hands_are_measured(tmp_path):
    can = sg.measure_object("can_330ml")
    assert can.profile.h_max == pytest.approx(0.115, abs=0.01)
    assert "franka" in can.holds
    assert str(can).splitlines() == can.lines()
    hand = sg.measure_hand("package://pybullet_data/pr2_gripper.urdf")
    assert hand.max_opening == pytest.approx(0.0988, abs=1e-3)
    with pytest.raises(sg.SymgraspError, match="existing URDF file"):
        sg.measure_hand(tmp_path / "none.urdf")


# -- show(), outside a notebook; tests/docs/test_notebook.py has it in one ----------------------


@pytest.fixture
def opened(tmp_path, monkeypatch) -> list[str]:
    """The addresses that a browser was asked to open; files go to tmp_path."""
    addresses: list[str] = []
    monkeypatch.setattr("webbrowser.open", addresses.append)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    return addresses


def test_a_map_is_written_and_opened(opened, tmp_path, capsys):
    m = sg.create_map(load_small("soda_can"))
    m.shift(0.4).show()
    picture, view = capsys.readouterr().out.splitlines()
    assert [Path(opened[0].removeprefix("file://"))] == list(tmp_path.glob("*.html"))
    assert view.endswith(opened[0])
    assert Path(picture.split("file://")[1]).read_bytes().startswith(b"\x89PNG")
    assert "__VISER_EMBED_DATA__" in next(tmp_path.glob("*.html")).read_text()


def test_a_map_from_a_file_has_its_picture_alone(opened, tmp_path, capsys):
    sg.create_map(load_small("soda_can")).save(tmp_path / "map.npz")
    sg.FeasibilityMap.load(tmp_path / "map.npz").show()
    picture, why = capsys.readouterr().out.splitlines()
    assert Path(picture.split("file://")[1]).is_file()
    assert "does not know its scene" in why
    assert not opened


def test_a_plan_shows_every_task(opened, tmp_path, capsys):
    plan = sg.plan_sequential(load_small("pick_pour_place", 12, 24, 8))
    plan.show()
    assert len(capsys.readouterr().out.splitlines()) == len(plan.tasks) + 1
    document = Path(opened[0].removeprefix("file://")).read_text()
    assert document.count("<iframe") == len(plan.tasks)
    assert all(f"<h3>{task.name}</h3>" in document for task in plan.tasks)


def test_without_the_page_there_are_pictures(opened, monkeypatch, capsys):
    monkeypatch.setattr(page, "find_spec", lambda name: None)
    scene = load_small("pick_pour_place", 12, 24, 8)
    sg.create_map(scene).show()
    assert "no 3D view: the package of the page is not installed" in capsys.readouterr().out
    sg.plan_sequential(scene).show()
    assert "no 3D view: the package of the page is not installed" in capsys.readouterr().out
    assert not opened
