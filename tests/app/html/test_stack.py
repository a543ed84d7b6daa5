"""The maps of a sequence over each other."""

# The plan is there where these tests look.
# pyright: reportOptionalMemberAccess=false

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.html.stack import stack_html
from app.state.plan_changes import change_plan_results
from symgrasp.object.manifold import ROLLS
from tests.app.state.test_state import with_plan


@pytest.mark.parametrize("name", ["pick_pour_place", "pr2_pour"])
def test_the_common_cells_are_counted_though_a_mark_may_hide_them(name):
    state = with_plan(name, "sequential")
    tasks, maps = state.plan.plan.tasks, state.plan_results.maps
    roll = ROLLS.index(tasks[0].holds[0].grasp.roll)
    shifted = [maps[task.name, task.holds[0].arm].map.shift(task.delta) for task in tasks]
    step = shifted[0].manifold.dtheta
    columns = [round((m.manifold.theta_start + np.pi) / step) for m in shifted]
    common = np.logical_and.reduce(
        [np.roll(m.feasible[roll], k, axis=1) for m, k in zip(shifted, columns, strict=True)]
    ).sum()
    assert common
    word = "cell" if common == 1 else "cells"
    assert f"all {len(tasks)} over each other: {common} common {word}<" in stack_html(state)
    slid = change_plan_results(state, lambda results: replace(results, slide=0.0))
    apart = np.logical_and.reduce([maps[t.name, t.holds[0].arm].map.feasible[roll] for t in tasks]).sum()
    assert f"over each other: {apart} common " in stack_html(slid)
