"""Changes of the state of a page in any order."""

from __future__ import annotations

import math
from dataclasses import replace

from hypothesis import given, settings
from hypothesis import strategies as st

from app.render.drawn_poses import drawn_joint_values
from app.state import changes, job_changes
from app.state.map_view_state import RollChoice
from app.state.plans import plan_changes
from app.state.plans.plan_results import PlanKind
from app.state.undo import redo, remember, undo
from symgrasp.errors import SymgraspError
from tests.app.state.states import opened, planned

angle = st.floats(-math.pi, math.pi)


PLANNER: dict[str, PlanKind] = {"pick_pour_place": "sequential", "handover_between_robots": "handover"}


CHANGES = st.one_of(
    st.builds(lambda v: lambda s: changes.turn(s, v), angle),
    st.builds(lambda v: lambda s: changes.moved(s, x=v), st.sampled_from([0.5, 0.55])),
    st.builds(lambda v: lambda s: changes.moved(s, lean=v), st.sampled_from([0.0, 0.3])),
    st.builds(lambda h, t: lambda s: changes.choose(s, h, t), st.floats(-0.1, 0.4), angle),
    st.builds(
        lambda i, j: lambda s: changes.choose_surface_cell(s, i, j), st.integers(0, 7), st.integers(0, 15)
    ),
    st.builds(lambda v: lambda s: changes.choose_roll(s, v), st.sampled_from(list(RollChoice))),
    st.builds(
        lambda v: lambda s: changes.choose_task(s, v), st.sampled_from(["pick", "pour", "hand over", "place"])
    ),
    st.builds(lambda v: lambda s: changes.choose_arm(s, v), st.sampled_from(["panda", "left", "right"])),
    st.builds(lambda v: lambda s: plan_changes.show_step(s, v), st.integers(-1, 5)),
    st.sampled_from(
        [
            changes.reset_pose,
            changes.clear_pick,
            job_changes.retried,
            undo,
            redo,
            lambda s: job_changes.map_arrived(s, 0, s.result) if s.result else s,
            lambda s: job_changes.started(s, 1, "map", s.next_request) if s.next_request else s,
            lambda s: job_changes.progressed(s, 1, 0.5, late=True),
            lambda s: job_changes.map_arrived(s, 1, s.result) if s.result else s,
            lambda s: job_changes.stopped(s, 1),
            lambda s: job_changes.started(s, 2, "Planning"),
            lambda s: replace(s, map_view=s.map_view.with_compare(not s.map_view.compare)),
            lambda s: changes.choose_candidate(s, 1),
            lambda s: (
                s if s.poses else plan_changes.show_results(s, planned(s.scene_name, PLANNER[s.scene_name]))
            ),
        ]
    ),
)


@settings(deadline=None, max_examples=150)
@given(st.sampled_from(list(PLANNER)), st.lists(CHANGES, max_size=12))
def test_no_order_of_changes_breaks_the_picture(name, sequence):
    state = opened(name)
    for time, change in enumerate(sequence):
        try:
            state = remember(state, change(state), "", time)
        except SymgraspError as error:
            state = job_changes.failed(state, str(error))
        assert state.task in state.scene.tasks
        assert state.arm in state.scene.task(state.task).arms
        assert set(drawn_joint_values(state)) == set(state.scene.robots)
        assert state.base.matrix().shape == (4, 4)
        if state.pick:
            assert state.cell is not None
        if state.shown_task:
            assert state.is_current
            assert state.shown_task.name == state.task
        assert not (state.next_request == state.request and state.is_current)
        assert state.next_request is None or state.next_request != state.refused
