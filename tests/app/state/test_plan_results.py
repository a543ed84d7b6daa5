"""Leafing through plans, playing them and changing tasks, with no page."""

# A plan or a climb may be None in general, but not where these tests look.
# pyright: reportOptionalMemberAccess=false, reportArgumentType=false, reportOptionalSubscript=false

from __future__ import annotations

import math
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.compute import plan_service
from app.compute.cache import SharedCache
from app.compute.map_service import MapService
from app.compute.plan_service import PLANS_PER_BATCH, SEARCH, MotionRequest, PlanRequest, PlanService
from app.render.drawn_poses import drawn_joint_values, drawn_object_pose
from app.render.playback import plan_joint_values
from app.render.prints import shown_prints
from app.server.session.plan_actions import show_opened_plan
from app.state import changes, job_changes
from app.state.plans import plan_changes
from app.state.plans.plan_results import PlanResults
from app.state.state import State
from app.state.task_list import TaskList
from symgrasp.errors import Cancelled, InputError, NoPlanError, PlanError, SceneError, SymgraspError
from symgrasp.files import SCENES_DIR
from symgrasp.motion.choosing import Failure
from symgrasp.plan.plan import LARGEST_PLAN
from symgrasp.planners.gaps import PrintGaps
from symgrasp.planners.planning import sequential_plans
from symgrasp.poses import pose_error
from symgrasp.scene.scene import Scene
from tests.app.state.states import opened, planned, results_of, small_map, with_plan
from tests.conftest import load_small

DATA = Path(__file__).parents[2] / "data"


def quiet(share: float) -> None:
    """Progress that nobody watches."""


@pytest.fixture
def plans():
    maps = MapService()
    plans = PlanService(maps, (SCENES_DIR,))
    yield plans
    plans.close()
    maps.close()


# -- the tasks ------------------------------------------------------------------------------


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


# -- the play -------------------------------------------------------------------------------


@pytest.mark.parametrize("position", [0.0, 0.4, 0.6, 1.3, 2.0])
def test_without_a_motion_the_play_shows_one_task_after_the_other(position):
    """Nothing is shown between two tasks: nobody knows whether the arms can be there."""
    state = plan_changes.show_position(with_plan("pick_pour_place", "sequential"), position)
    step = min(int(position + 0.5), 2)
    assert (state.step, state.task) == (step, ["pick", "pour", "place"][step])
    task = state.shown_task
    expected = plan_joint_values(state.scene, task)["panda"]
    assert np.array_equal(drawn_joint_values(state)["panda"], expected)
    assert np.allclose(drawn_object_pose(state), task.object_pose_turned.array())


def test_the_play_passes_the_tasks_in_order_and_stops_at_the_end():
    state = plan_changes.play_arms(with_plan("pick_pour_place", "sequential"))
    seen, positions = [], []
    while state.plan_results.playing:
        state = plan_changes.played(state, 0.1)
        seen.append(state.task)
        positions.append(state.plan_results.position)
    assert list(dict.fromkeys(seen)) == ["pick", "pour", "place"]
    assert np.all(np.diff(positions) > 0)
    assert positions[-1] == 2
    assert np.allclose(drawn_object_pose(state), state.T_world_object)
    again = plan_changes.play_arms(state)
    assert (again.plan_results.playing, again.plan_results.position, again.step) == ("arms", 0.0, 0)
    assert not plan_changes.play_arms(again).plan_results.playing


def test_whoever_moves_on_stops_the_play():
    playing = plan_changes.played(plan_changes.play_arms(with_plan("pick_pour_place", "sequential")), 0.3)
    for move_on in (
        lambda s: changes.turn(s, 0.1),
        lambda s: changes.choose(s, 0.1, 0.0),
        lambda s: changes.choose_task(s, "place"),
    ):
        state = move_on(playing)
        assert state.step is None
        stopped = plan_changes.played(state, 0.1)
        assert not stopped.plan_results.playing
        assert (stopped.task, stopped.delta, stopped.pick) == (state.task, state.delta, state.pick)


def test_a_plan_of_one_task_has_nothing_to_play():
    state = with_plan("bottle_on_table", "sequential")
    assert plan_changes.play_arms(state).plan_results.playing == ""
    assert plan_changes.show_position(state, math.nan).step == 0


# -- the list of plans ----------------------------------------------------------------------


def test_all_solutions_are_listed_part_by_part_each_once(plans, monkeypatch):
    monkeypatch.setattr(plan_service, "PLANS_PER_BATCH", 3)
    scene = load_small("pick_pour_place", heights=24)
    request, service = PlanRequest(scene, "sequential", "best", "panda"), MapService()
    maps, _ = service.maps(request.maps, {}, quiet)
    service.close()
    plan_results = plans.plan(request, maps, quiet).added_to(PlanResults(), maps)
    assert (len(plan_results.plans), plan_results.more) == (3, True)
    state = plan_changes.show_results(State.of(scene, ""), plan_results)
    shown = state.plan
    while state.plan_results.more:
        state = plan_changes.more_listed(state, *plans.more(quiet))
        assert state.plan is shown
    grasps = [
        (p.plan.tasks[0].holds[0].grasp.h, p.plan.tasks[0].holds[0].grasp.roll)
        for p in state.plan_results.plans
    ]
    allowed = np.logical_and.reduce([r.map.feasible.any(axis=2) for r in state.plan_results.maps.values()])
    assert len(grasps) == len(set(grasps)) == allowed.sum()
    first = plan_changes.choose_plan(state, 0)
    assert first.plan is plan_results.plans[0]
    assert (first.pick.h, first.step) == (grasps[0][0], 0)


