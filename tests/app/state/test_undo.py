"""Undo and redo."""

# A plan may be None in general, but not where these tests look.
# pyright: reportOptionalMemberAccess=false

from __future__ import annotations

import gc
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from weakref import WeakSet

import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from app.choices.object_choice import from_library
from app.choices.uploaded_scene import UploadedScene
from app.state import changes, job_changes
from app.state.history import DRAG_PAUSE, STEPS_KEPT, History
from app.state.map_view_state import RollChoice
from app.state.plans import plan_changes
from app.state.plans.plan_results import PlanResults
from app.state.state import State
from app.state.undo import PLANS_KEPT, UPLOADS_KEPT, redo, remember, undo
from symgrasp.errors import InputError
from symgrasp.feasibility.map import FeasibilityMap
from tests.app.state.states import opened, planned, small_map, with_plan
from tests.conftest import load_small


class Person:
    """Changes a state as a session does, on a clock of its own."""

    def __init__(self, state: State) -> None:
        self.state, self.now = state, 0.0

    def does(self, change: Callable[[State], State], origin: str = "", after: float = 10.0) -> State:
        self.now += after
        self.state = remember(self.state, change(self.state), origin, self.now)
        return self.state


def test_undo_goes_back_and_redo_forth():
    person = Person(opened())
    states = [person.state]
    for change in (
        lambda s: changes.turn(s, 0.5),
        lambda s: changes.moved(s, x=0.5),
        lambda s: changes.choose(s, 0.1, 1.0),
        lambda s: changes.choose_roll(s, RollChoice.ZERO),
        lambda s: changes.switched(s, flat_map=False),
        changes.reset_pose,
    ):
        states.append(person.does(change))
    for state in states[-2::-1]:
        assert person.does(undo).input_values == state.input_values
    assert person.does(undo).input_values == states[0].input_values  # nothing is left to undo
    for state in states[1:]:
        assert person.does(redo).input_values == state.input_values
    assert person.does(redo).input_values == states[-1].input_values


def test_what_is_done_after_an_undo_takes_the_place_of_what_was_undone():
    person = Person(opened())
    person.does(lambda s: changes.turn(s, 0.5))
    person.does(undo)
    person.does(lambda s: changes.turn(s, 0.7))
    assert person.does(redo).delta == 0.7
    assert person.does(undo).delta == 0.0


def test_a_drag_is_one_step_and_a_pause_begins_another():
    person = Person(opened())
    for k in range(20):
        person.does(lambda s, k=k: changes.turn(s, 0.01 * k + 0.01), "inputs", after=0.05)
    person.does(lambda s: changes.turn(s, 1.0), "inputs", after=DRAG_PAUSE)
    assert len(person.state.history.past) == 2
    assert np.isclose(person.does(undo).delta, 0.2)
    assert person.does(undo).delta == 0.0


def test_drags_of_different_widgets_are_different_steps():
    person = Person(opened())
    person.does(lambda s: changes.moved(s, x=0.5), "gizmo", after=0.01)
    for k in (1, 2):
        person.does(
            lambda s, k=k: changes.drag(s, replace(s.base, y=0.1 * k, spin=0.1 * k).matrix()), "gizmo", 0.01
        )
    person.does(lambda s: changes.turn(s, 0.1), "inputs", after=0.01)
    person.does(lambda s: changes.choose(s, 0.1, 0.3), "inputs", after=0.01)
    assert len(person.state.history.past) == 3
    person.does(undo)
    person.does(undo)
    assert person.state.base.y == 0.2
    assert person.does(undo).input_values == opened().input_values


def test_what_is_computed_is_no_step_and_keeps_what_can_be_redone():
    person = Person(opened())
    person.does(lambda s: changes.turn(s, 0.1))
    person.does(undo)
    person.does(
        lambda s: job_changes.failed(job_changes.progressed(job_changes.started(s, 1, "map"), 1, 0.5), "no")
    )
    assert person.state.history.past == ()
    assert person.does(redo).delta == 0.1


