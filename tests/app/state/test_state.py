"""The state of a page and its changes, with no page."""

# A map, a pick or a plan may be None in general, but not where these tests look.
# pyright: reportOptionalMemberAccess=false, reportArgumentType=false

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.choices.object_choice import OWN, from_library, from_mesh
from app.compute.map_service import MapService
from app.compute.plan_service import PlanRequest, PlanService
from app.html.readout import grasp_html, status_html
from app.panels.keyboard import next_arm
from app.render.drawn_poses import drawn_joint_values
from app.render.map_picture import map_picture
from app.state import changes, job_changes, plan_changes
from app.state.map_view_state import RollChoice
from app.state.object_pose import ObjectPose
from app.state.plan_results import PlanKind, PlanResults
from app.state.requests import MapRequest, MapResult
from app.state.state import State
from app.state.undo import redo, remember, undo
from symgrasp.errors import SymgraspError
from symgrasp.feasibility.create import create_map
from symgrasp.object.manifold import ROLLS, wrap
from symgrasp.poses import pose_error, rotation_about, rotation_z
from symgrasp.reason import Reason
from tests.app.shown_map import shown as as_shown
from tests.conftest import load_small
from tests.strategies import poses

angle = st.floats(-math.pi, math.pi)


@cache
def small_map(name: str, task: str, arm: str, pose: ObjectPose | None = None) -> MapResult:
    request = MapRequest(load_small(name), arm, task, pose)
    return MapResult(request, create_map(request.moved_scene(), task=task, arm=arm))


def opened(name: str = "bottle_on_table") -> State:
    """A scene with its map, as the page shows it first."""
    state = State.of(load_small(name), name)
    return job_changes.map_arrived(state, 0, small_map(name, state.task, state.arm))


@cache
def planned(name: str, kind: PlanKind, method: str = "") -> PlanResults:
    scene = load_small(name)
    order = PlanRequest(scene, kind, method, scene.arm().name if kind == "sequential" else scene.task().name)
    return results_of(order)


def results_of(request: PlanRequest, results: PlanResults | None = None) -> PlanResults:
    """Run a planner here, and return what the page then shows."""
    computed: list[MapResult] = []
    maps = MapService(computed.append)
    plans = PlanService(maps, ())
    try:
        outcome = plans.plan(request, {}, lambda share: None)
    finally:
        plans.close()
        maps.close()
    return outcome.added_to(results or PlanResults(), {(r.request.task, r.request.arm): r for r in computed})


def with_plan(name: str, kind: PlanKind, method: str = "") -> State:
    return plan_changes.show_results(opened(name), planned(name, kind, method))


# -- object poses ---------------------------------------------------------------------------


@settings(deadline=None)
@given(poses())
def test_a_pose_taken_apart_and_put_together_is_the_same(pose):
    if pose[2, 2] < -1 + 1e-6:  # upside down the direction of the lean is not defined
        return
    distance, turn = pose_error(ObjectPose.of(pose).matrix(), pose)
    assert distance < 1e-12
    assert turn < 1e-6


@settings(deadline=None)
@given(st.floats(0.01, 3.1), angle, angle)
def test_lean_and_direction_are_those_of_the_axis(lean, towards, spin):
    axis = ObjectPose(0.0, 0.0, 0.0, lean, towards, spin).matrix()[:3, 2]
    assert np.arccos(axis[2]) == pytest.approx(lean, abs=1e-7)
    assert np.arctan2(axis[1], axis[0]) == pytest.approx(towards, abs=1e-6)


def test_the_direction_of_a_small_lean_is_kept():
    pose = ObjectPose(0.0, 0.0, 0.0, lean=1e-9, towards=2.0).matrix()
    assert np.allclose(ObjectPose.of(pose).matrix(), pose, rtol=0, atol=1e-11)


# -- coarse maps ----------------------------------------------------------------------------


