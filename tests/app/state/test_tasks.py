"""Changing the tasks of a scene, with no page."""

# A plan or a climb may be None in general, but not where these tests look.
# pyright: reportOptionalMemberAccess=false, reportArgumentType=false, reportOptionalSubscript=false

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.compute.cache import SharedCache
from app.state import changes, job_changes
from app.state.state import State
from app.state.task_list import TaskList
from symgrasp.errors import InputError, SymgraspError
from symgrasp.poses import pose_error
from symgrasp.scene.scene import Scene
from tests.app.state.states import opened, small_map, with_plan

DATA = Path(__file__).parents[2] / "data"


def test_the_objects_pose_becomes_a_task_whose_map_is_known():
    state = changes.turn(changes.moved(opened(), x=0.5), 0.3)
    state = job_changes.map_arrived(
        state, 0, small_map("bottle_on_table", "pick", "panda", state.request.pose)
    )
    added = changes.add_task(state)
    assert list(added.scene.tasks) == ["pick", "task 2"]
    assert (added.task, added.arm, added.delta) == ("task 2", "panda", 0.3)
    assert np.allclose(added.T_world_object, state.T_world_object)
    assert added.scene.task("task 2").arms == ("panda",)
    cache = SharedCache("bottle_on_table")
    cache.keep(state.result)
    known = cache.map(added.request)
    assert np.array_equal(known.map.reason, state.result.map.reason)
    assert (known.map.task, known.request) == ("task 2", added.request)
    assert job_changes.map_arrived(added, 0, known).is_current


def test_a_move_that_was_for_a_new_task_leaves_the_chosen_one_as_it_was_chosen():
    """Also where it had been moved to before."""
    state = changes.choose_task(
        changes.moved(changes.choose_task(opened("pick_pour_place"), "place"), x=0.45), "pick"
    )
    state = changes.add_task(changes.moved(changes.choose_task(state, "place"), x=0.4))
    assert state.poses["place"].x == 0.45
    assert state.T_world_object[0, 3] == pytest.approx(0.4)
    fresh = changes.add_task(changes.moved(opened("pick_pour_place"), x=0.4))
    assert "pick" not in fresh.poses
    assert fresh.T_world_object[0, 3] == pytest.approx(0.4)


def test_a_wrong_name_is_told_without_the_file_that_the_tasks_came_from():
    with pytest.raises(InputError, match=r"^tasks: .*'pour': expected"):
        changes.change_tasks(opened("pick_pour_place"), lambda tasks: tasks.renamed("pour"))


def test_the_maps_of_the_other_tasks_outlive_a_change_of_the_list():
    state = opened("pick_pour_place")
    changed = changes.change_tasks(state, lambda tasks: tasks.shifted(1))
    assert list(changed.scene.tasks) == ["pour", "pick", "place"]
    assert changed.scene is not state.scene
    assert changed.is_current
    assert changed.result is state.result


NAMES = st.sampled_from(["pick", "pour", "a", " b ", "", "x" * 101])
EDITS = st.one_of(
    st.builds(lambda by: lambda s: changes.change_tasks(s, lambda t: t.shifted(by)), st.integers(-4, 4)),
    st.builds(lambda name: lambda s: changes.change_tasks(s, lambda t: t.renamed(name)), NAMES),
    st.builds(
        lambda k: lambda s: changes.choose_task(s, list(s.scene.tasks)[k % len(s.scene.tasks)]),
        st.integers(0, 9),
    ),
    st.builds(lambda x: lambda s: changes.moved(s, x=x), st.sampled_from([0.4, 0.5])),
    st.sampled_from([changes.add_task, lambda s: changes.change_tasks(s, TaskList.removed)]),
)


@settings(deadline=None, max_examples=60)
@given(st.lists(EDITS, max_size=12))
def test_tasks_changed_in_any_order_keep_their_poses_and_can_be_written_down(edits):
    state, where = opened("pick_pour_place"), {}
    found = at(state, state.task)  # where the chosen task's object was when it was chosen
    for edit in edits:
        chosen = state.task
        before = {name: at(state, name) for name in state.scene.tasks}
        try:
            state = edit(state)
        except SymgraspError:
            continue
        where = {name: at(state, name) for name in state.scene.tasks}
        if len(where) > len(before):
            before[chosen] = found
        is_renamed = chosen not in where and len(where) == len(before)
        if state.task != chosen and not is_renamed:
            found = where[state.task]
        kept = set(before) & set(where) - {state.task}
        assert all(np.array_equal(before[name], where[name]) for name in kept)
    assert state.task in state.scene.tasks
    assert set(state.poses) <= set(state.scene.tasks)
    assert state.plan is None
    again = Scene.from_content(state.moved_scene().content)
    assert list(again.tasks) == list(state.scene.tasks)
    for name, pose in where.items():
        distance, turn = pose_error(again.task(name).T_world_object, pose)
        assert distance < 1e-9
        assert turn < 1e-6


def at(state: State, task: str) -> np.ndarray:
    pose = state.poses.get(task)
    return pose.matrix() if pose else state.scene.task(task).T_world_object


def test_a_plan_for_other_tasks_is_dropped():
    state = with_plan("pick_pour_place", "sequential")
    for change in (TaskList.removed, lambda t: t.shifted(-1) if t.task != "pick" else t.shifted(1)):
        changed = changes.change_tasks(state, change)
        assert changed.plan is None
        assert changed.step is None
        assert (
            changes.change_tasks(job_changes.started(changed, 2, "Planning"), TaskList.removed).busy is None
        )
    assert changes.change_tasks(state, lambda t: t.renamed(t.task)) is state
    with pytest.raises(SymgraspError, match="another task that stays"):
        changes.change_tasks(opened(), TaskList.removed)
