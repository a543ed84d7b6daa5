"""Where a robot should stand: against plans made one by one, at every base of a small grid."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from distributed import Client, LocalCluster

from symgrasp.errors import NoPlanError
from symgrasp.plan.report import Report
from symgrasp.plan.verify import verify
from symgrasp.planners.planning import plan_sequential
from symgrasp.poses import rotation_z, translation
from symgrasp.scene.replacing import with_base
from symgrasp.scene.scene import Scene
from symgrasp.survey import placement
from symgrasp.survey.format import KeepOut
from symgrasp.survey.placement import Base, Region, kind_of_plan, place_base
from symgrasp.survey.placement_picture import draw_placement
from symgrasp.survey.running import plan_margins_on
from symgrasp.world import open_world, stands_free
from tests.conftest import load_small

REGION = Region((-0.2, 0.0), (-0.1, 0.1), (0.0, 0.0), (0.0, 30.0), step=0.2)


@pytest.fixture(scope="module")
def client():
    cluster: Any = LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=":0")
    with cluster, Client(cluster, set_as_default=False) as found:
        yield found


def brute(scene: Scene, base: Base) -> float:
    """Return the margin (m) of the best plan, NaN where there is none."""
    T = translation([base.x, base.y, base.z]) @ rotation_z(math.radians(base.yaw_deg))
    moved = with_base(scene, "panda", T)
    with open_world(moved) as world:
        if not stands_free(world, "panda"):
            return math.nan
    try:
        plan = plan_sequential(moved)
    except NoPlanError:
        return math.nan
    radius = moved.profile.radius
    return min(
        min(hold.margin_along, hold.margin_around * float(radius(hold.grasp.h)))
        for task in plan.tasks
        for hold in task.holds
    )


def test_every_base_is_what_a_plan_of_its_own_says(client, tmp_path, monkeypatch):
    monkeypatch.setattr(placement, "ROUNDS", 1)
    monkeypatch.setattr(placement, "SEEDS", 1)
    scene = load_small("pick_pour_place", 10, 24, 8)
    found = place_base(scene, "panda", REGION, partial(plan_margins_on, client, tmp_path, None))
    expected = {base: brute(scene, base) for base in found.margins}
    assert len(found.margins) > 8
    assert np.allclose(list(found.margins.values()), list(expected.values()), rtol=1e-9, equal_nan=True)
    assert len({round(m, 6) for m in expected.values() if not math.isnan(m)}) > 1
    assert found.proposals[0].margin == pytest.approx(np.nanmax(list(expected.values())))
    first = found.proposals[0]
    assert np.allclose(first.scene.robots["panda"].T_world_base[:3, 3], first.base[:3])
    assert first.plan.scene.content["robots"][0]["base"]["position"] == pytest.approx(list(first.base[:3]))
    outs = (KeepOut(x=(-0.3, -0.15), y=(-0.05, 0.1)), KeepOut(x=(-9, 9), y=(5, 9)))
    axes = draw_placement(scene, "panda", replace(found, keep_out=outs)).axes[0]
    legend = axes.get_legend()
    assert legend
    assert legend.get_texts()[0].get_text() == "no base may stand here"
    assert axes.get_ylim()[1] < 1.5


def test_nothing_stands_where_it_may_not(client, tmp_path, monkeypatch):
    monkeypatch.setattr(placement, "ROUNDS", 0)
    scene = load_small("bottle_on_table", 6, 12, 4)
    region = Region((0.0, 0.65), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0), 0.65, (KeepOut(x=(-1, 0.1), y=(-1, 1)),))
    with pytest.raises(NoPlanError, match="none of 2 bases of panda"):  # kept out, and inside the bottle
        place_base(scene, "panda", region, partial(plan_margins_on, client, tmp_path, None))


def test_bases_whose_plan_does_not_hold_are_told(client, tmp_path, monkeypatch):
    """Such a plan is a fault of the planner, which nobody would hear of."""
    monkeypatch.setattr(placement, "ROUNDS", 0)
    scene = load_small("pick_pour_place", 10, 24, 8)
    surveyed = partial(plan_margins_on, client, tmp_path, None)
    best = place_base(scene, "panda", REGION, surveyed).proposals[0].base
    reports = iter([lambda plan: Report(checks=2, failures=["task pick: it floats"])])
    monkeypatch.setattr(placement, "verify", lambda plan: next(reports, verify)(plan))
    found = place_base(scene, "panda", REGION, surveyed)
    assert found.refused == {best: "its plan does not hold: task pick: it floats"}
    assert found.proposals
    assert best not in [own.base for own in found.proposals]


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("pick_pour_place", "sequential"),
        ("log_two_robots", "bimanual"),
        ("handover_between_robots", "handover"),
    ],
)
def test_all_tasks_are_asked_for(name, kind):
    assert kind_of_plan(Scene.load(name)) == kind