def test_a_coarse_map_is_shown_and_the_exact_one_still_awaited():
    state, exact = State.of(load_small("bottle_on_table"), ""), opened()
    request = state.request
    coarse = MapResult(request, replace(exact.result.map, preliminary=True))
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
    moved = changes.moved(started, x=0.52)
    assert job_changes.preliminary_arrived(moved, coarse) is moved


# -- turning: nothing is computed -----------------------------------------------------------


def test_a_turn_shifts_the_map_and_asks_for_nothing():
    state = opened()
    columns = state.map.manifold.angles
    turned = changes.turn(state, 3 * 2 * np.pi / columns)
    assert turned.is_current
    assert turned.next_request is None
    assert np.array_equal(turned.map.reason, np.roll(state.map.reason, -3, axis=2))
    assert not np.array_equal(turned.map.reason, state.map.reason)


@settings(deadline=None)
@given(angle)
def test_the_object_turns_about_its_own_axis(delta):
    state = changes.turn(opened("log_two_robots"), delta)
    base = state.request.T_world_object
    assert np.allclose(state.T_world_object, base @ rotation_z(delta))
    assert np.allclose(state.T_world_object[:3, 2], base[:3, 2])


@settings(deadline=None)
@given(angle, st.integers(0, 7), st.integers(0, 15))
def test_a_cell_clicked_on_the_surface_lies_where_it_is_seen(delta, row, column):
    """The colours do not turn: a cell's place in the world is that of the map before the turn."""
    state = changes.turn(opened(), delta)
    picked = changes.choose_surface_cell(state, row, column)
    grid = state.result.map.manifold
    clicked = state.request.T_world_object @ [*grid.contact(grid.h[row], grid.theta[column]), 1.0]
    chosen = picked.T_world_object @ [*grid.contact(picked.pick.h, picked.pick.theta), 1.0]
    assert np.allclose(chosen, clicked)
    shown = picked.map.reason[:, picked.cell.row, picked.cell.column]
    assert np.array_equal(shown, state.result.map.reason[:, row, column])


@settings(deadline=None)
@given(angle, angle, st.floats(0.0, 0.3))
def test_the_pick_stays_on_the_object_while_it_turns(theta, delta, h):
    state = changes.choose(opened(), h, theta)
    turned = changes.turn(state, delta)
    assert turned.pick == state.pick
    # Its cell is at most half a cell from it, and is reported for the grid as it is turned.
    assert abs(wrap(turned.map.manifold.theta[turned.cell.column] - theta)) <= np.pi / 16 + 1e-9


# -- moving: a new map ----------------------------------------------------------------------


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


@settings(deadline=None)
@given(st.floats(-1, 1), st.floats(0.1, 3.0), angle, angle)
def test_dragging_the_gizmo_puts_the_object_where_the_gizmo_is(x, lean, towards, spin):
    pose = ObjectPose(x, 0.2, 0.3, lean, towards, spin).matrix()
    state = changes.drag(changes.turn(opened(), 0.4), pose)
    assert np.allclose(state.T_world_object, pose, atol=1e-9)
    assert not state.is_current


@settings(deadline=None)
@given(angle)
def test_turning_the_gizmo_about_the_axis_only_shifts(turn):
    state = opened("log_two_robots")
    dragged = changes.drag(state, state.T_world_object @ rotation_z(turn) + 1e-8)
    assert dragged.is_current
    assert dragged.base == state.base
    assert wrap(dragged.delta - turn) == pytest.approx(0.0, abs=1e-6)


def test_tilting_the_gizmo_keeps_the_place():
    state = opened()
    tilted = state.T_world_object.copy()
    tilted[:3, :3] = rotation_about((1.0, 0.0, 0.0), 0.3)
    assert changes.drag(state, tilted).base.lean == pytest.approx(0.3)
    assert changes.drag(state, tilted).base.x == state.base.x


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_numbers_that_are_none_are_refused(value):
    for change in (
        lambda s: changes.turn(s, value),
        lambda s: changes.moved(s, x=value),
        lambda s: changes.choose(s, value, 0.0),
        lambda s: changes.choose(s, 0.1, value),
    ):
        with pytest.raises(SymgraspError, match="finite"):
            change(opened())