def test_the_map_stays_while_poses_are_undone_and_goes_with_another_scene():
    person = Person(opened())
    person.does(lambda s: changes.moved(s, x=0.5))
    shown = person.does(undo)
    assert shown.is_current  # it was never replaced
    can = load_small("soda_can")
    person.does(lambda s: changes.choose_object(s, can, None))
    person.does(lambda s: job_changes.map_arrived(s, 1, small_map("soda_can", "pick", "panda")))
    back = person.does(undo)
    assert back.scene is shown.scene
    assert back.result is None
    assert back.next_request == back.request


def test_a_plan_comes_back_with_the_poses_it_was_made_for():
    person = Person(with_plan("pick_pour_place", "sequential"))
    person.does(lambda s: plan_changes.show_step(s, 2))
    shown = person.state
    person.does(lambda s: changes.moved(s, x=0.3))
    assert person.state.plan is None
    back = person.does(undo)
    assert back.shown_task is shown.shown_task
    assert back.is_current
    assert np.allclose(back.T_world_object, shown.T_world_object)


def test_an_upload_is_on_offer_where_it_is_shown():
    """Also where another one followed, of the same name or not."""
    start = opened()
    person = Person(start)
    scenes = [
        UploadedScene(f"{name} (upload)", replace(load_small("soda_can")))
        for name in ("a.yaml", "b.yaml", "b.yaml")
    ]
    shown = [start, *[person.does(lambda s, new=new: changes.open_upload(s, new)) for new in scenes]]
    objects = [replace(from_library("wine_bottle"), option=c, measurement=object()) for c in ("1", "2", "2")]
    for object_choice in objects:
        scene = person.state.scene.with_object(object_choice.name, object_choice.profile)
        shown.append(
            person.does(
                lambda s, scene=scene, object_choice=object_choice: changes.choose_object(
                    s, scene, object_choice
                )
            )
        )
    assert [s.shown_upload for s in shown[1:4]] == [loaded.scene for loaded in scenes]
    assert [s.uploaded_object for s in shown[4:]] == objects
    for step, states in ((undo, shown[-2::-1]), (redo, shown[1:])):
        for state in states:
            now = person.does(step)
            assert now.scene is state.scene
            assert (now.shown_upload, now.uploaded_scene) == (state.shown_upload, state.uploaded_scene)
            assert (now.object_choice, now.uploaded_object) == (state.object_choice, state.uploaded_object)


def test_only_so_many_steps_are_kept_and_nothing_computed_with_them():
    person = Person(opened())
    for k in range(STEPS_KEPT + 5):
        person.does(lambda s, k=k: changes.turn(s, 0.001 * k))
    past = person.state.history.past
    assert len(past) == STEPS_KEPT
    assert all(s.result is None and s.busy is None and s.history.past == () for s in past)


def with_maps_of_its_own(plan_results: PlanResults) -> PlanResults:
    """As a planner finds it when the object has been moved."""
    maps = {key: replace(result, map=replace(result.map)) for key, result in plan_results.maps.items()}
    return replace(plan_results, maps=maps)


def test_only_the_newest_plans_are_kept_with_their_maps():
    person, shown = Person(with_plan("pick_pour_place", "sequential")), []
    maps: WeakSet[FeasibilityMap] = WeakSet()

    def plan(state: State) -> State:
        plan_results = with_maps_of_its_own(planned("pick_pour_place", "sequential"))
        maps.update(result.map for result in plan_results.maps.values())
        return plan_changes.show_results(state, plan_results)

    for k in range(PLANS_KEPT + 3):
        person.does(plan)
        shown.append(person.does(lambda s: plan_changes.show_step(s, 1)).pick)
        person.does(lambda s, k=k: changes.moved(s, x=0.3 + 0.01 * k))
    gc.collect()
    assert len(maps) == 3 * PLANS_KEPT
    for k, pick in reversed(list(enumerate(shown))):
        back = person.does(undo)
        assert (back.plan is not None) == (back.shown_task is not None) == (k >= 3)
        assert back.pick == pick  # the grasp stays also without its plan
        person.does(undo)
        person.does(undo)


