"""Replaying a hill climbing, and the gap that is shown, with no page."""

# A plan or a climb may be None in general, but not where these tests look.
# pyright: reportOptionalMemberAccess=false, reportArgumentType=false, reportOptionalSubscript=false

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.render.drawn_poses import drawn_joint_values
from app.render.prints import shown_prints
from app.state import changes
from app.state.plans import plan_changes
from symgrasp.planners.gaps import PrintGaps
from tests.app.state.states import planned, with_plan
from tests.conftest import load_small

DATA = Path(__file__).parents[2] / "data"


def test_a_climb_is_replayed_with_both_hands_on_the_maps():
    state = with_plan("log_two_robots", "bimanual", "hill_climb")
    climb = state.plan_results.climb
    assert climb.found is state.plan
    exact, climbed = climb.exact.gaps[0], climb.found.gaps[0]
    assert exact is not None and climbed is not None
    assert exact >= climbed
    state = plan_changes.play_climb(state)
    frames = [state.plan_results.frame]
    while state.plan_results.playing:
        state = plan_changes.played(state, 0.1)
        frames.append(state.plan_results.frame)
    assert frames == sorted(set(frames)) or len(climb.steps) == 1
    assert frames[-1] == len(climb.steps) - 1
    assert climb.steps[-1].collisions == 0
    for frame, step in enumerate(climb.steps):
        shown = plan_changes.show_frame(state, frame)
        left, right = shown_prints(shown)
        assert (left & right).sum() <= step.collisions  # prints go on beyond the object's ends
        values = drawn_joint_values(shown)
        for name, cell in zip(climb.arms, step.cells, strict=True):
            arm = shown.scene.arm(name)
            witness = shown.plan_results.maps["lift", name].map.witness(cell)
            assert np.array_equal(values[arm.robot.name], arm.robot_values(witness.q, witness.opening))
    assert changes.turn(state, 0.1).climb_step is None
    assert plan_changes.show_step(state, 0).climb_step is None


def test_the_gap_that_is_shown_is_that_of_the_planner():
    plan_results = planned("log_two_robots", "bimanual")
    scene = load_small("log_two_robots")
    grid = scene.manifold
    gaps = PrintGaps([scene.arm("left"), scene.arm("right")], grid)
    assert len(plan_results.plans) == 10
    for plan in plan_results.plans:
        a, b = (
            (int(np.cos(h.grasp.roll) < 0), *grid.cell(h.grasp.h, h.grasp.theta))
            for h in plan.plan.tasks[0].holds
        )
        between = gaps.around(0, a[0], a[1], 1)[b[0], b[1], (b[2] - a[2]) % grid.angles]
        assert plan.gaps[0] == pytest.approx(between)
