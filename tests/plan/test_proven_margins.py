"""Margins of plans that are proven: that they are true, that planners go by them, and what verify finds."""

# Settings are nested in scenes, and what is certified is not None here.
# pyright: reportArgumentType=false

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import yaml

from app.html.stack import proven_html
from symgrasp.errors import PlanError
from symgrasp.feasibility.create import MapMaker, create_map
from symgrasp.object.manifold import ROLLS, Manifold
from symgrasp.plan import check_margins
from symgrasp.plan.exports import to_tsr
from symgrasp.plan.listing import plan_in_words
from symgrasp.plan.plan import Plan
from symgrasp.plan.verify import verify
from symgrasp.planners.planning import plan_bimanual, plan_sequential
from symgrasp.poses import from_position_rpy
from symgrasp.scene.parts import Task
from symgrasp.scene.scene import Scene
from symgrasp.world import open_world
from tests.conftest import load_small, some
from tests.plan.tampering import caught, changed
from tests.plan.test_plan import PLANS, sequential

RESOLUTION = {"mm": 10, "deg": 4}


@cache
def one_hand() -> Plan:
    return plan_sequential(load_small("ur5_bottle", 8, 24).with_settings(resolution=RESOLUTION))


@cache
def two_hands() -> Plan:
    scene = load_small("log_two_robots", 16, 24, 6)
    return plan_bimanual(scene.with_settings(resolution={"mm": 10, "deg": 4}))


@cache
def searched() -> Plan:
    scene = load_small("soda_can", 8, 24).with_settings(redundancy="auto", resolution={"mm": 8, "deg": 4})
    return plan_sequential(scene)


PROVEN = [one_hand, two_hands, searched]


def holds_of(plan: Plan):
    return [hold for task in plan.tasks for hold in task.holds]


def scene_of(plan: Plan) -> Scene:
    return Scene.from_content(plan.scene.content)


@pytest.mark.parametrize("make", PROVEN)
def test_plans_state_the_proven_margins_of_each_task(make):
    plan = make()
    scene = scene_of(plan)
    assert verify(Plan.model_validate_json(plan.to_json()), strict=True).failures == []
    for task in plan.tasks:
        for hold in task.holds:
            m = create_map(scene, task=task.name, arm=hold.arm)
            cell = (
                ROLLS.index(hold.grasp.roll),
                *m.manifold.cell(hold.grasp.h, hold.grasp.theta + task.delta),
            )
            assert hold.margins == "proven"
            assert (hold.margin_along, hold.margin_around) == m.margin(cell)
    assert max(min(h.margin_along, h.margin_around) for h in holds_of(plan)) > 0
    assert ", proven;" in plan_in_words(plan)
    assert "Margins are proven" in proven_html(plan.tasks)


def test_no_other_grasp_has_larger_proven_margins():
    plan = one_hand()
    scene = scene_of(plan)
    maps = [create_map(scene, task=task.name) for task in plan.tasks]
    radius = scene.profile.radius(scene.manifold.h)[None, :, None]
    best = np.full((2, scene.manifold.heights), np.inf)
    for m in maps:
        margin = np.minimum(m.margins[..., 0], m.margins[..., 1] * radius)
        best = np.minimum(best, np.where(m.feasible, margin, -1.0).max(axis=2))
    holds = holds_of(plan)
    reached = [min(h.margin_along, h.margin_around * float(scene.profile.radius(h.grasp.h))) for h in holds]
    # An arm that stands near a limit or a singular pose counts for less: see `surface_margin`.
    assert 0 < min(reached) <= best.max() + 1e-12
    cells = [m.cell_margins[..., 0].max() for m in maps]
    assert all(h.margin_along < along for h, along in zip(holds, cells, strict=True))


@pytest.mark.parametrize("seed", range(3))
def test_algorithm_1_holds_every_grasp_within_proven_margins(seed):
    """Densely, along and around, at random places of the object, and just as far as the margin goes."""
    rng = np.random.default_rng(seed)
    scene = load_small("pick_pour_place", 8, 16, 4).with_settings(
        margin=0.003, resolution={"mm": 10, "deg": 6}
    )
    task = scene.task("pour")
    T = task.T_world_object @ from_position_rpy(rng.normal(0, 0.05, 3), rng.normal(0, 0.3, 3))
    moved = Task("moved", task.arms, T)
    with open_world(scene) as world:
        maker = MapMaker(world)
        m = maker.map(None, moved)
        assert m.margins_proven
        cells = np.argwhere(m.margins.min(axis=-1) > 0)
        assert len(cells) > 0
        for cell in rng.permutation(cells)[:2]:
            roll, row, column = cell.tolist()
            along, around = m.margin((roll, row, column))
            h, theta = float(m.manifold.h[row]), float(m.manifold.theta[column])
            tall = Manifold(scene.profile, 8 * 31, 1, theta - np.pi)
            points = maker.map(None, moved, method="reference", manifold=tall).feasible[roll, :, 0]
            inside = np.abs(tall.h - h) <= along
            assert inside.sum() > 5
            assert points[inside].all()
            # The heights of the grid are those of the cells; starts of it between its angles.
            for start in np.linspace(0.0, m.manifold.dtheta, 5)[:-1]:
                turned = replace(m.manifold, theta_start=m.manifold.theta_start + start)
                points = maker.map(None, moved, method="reference", manifold=turned).feasible[roll, row]
                away = np.abs((turned.theta - theta + np.pi) % (2 * np.pi) - np.pi)
                assert points[away <= around].all()