# -- picking --------------------------------------------------------------------------------


def test_another_object_needs_a_map_of_its_own_and_stands_where_the_old_one_stood():
    state = changes.choose(changes.turn(changes.moved(opened("pick_pour_place"), x=0.5), 0.3), 0.05, 0.0)
    object_choice = from_library("wine_bottle")
    changed = changes.choose_object(
        state, state.scene.with_object(object_choice.name, object_choice.profile), object_choice
    )
    assert changed.next_request == changed.request
    assert changed.request.scene.profile is object_choice.profile
    assert (changed.result, changed.pick, changed.map) == (None, None, None)
    assert np.array_equal(changed.T_world_object, state.T_world_object)
    assert (changed.object_option, changed.uploaded_object) == ("wine_bottle", None)
    back = changes.choose_object(changed, state.scene, None)
    assert (back.object_option, back.request) == (OWN, state.request)


def test_an_uploaded_object_stays_on_offer():
    state = opened()
    object_choice = from_library("wine_bottle")
    measured = replace(object_choice, option="b.stl (upload)", measurement=object())
    scene = state.scene.with_object(object_choice.name, object_choice.profile)
    state = changes.choose_object(changes.choose_object(state, scene, measured), scene, object_choice)
    assert (state.object_choice, state.uploaded_object) == (object_choice, measured)


def test_an_uploaded_object_is_flipped_in_the_scene_and_undone():
    content = from_library("wine_bottle").profile.mesh(48).export(file_type="stl")
    assert isinstance(content, bytes)
    choice = from_mesh("b.stl", content, 1.0)
    state = opened()
    state = changes.choose_object(state, state.scene.with_object(choice.name, choice.profile), choice)
    flipped = remember(state, changes.flip_object(state), "", 1.0)
    top = choice.profile.h_max
    knots = np.array(choice.profile.points)[::-1] * [-1, 1] + [top, 0]
    assert np.array(flipped.scene.file.object.profile) == pytest.approx(knots)
    assert flipped.object_choice is flipped.uploaded_object is not choice
    assert flipped.next_request == flipped.request != state.request
    assert undo(flipped).scene is state.scene
    assert np.array(changes.flip_object(flipped).scene.profile.points) == pytest.approx(choice.profile.points)
    library = changes.choose_object(state, state.scene, from_library("wine_bottle"))
    assert changes.flip_object(library) is library


def test_a_new_object_drops_the_plan():
    state = with_plan("log_two_robots", "bimanual")
    changed = changes.choose_object(state, state.scene, None)
    assert (changed.plan, changed.step, changed.shown_task) == (None, None, None)


def test_an_upload_that_failed_does_not_stop_the_map():
    state = changes.moved(opened(), x=0.5)
    failed = job_changes.stopped(job_changes.started(state, 1, "Measuring"), 1, "no mesh")
    assert failed.next_request == state.request
    assert failed.problem == "no mesh"
    assert (
        job_changes.stopped(job_changes.started(state, 1, "Measuring"), 1).next_request is None
    )  # cancelled by a person


def test_a_height_off_the_object_is_refused_in_its_units():
    with pytest.raises(SymgraspError, match=r"h \(cm\).*31.*0 to 30 cm"):
        changes.choose(opened(), 0.31, 0.0)


def test_either_roll_shows_the_one_that_got_furthest():
    m = opened().map
    merged = RollChoice.EITHER.reason(m)
    assert np.array_equal(merged == Reason.FEASIBLE, m.feasible.any(axis=0))
    for row, column in np.ndindex(*merged.shape):
        roll = RollChoice.EITHER.roll(m, row, column)
        assert m.reason[roll, row, column] == merged[row, column]


