"""Grasps and configurations near joint limits or singular poses come after others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from symgrasp.feasibility.cell import Cell
from symgrasp.feasibility.create import create_map
from symgrasp.planners.configurations import ConfigurationFinder
from symgrasp.planners.planning import plan_handover
from symgrasp.planners.sequential import common_grasps, surface_margin
from symgrasp.robot.posture import EASY_SLACK, ease, limit_slack
from symgrasp.scene.scene import Scene
from symgrasp.world import open_world
from tests.conftest import load_small
from tests.plan.test_plan import bimanual, handover, sequential


@pytest.fixture(scope="module")
def bottle():
    return load_small("pick_pour_place", 12, 24, 8)


@pytest.mark.parametrize("make", [sequential, bimanual, handover])
def test_best_plans_stand_off_the_limits(make):
    slacks = [hold.limit_slack for task in make().tasks for hold in task.holds]
    assert min(slacks) > EASY_SLACK / 2


def test_of_two_hands_that_are_close_neither_stands_at_a_limit():
    """Where the witnesses of both arms meet, what takes their place counts in the ranking of grasps."""
    plan = plan_handover(Scene.load("pr2_handover"))
    slacks = [hold.limit_slack or 0.0 for task in plan.tasks for hold in task.holds]
    assert min(slacks) > EASY_SLACK / 2


def test_a_grasp_counts_less_where_the_arm_hardly_stands(bottle):
    """The best grasp comes last when the arm is near a limit there, and nothing else changes its place."""
    m = create_map(bottle)
    before = common_grasps([m])
    first = before[0]
    rated = np.ones(m.feasible.shape)
    rated[first.roll, first.row] = 1e-6
    after = common_grasps([replace(m, ease=rated)])
    assert [(g.roll, g.row) for g in after] == [(g.roll, g.row) for g in (*before[1:], first)]
    assert surface_margin(m).max() == first.margin


def test_an_easier_configuration_takes_the_place_of_the_witness():
    scene = load_small("log_two_robots", 10, 24, 16)
    m, arm = create_map(scene, arm="left"), scene.arm("left")
    poor = m.feasible & (ease(arm, m.q) < 1)
    cells = [Cell(*cell) for cell in np.argwhere(poor).tolist()][::3]
    assert len(cells) > 3
    with open_world(scene) as world:
        finder = ConfigurationFinder(world, [arm], [m])
        taken = np.array([c.q for cell in cells for c in finder.find([cell]) or ()])
        kept = np.array([c.q for cell in cells for c in finder.find([cell], every=False) or ()])
    np.testing.assert_array_equal(kept, [m.q[cell] for cell in cells])
    assert (limit_slack(arm, taken) >= 0).all()
    assert (ease(arm, taken) >= ease(arm, kept)).all()
    assert (ease(arm, taken) > ease(arm, kept)).mean() > 0.25