@pytest.mark.parametrize("make", some(1, PROVEN))
def test_larger_margins_are_caught(make):
    """By a step of the resolution, and by a micrometre."""
    content = json.loads(make().to_json())
    resolution = scene_of(make()).settings.resolution
    assert resolution is not None
    steps = {"margin_along": 1e-3 * resolution.mm, "margin_around": np.deg2rad(resolution.deg)}
    for k, task in enumerate(content["tasks"]):
        for j, hold in enumerate(task["holds"]):
            for name, step in steps.items():
                for more in (step, 1e-6):
                    path = ("tasks", k, "holds", j, name)
                    assert caught(changed(content, path, hold[name] + more))


@pytest.mark.parametrize("make", PROVEN)
def test_counted_margins_are_no_proven_ones_nor_the_other_way_round(make):
    content = json.loads(make().to_json())
    counted = json.loads(make().to_json())
    maps = make().maps(scene_of(make()))
    for k, task in enumerate(make().tasks):
        for j, hold in enumerate(task.holds):
            path = ("tasks", k, "holds", j)
            assert caught(changed(content, (*path, "margins"), "cells"))
            m = maps[task.name, hold.arm]
            cell = (
                ROLLS.index(hold.grasp.roll),
                *m.manifold.cell(hold.grasp.h, hold.grasp.theta + task.delta),
            )
            along, around = m.cell_margins[cell].tolist()
            counted = changed(counted, (*path, "margin_along"), along)
            counted = changed(counted, (*path, "margin_around"), around)
            assert caught(changed(counted, (*path, "margins"), "proven"))
            counted = changed(counted, (*path, "margins"), "cells")
    assert not caught(counted)  # a true plan that says less


def test_plans_of_scenes_without_proofs_claim_none():
    content = json.loads(sequential().to_json())
    assert {hold.margins for hold in holds_of(sequential())} == {"cells"}
    assert caught(changed(content, ("tasks", 0, "holds", 0, "margins"), "proven"))
    assert "proven" not in plan_in_words(sequential())
    assert proven_html(sequential().tasks) == ""


def test_tried_grasps_refute_a_wrong_proof(monkeypatch):
    """What the proof says is not all that is asked."""
    monkeypatch.setattr(check_margins, "_check_proof", lambda *_: True)
    content = json.loads(one_hand().to_json())
    scene = scene_of(one_hand())
    assert not caught(content)
    m = create_map(scene, task=one_hand().tasks[0].name)
    (hold,) = content["tasks"][0]["holds"]
    h, theta = hold["grasp"]["h"], hold["grasp"]["theta"] + content["tasks"][0]["delta"]
    along, around = m.cell_margins[ROLLS.index(hold["grasp"]["roll"]), *m.manifold.cell(h, theta)].tolist()
    for name, far in (("margin_along", along), ("margin_around", around)):
        wrong = Plan.model_validate(changed(content, ("tasks", 0, "holds", 0, name), far))
        lines = verify(wrong).failures
        assert 1 <= len(lines) <= 2  # to the one side, the other, or both
        assert all(f"{name} is overstated: " in line and "away is infeasible" in line for line in lines)


@pytest.mark.parametrize("make", PLANS)
def test_plans_of_earlier_formats_open_and_hold(make):
    content = json.loads(make().to_json())
    for task in content["tasks"]:
        for hold in task["holds"]:
            del hold["margins"]
    for version in (1, 2):
        old = Plan.parse(json.dumps({**content, "schema_version": version}), "plan")
        assert {hold.margins for hold in holds_of(old)} == {"cells"}
        assert verify(old, strict=True)


def test_proven_margins_are_of_format_3():
    content = json.loads(one_hand().to_json())
    for version in (1, 2):
        with pytest.raises(PlanError, match="schema_version 3 of a plan with proven margins"):
            Plan.parse(json.dumps({**content, "schema_version": version}), "plan")


def test_a_region_goes_as_far_as_is_proven():
    (region,) = yaml.safe_load_all(to_tsr(one_hand()))
    holds = holds_of(one_hand())
    low, high = region["Bw"][2]
    proven = min(hold.margin_along for hold in holds)
    assert 0 < high - low <= 2 * proven + 1e-12
    assert holds[0].grasp.h - proven - 1e-12 <= low <= high <= holds[0].grasp.h + proven + 1e-12


def test_proofs_of_some_cells_are_those_of_all():
    scene = load_small("ur5_bottle", 8, 24).with_settings(resolution=RESOLUTION)
    with open_world(scene) as world:
        maker = MapMaker(world)
        m = maker.map()
        roll, row, column = np.unravel_index(int(m.margins[..., 0].argmax()), m.reason.shape)
        only = np.zeros_like(m.feasible)
        only[roll, :, column] = only[roll, row] = True
        some = maker.map(only=only)
    assert some.margin((roll, row, column)) == m.margin((roll, row, column))
    assert not some.feasible[~only].any()
    assert np.array_equal(some.reason[only], m.reason[only])
