"""What a state asks to have computed, and what it does with what arrives."""

# A map, a pick or a plan may be None in general, but not where these tests look.
# pyright: reportOptionalMemberAccess=false, reportArgumentType=false

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.html.readout import grasp_html, status_html
from app.render.drawn_poses import drawn_joint_values
from app.render.map_picture import map_picture
from app.state import changes, job_changes
from app.state.map_view_state import RollChoice
from app.state.requests import MapRequest, MapResult
from app.state.state import State
from symgrasp.errors import SymgraspError
from symgrasp.feasibility.create import create_map
from symgrasp.reason import Reason
from tests.app.shown_map import shown as as_shown
from tests.app.state.states import opened, small_map
from tests.conftest import load_small


def test_a_coarse_map_is_shown_and_the_exact_one_still_awaited():
    state, exact = State.of(load_small("bottle_on_table"), ""), opened()
    request = state.request
    coarse = MapResult(request, replace(exact.result.map, preliminary=True), preliminary=True)
    started = job_changes.started(state, 1, "the map", request)
    shown = job_changes.preliminary_arrived(started, coarse)
    assert shown.map.preliminary
    assert not shown.is_current
    assert not shown.is_fresh
    assert shown.missing_request == request
    assert shown.next_request is None  # it is being computed
    assert as_shown(shown).title.endswith("coarse and preliminary")
    assert as_shown(shown).look["busy"]
    assert "this map is coarse" in status_html(job_changes.compiling(shown, 1))
    with pytest.raises(SymgraspError, match="computed map"):
        map_picture(shown, "PNG")
    picked = changes.choose(shown, 0.1, 0.0)
    assert picked.missing_request == request
    assert "waits for the map" in grasp_html(picked)
    drawn, before = (drawn_joint_values(at) for at in (picked, state))
    assert all(np.array_equal(drawn[robot], before[robot]) for robot in before)  # no ghost

    replaced = job_changes.map_arrived(shown, 1, exact.result)
    assert replaced.is_current
    assert "preliminary" not in as_shown(replaced).title
    assert job_changes.preliminary_arrived(replaced, coarse) is replaced
    moved = replace(changes.moved(started, x=0.52), busy=None)
    assert job_changes.preliminary_arrived(moved, coarse) is moved


def test_a_move_asks_for_a_new_map_and_keeps_the_old_one_in_view():
    state = changes.moved(opened(), x=0.5)
    assert not state.is_current
    assert state.next_request == MapRequest(state.scene, "panda", "pick", state.poses["pick"])
    assert state.map is not None
    assert state.T_world_object[:3, 3] == pytest.approx([0.5, 0.0, 0.0])


def test_the_newest_request_wins():
    first = changes.moved(opened(), x=0.5)
    second = job_changes.started(
        changes.moved(job_changes.started(first, 1, "map", first.request), x=0.45), 2, "map", first.request
    )
    late = small_map("bottle_on_table", "pick", "panda", first.request.pose)
    assert job_changes.map_arrived(second, 1, late) is second
    right = small_map("bottle_on_table", "pick", "panda", second.request.pose)
    assert job_changes.map_arrived(second, 2, right).is_current
    assert job_changes.map_arrived(second, 2, right).busy is None


def test_a_map_follows_a_drag_one_pose_behind():
    first = changes.moved(opened(), x=0.5)
    state = changes.moved(job_changes.started(first, 1, "map", first.request), x=0.45)
    assert state.next_request is None  # the quick map of 0.5 is not interrupted
    assert state.is_fresh
    assert not state.is_waiting
    state = job_changes.map_arrived(
        state, 1, small_map("bottle_on_table", "pick", "panda", first.request.pose)
    )
    assert state.result.request == first.request
    assert not state.is_current
    assert state.next_request == state.request
    assert job_changes.started(state, 2, "map", state.request).is_fresh


def sampled_map(request: MapRequest) -> MapResult:
    """What samples of the redundancy show at a pose."""
    scene = request.moved_scene().with_settings(redundancy=8)
    return MapResult(request, create_map(scene, task=request.task, arm=request.arm), preliminary=True)


