"""Plans from files are verified before anything of them is shown."""

# A plan or a climb may be None in general, but not where these tests look.
# pyright: reportOptionalMemberAccess=false, reportArgumentType=false, reportOptionalSubscript=false

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.server.session.plan_actions import show_opened_plan
from symgrasp.errors import PlanError, SceneError
from symgrasp.plan.plan import LARGEST_PLAN
from tests.app.state.states import opened, planned, with_plan

DATA = Path(__file__).parents[2] / "data"


def quiet(share: float) -> None:
    """Progress that nobody watches."""


@pytest.mark.parametrize(
    ("name", "kind"), [("pick_pour_place", "sequential"), ("log_two_robots", "bimanual")]
)
def test_a_plan_from_a_file_brings_its_scene(plans, name, kind):
    plan = planned(name, kind).plan.plan
    found = plans.open(plan.to_json().encode(), "a.json", None, None, quiet)
    assert found.report.failures == ()
    assert found.report.checks > 10
    state = show_opened_plan(opened("soda_can"), found, planned(name, kind).maps)
    assert (state.scene_name, state.scene.name) == ("a.json (upload)", name)
    assert state.plan.plan == plan
    assert state.is_current
    assert state.shown_task == plan.tasks[0]
    assert np.allclose(state.T_world_object, plan.tasks[0].object_pose_turned.array())


def test_a_plan_that_does_not_hold_is_reported_with_numbers_and_not_shown(plans):
    text = planned("pick_pour_place", "sequential").plan.plan.to_json()
    h = planned("pick_pour_place", "sequential").plan.plan.tasks[0].holds[0].grasp.h
    found = plans.open(
        text.replace(f'"h": {h!r}', f'"h": {h + 0.01!r}').encode(), "a.json", None, None, quiet
    )
    assert found.plan is None
    assert any("10.0" in failure or "0.01" in failure for failure in found.report.failures)
    before = with_plan("soda_can", "sequential")
    state = show_opened_plan(before, found, {})
    assert state.scene is before.scene
    assert state.plan is before.plan
    assert state.plan_results.opened is found.report
    with pytest.raises(SceneError, match=r"obstacles\[1\].mesh.*expected a file of an installed package"):
        plans.open(
            text.replace("package://static_scenes/bowl.obj", "/etc/passwd").encode(),
            "a.json",
            None,
            None,
            quiet,
        )
    with pytest.raises(SceneError, match="or a file in the same ZIP file as the plan"):
        plans.open(
            text.replace("package://static_scenes/bowl.obj", "bowl.obj").encode(), "a.json", None, None, quiet
        )
    with pytest.raises(PlanError, match="more than 5 MB"):
        plans.open(b" " * (LARGEST_PLAN + 1), "a.json", None, None, quiet)
    with pytest.raises(PlanError, match="JSON"):
        plans.open(b"{", "a.json", None, None, quiet)