def test_no_common_grasp_is_told_with_what_would_help(plans):
    scene = load_small("pick_pour_place")
    state = changes.moved(changes.choose_task(State.of(scene, ""), "pour"), z=1.2)
    order = PlanRequest(scene, "sequential", "best", "panda", state.poses)
    plan_results = results_of(order)
    assert plan_results.plan is None
    assert plan_results.refusal.conflict.exclusions[0].tasks == ("pour",)
    assert set(plan_results.maps) == {(task, "panda") for task in scene.tasks}
    shown = plan_changes.show_results(state, plan_results)
    assert shown.task == "pour"
    assert shown.problem == ""
    assert changes.moved(shown, x=0.5).plan_results.refusal is None


# -- climbing -------------------------------------------------------------------------------


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


# -- files ----------------------------------------------------------------------------------


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


@pytest.mark.parametrize(
    ("name", "kind", "method"),
    [
        ("pick_pour_place", "sequential", "best"),
        ("log_two_robots", "bimanual", "exact"),
        ("log_two_robots", "bimanual", "hill_climb"),
    ],
)
def test_the_progress_of_a_planner_is_at_its_end_when_all_is_listed(plans, name, kind, method):
    scene, shares = load_small(name, heights=24), []
    request = PlanRequest(scene, kind, method, "panda" if kind == "sequential" else "lift")
    service = MapService()
    maps, _ = service.maps(request.maps, {}, quiet)
    service.close()
    outcome = plans.plan(request, maps, shares.append)
    assert outcome.plans
    assert shares == sorted(shares)
    parts = len(request.maps) + 1  # the maps come first
    if method != "hill_climb":
        # Each value comes once with a plan, and then again while the next one is sought.
        listed = {share for share in shares if parts * (share - 1) + 1 > SEARCH + 1e-9}
        assert len(listed) == len(outcome.plans)


# -- motions --------------------------------------------------------------------------------


def test_plans_are_tried_beyond_the_list_until_one_has_a_motion(plans, monkeypatch):
    """They are listed up to that one, and the rest when more are asked for."""
    scene = load_small("bottle_on_table")
    batch = 3
    monkeypatch.setattr(plan_service, "PLANS_PER_BATCH", batch)
    every = list(islice(sequential_plans(scene, "panda"), 4 * batch))
    assert len(every) == 4 * batch

    def moving(last: int) -> None:
        def moving_plans(scene, plans, failures, progress):
            for number, plan in enumerate(plans, start=1):
                if number > last:
                    yield plan, None
                    return
                failures.append(Failure(number, f"no way for {number}"))
                if number == batch + 5:
                    raise Cancelled

        monkeypatch.setattr(plan_service, "moving_plans", moving_plans)

    monkeypatch.setattr(plan_service, "with_motion", lambda plan, motion: plan)
    outcome = plans.plan(PlanRequest(scene, "sequential", "", "panda"), {}, quiet)
    shown = tuple(result.plan for result in outcome.plans)
    assert list(shown) == every[:batch]
    moving(1000)
    with pytest.raises(Cancelled):
        plans.motion(MotionRequest(scene, {}, shown, more=True), quiet)
    moving(batch + 2)
    found = plans.motion(MotionRequest(scene, {}, shown, more=True), quiet)
    assert (found.index, found.plan) == (batch + 2, every[batch + 2])
    assert found.failures[-1] == f"no way for {found.index}"
    assert [result.plan for result in found.listed] == every[batch : found.index + 1]
    later, more = plans.more(quiet)
    assert more
    assert [result.plan for result in later] == every[found.index + 1 :][:batch]
    moving(1)
    alone = plans.motion(MotionRequest(scene, {}, shown[1:], more=True), quiet)
    assert (alone.index, alone.plan, alone.listed) == (1, shown[2], ())
    moving(batch)
    with pytest.raises(NoPlanError, match="no way for 3"):
        plans.motion(MotionRequest(scene, {}, shown, more=False), quiet)


def test_further_plans_are_listed_with_the_one_that_has_a_motion():
    state = with_plan("bottle_on_table", "sequential")
    results = state.plan_results
    count = len(results.plans)
    found = plan_changes.motion_found(state, count + 1, results.plans[1].plan, ("a", "b"), results.plans[:2])
    assert found.plan_results.plans[:count] == results.plans
    assert (len(found.plan_results.plans), found.plan_results.index) == (count + 2, count + 1)
    assert found.plan_results.more == results.more


def test_all_plans_with_the_fewest_regrasps_are_listed(plans):
    scene = Scene.load(str(DATA / "crate_and_hood.yaml"))
    outcome = plans.plan(PlanRequest(scene, "sequential", "regrasp", "panda"), {}, quiet)
    assert len(outcome.plans) == PLANS_PER_BATCH
    assert all(len(result.plan.tasks) == 4 for result in outcome.plans)
