"""Plans of maps for which all of the redundancy is searched, and plans from before that was the rule."""

import hashlib
import json
from pathlib import Path

from symgrasp.plan.plan import Plan
from symgrasp.plan.verify import verify
from symgrasp.planners.planning import plan_bimanual
from symgrasp.scene.scene import Scene
from tests.conftest import load_small

SAVED = Path(__file__).parent.parent / "data" / "plan_tiago_dual_tray.json"


def saved() -> Plan:
    return Plan.parse(SAVED.read_bytes(), str(SAVED))


def test_plans_of_maps_that_search_all_of_the_redundancy_hold():
    scene = load_small("log_two_robots").with_settings(redundancy="auto", approach=0.05)
    report = verify(plan_bimanual(scene))
    assert report, str(report)


def test_a_plan_that_was_saved_with_a_number_of_samples_holds():
    plan = saved()
    assert plan.scene.content["map"]["redundancy"] == 16
    report = verify(plan)
    assert report, str(report)
    pinned = verify(plan, scene=Scene.load("tiago_dual_tray"))
    assert len(pinned.failures) == 1 and "map.redundancy is 16" in pinned.failures[0]


def test_a_plan_whose_scene_says_nothing_of_the_redundancy_holds():
    plan = saved()
    del plan.scene.content["map"]["redundancy"]
    digest = hashlib.sha256(json.dumps(plan.scene.content, sort_keys=True).encode()).hexdigest()
    plan = plan.model_copy(update={"scene": plan.scene.model_copy(update={"sha256": digest})})
    assert Scene.from_content(plan.scene.content).settings.redundancy == "auto"
    report = verify(plan)
    assert report, str(report)