def test_the_history_keeps_few_uploads_and_every_step_since_them():
    person = Person(opened())
    kept: WeakSet[object] = WeakSet()
    uploads = UPLOADS_KEPT + 3

    def upload(state: State) -> State:
        choice = replace(from_library("wine_bottle"), measurement=object())
        kept.add(choice)
        return changes.choose_object(state, state.scene.with_object("own", choice.profile), choice)

    for k in range(uploads):
        person.does(upload)
        person.does(lambda s, k=k: changes.turn(s, 0.01 * (k + 1)))
    gc.collect()
    assert len(kept) == UPLOADS_KEPT
    steps = 0
    while (before := person.state) is not person.does(undo):
        assert person.state is not before
        steps += 1
    assert steps == 2 * UPLOADS_KEPT - 1
    assert person.state.uploaded_object in kept


class UndoMachine(RuleBasedStateMachine):
    """A list of everything that was ever chosen, and a finger on the present one."""

    def __init__(self) -> None:
        super().__init__()
        self.person = Person(opened("handover_between_robots"))
        self.chosen, self.at = [self.person.state.input_values], 0

    def do(self, change: Callable[[State], State]) -> None:
        before = self.person.state.input_values
        with suppress(InputError):
            self.person.does(change)
        after = self.person.state.input_values
        if after != before:
            self.chosen[self.at + 1 :] = [after]
            self.at += 1

    @rule(delta=st.sampled_from([0.0, 0.4, -2.0]))
    def turn(self, delta: float) -> None:
        self.do(lambda s: changes.turn(s, delta))

    @rule(x=st.sampled_from([0.4, 0.5]), lean=st.sampled_from([0.0, 0.3]))
    def move(self, x: float, lean: float) -> None:
        self.do(lambda s: changes.moved(s, x=x, lean=lean))

    @rule(task=st.sampled_from(["pick", "hand over", "place"]))
    def choose_task(self, task: str) -> None:
        self.do(lambda s: changes.choose_task(s, task))

    @rule(arm=st.sampled_from(["left", "right"]))
    def choose_arm(self, arm: str) -> None:
        self.do(lambda s: changes.choose_arm(s, arm))

    @rule(h=st.sampled_from([0.05, 0.1]))
    def pick(self, h: float) -> None:
        self.do(lambda s: changes.choose(s, h, 0.0))

    @rule()
    def reset(self) -> None:
        self.do(changes.reset_pose)

    @rule()
    def compute(self) -> None:
        if self.person.state.next_request:
            self.person.does(
                lambda s: job_changes.stopped(job_changes.started(s, 1, "map", s.next_request), 1, "no")
            )

    @precondition(lambda self: self.at > 0)
    @rule()
    def undo(self) -> None:
        self.person.does(undo)
        self.at -= 1

    @precondition(lambda self: self.at < len(self.chosen) - 1)
    @rule()
    def redo(self) -> None:
        self.person.does(redo)
        self.at += 1

    @invariant()
    def the_finger_is_on_what_is_shown(self) -> None:
        state = self.person.state
        assert state.input_values == self.chosen[self.at]
        assert state.arm in state.scene.task(state.task).arms
        assert len(state.history.past) == self.at
        assert len(state.history.future) == len(self.chosen) - 1 - self.at


UndoMachine.TestCase.settings = settings(deadline=None, max_examples=60, stateful_step_count=40)
TestUndo = pytest.mark.random_walk(UndoMachine.TestCase)


def test_a_history_starts_empty():
    assert State.of(load_small("soda_can"), "soda_can").history.past == History().past == ()