def test_what_samples_show_follows_a_drag_and_the_whole_search_of_a_pose_left_behind_is_given_up():
    first = changes.moved(opened(), x=0.5)
    begun = job_changes.started(first, 1, "map", first.request)
    at_once = job_changes.preliminary_arrived(begun, sampled_map(first.request))
    assert at_once.is_preliminary
    assert at_once.is_fresh
    assert not at_once.is_current
    assert at_once.next_request is None  # it is still being searched
    page = as_shown(at_once)
    assert page.title.endswith("preliminary, 8 samples")
    assert page.look["busy"]
    assert not page.look["stale"]
    with pytest.raises(SymgraspError, match="computed map"):
        map_picture(at_once, "PNG")
    on = changes.moved(at_once, x=0.45)
    assert on.next_request == on.request  # what is left of the search is not waited for
    moved = changes.moved(begun, x=0.45)
    assert moved.next_request is None
    behind = job_changes.preliminary_arrived(moved, sampled_map(first.request))
    assert behind.result.request == first.request
    assert behind.next_request == moved.request
    assert job_changes.started(behind, 2, "map", moved.request).is_fresh
    stopped = job_changes.stopped(at_once, 1)
    assert not stopped.is_fresh
    assert as_shown(stopped).look["stale"]
    exact = small_map("bottle_on_table", "pick", "panda", first.request.pose)
    found = job_changes.map_arrived(at_once, 1, exact)
    assert found.is_current
    assert "preliminary" not in as_shown(found).title


def test_a_map_that_takes_long_is_spoken_of_and_interrupted():
    first = changes.moved(opened(), x=0.5)
    late = job_changes.progressed(job_changes.started(first, 1, "map", first.request), 1, 0.1, late=True)
    assert late.is_waiting
    assert not late.is_fresh
    assert job_changes.progressed(late, 1, 0.2).busy.late
    assert late.next_request is None
    moved = changes.moved(late, x=0.45)
    assert moved.next_request == moved.request


def test_a_map_of_another_arm_or_task_interrupts_at_once():
    state = changes.moved(opened("pick_pour_place"), x=0.5)
    busy = job_changes.started(state, 1, "map", state.request)
    other = changes.choose_task(busy, "pour")
    assert other.next_request == other.request
    assert not job_changes.started(other, 2, "map", other.request).is_fresh
    late = small_map("pick_pour_place", "pick", "panda", state.request.pose)
    assert job_changes.map_arrived(other, 1, late).result is other.result


def test_moving_back_needs_no_map():
    state = opened()
    moved = changes.moved(state, x=0.5)
    busy = job_changes.started(moved, 1, "map", moved.request)
    back = changes.reset_pose(busy)
    assert back.is_current
    assert back.next_request is None
    assert back.is_obsolete


def test_one_map_at_a_time_is_asked_for():
    state = changes.moved(opened(), x=0.5)
    assert job_changes.started(state, 1, "map", state.request).next_request is None
    assert job_changes.started(state, 1, "Planning").next_request is None


def test_cancelled_is_not_begun_again_by_itself():
    state = changes.moved(opened(), x=0.5)
    stopped = job_changes.stopped(job_changes.started(state, 7, "map", state.request), 7)
    assert stopped.busy is None
    assert stopped.next_request is None
    assert job_changes.retried(stopped).next_request == state.request
    assert changes.moved(stopped, x=0.49).next_request is not None


def test_a_comparison_that_was_stopped_can_be_begun_again():
    state = opened()
    compared = replace(state, map_view=state.map_view.with_compare(True))
    assert not job_changes.started(compared, 7, "Recomputing", compared.next_request).is_stopped
    stopped = job_changes.stopped(job_changes.started(compared, 7, "Recomputing", compared.next_request), 7)
    assert stopped.is_current
    assert stopped.is_stopped
    assert "Stopped." in status_html(stopped)
    assert job_changes.retried(stopped).next_request == compared.next_request
    assert not opened().is_stopped


def test_last_words_of_an_earlier_computation_do_not_count():
    state = job_changes.started(opened(), 2, "Planning")
    assert not job_changes.is_awaited(state, 1)
    assert job_changes.progressed(state, 1, 0.5) is state
    assert job_changes.stopped(state, 1, "failed") is state
    assert job_changes.progressed(state, 2, 0.5).busy.share == 0.5


def test_an_upload_that_failed_does_not_stop_the_map():
    state = changes.moved(opened(), x=0.5)
    failed = job_changes.stopped(job_changes.started(state, 1, "Measuring"), 1, "no mesh")
    assert failed.next_request == state.request
    assert failed.problem == "no mesh"
    assert (
        job_changes.stopped(job_changes.started(state, 1, "Measuring"), 1).next_request is None
    )  # cancelled by a person


def test_the_arm_does_not_trust_an_old_map():
    state = opened()
    row, column = np.argwhere(RollChoice.EITHER.reason(state.map) == Reason.FEASIBLE)[0]
    moved = changes.moved(changes.choose_cell(state, row, column), x=0.5)
    assert np.array_equal(drawn_joint_values(moved)["panda"], state.scene.robots["panda"].home)
