"""The bench of plans has a figure for every shipped scene, of the planner that it is made for."""

from __future__ import annotations

import json

import pytest

from symgrasp.bench import plans
from symgrasp.cli.main import main
from symgrasp.plan.plan import Plan
from symgrasp.planners.planning import plan_bimanual, plan_handover, plan_sequential
from symgrasp.scene.scene import Scene
from tests.conftest import SHIPPED


@pytest.mark.parametrize(
    ("name", "planner"),
    [
        ("soda_can", plan_sequential),
        ("log_two_robots", plan_bimanual),
        ("handover_between_robots", plan_handover),
    ],
)
def test_the_planner_that_a_scene_is_made_for(name, planner):
    assert plans.planner_of(Scene.load(name)) is planner


def test_every_shipped_scene_is_planned(monkeypatch, tmp_path, capsys):
    planned: list[str] = []

    def planner(scene: Scene) -> None:
        planned.append(scene.name)

    monkeypatch.setattr(plans, "planner_of", lambda scene: planner)
    assert main(["bench", "plans", "--out", str(tmp_path / "plans.json")]) == 0
    assert planned == [name for name in SHIPPED for _ in range(1 + plans.RUNS)]
    figures = json.loads((tmp_path / "plans.json").read_text())["figures"]
    assert [figure["name"] for figure in figures] == [f"plan of {name}" for name in SHIPPED]
    assert all(len(figure["values"]) == plans.RUNS for figure in figures)
    assert capsys.readouterr().out.count("plan of") == len(SHIPPED)


def test_a_scene_whose_robots_are_not_installed_says_what_to_install(monkeypatch):
    monkeypatch.setattr("symgrasp.scene.shipped.package_dirs", lambda reference: [])
    monkeypatch.setattr(plans, "list_scenes", lambda: {"ur5_bottle": ""})
    (figure,) = plans.run()
    assert not figure.values
    assert "pip install 'symgrasp[robots]'" in figure.line()


def test_plans_are_plans():
    scene = Scene.load("soda_can")
    assert isinstance(plans.planner_of(scene)(scene), Plan)