@pytest.mark.parametrize("roll", RollChoice)
def test_a_feasible_pick_poses_the_arm_and_another_parks_it(roll):
    state = changes.choose_roll(opened(), roll)
    shown = roll.reason(state.map)
    home = state.scene.robots["panda"].home
    row, column = np.argwhere(shown == Reason.FEASIBLE)[0]
    held = changes.choose_cell(state, row, column)
    values = drawn_joint_values(held)["panda"]
    arm = state.scene.arm()
    witness = held.map.witness(held.cell)
    assert np.array_equal(values, arm.robot_values(witness.q, witness.opening))
    assert not np.allclose(values, home)
    row, column = np.argwhere(shown != Reason.FEASIBLE)[0]
    assert np.array_equal(drawn_joint_values(changes.choose_cell(state, row, column))["panda"], home)
    assert np.array_equal(drawn_joint_values(changes.clear_pick(held))["panda"], home)


def test_the_arm_does_not_trust_an_old_map():
    state = opened()
    row, column = np.argwhere(RollChoice.EITHER.reason(state.map) == Reason.FEASIBLE)[0]
    moved = changes.moved(changes.choose_cell(state, row, column), x=0.5)
    assert np.array_equal(drawn_joint_values(moved)["panda"], state.scene.robots["panda"].home)


# -- plans ----------------------------------------------------------------------------------


def test_a_plan_is_shown_task_by_task_with_one_grasp():
    state = with_plan("pick_pour_place", "sequential")
    plan = state.plan.plan
    grasps = set()
    for k, task in enumerate(plan.tasks):
        shown = plan_changes.show_step(state, k)
        assert (shown.task, shown.delta) == (task.name, task.delta)
        assert np.allclose(shown.T_world_object, task.object_pose_turned.array())
        assert shown.is_current
        assert shown.map.feasible[shown.cell]
        assert ROLLS[shown.cell.roll] == task.holds[0].grasp.roll
        grasps.add((shown.pick.h, shown.pick.theta))
        joints = task.holds[0].joints
        names = state.scene.robots["panda"].model.joint_names
        values = drawn_joint_values(shown)["panda"]
        assert {n: values[names.index(n)] for n in joints} == joints
    assert len(grasps) == 1


def test_both_arms_hold_in_a_bimanual_plan_and_either_map_can_be_seen():
    state = with_plan("log_two_robots", "bimanual")
    values = drawn_joint_values(state)
    for name, robot in state.scene.robots.items():
        assert not np.allclose(values[name], robot.home)
    other = changes.choose_arm(state, "right")
    assert other.shown_task is state.shown_task
    assert other.arm == "right"
    assert other.map.feasible[other.cell]
    prints = [state.plan.prints[0][arm] for arm in ("left", "right")]
    assert all(p.any() for p in prints)
    assert not (prints[0] & prints[1]).any()


def test_only_an_arm_of_the_task_can_be_chosen():
    state = opened("handover_between_robots")
    assert (state.task, state.arm) == ("pick", "left")
    assert next_arm(state).arm == "left"
    with pytest.raises(SymgraspError, match=r"page: arm.*'right'.*one of 'left'"):
        changes.choose_arm(state, "right")
    both = changes.choose_arm(changes.choose_task(state, "hand over"), "right")
    assert both.arm == "right"
    assert next_arm(both).arm == "left"


def test_moving_an_object_drops_the_plan_and_the_planning():
    state = with_plan("bottle_on_table", "sequential")
    assert changes.moved(state, x=0.5).plan is None
    assert changes.moved(job_changes.started(state, 2, "Planning"), x=0.5).busy is None
    assert changes.turn(state, 0.5).plan is not None
    assert changes.turn(state, 0.5).step is None


def test_which_planner_has_something_to_do():
    assert opened().can_plan("sequential")
    assert not opened().can_plan("bimanual")
    assert not opened("log_two_robots").can_plan("sequential")
    assert opened("log_two_robots").can_plan("bimanual")


# -- anything in any order ------------------------------------------------------------------

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
