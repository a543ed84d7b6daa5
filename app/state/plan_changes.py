"""Changes of what is shown of plans: which of them, which task, which step of a climb, what is played."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from .plan_results import PlanResult, PlanResults
from .state import Pick, State

__all__ = [
    "change_plan_results",
    "choose_plan",
    "more_listed",
    "play_arms",
    "play_climb",
    "played",
    "show_frame",
    "show_position",
    "show_results",
    "show_step",
]


def show_results(state: State, results: PlanResults) -> State:
    """Take what a planner found, and show the first task of its first plan."""
    return show_step(replace(state, plan_results=results, step=None, pick=None), 0)


def more_listed(state: State, plans: tuple[PlanResult, ...], more: bool) -> State:
    """Take further plans of the list, and show the first of them."""
    after = replace(state, plan_results=state.plan_results.extended(plans, more=more))
    return choose_plan(after, len(state.plan_results.plans)) if plans else after


def change_plan_results(state: State, change: Callable[[PlanResults], PlanResults]) -> State:
    """Change what is chosen or shown of plans, if that is all that changes."""
    results = change(state.plan_results)
    return state if results is state.plan_results else replace(state, plan_results=results)


def choose_plan(state: State, index: int) -> State:
    """Show another plan of the list, at the same task."""
    step = state.step or 0
    return show_step(replace(state, plan_results=state.plan_results.at_plan(index)), step)


def show_step(state: State, step: int) -> State:
    """Show a task of the plan: the object turned by δᵢ and the grasp on its map."""
    return show_position(state, step)


def show_position(state: State, position: float) -> State:
    """Show the plan at a position of the playback: the task nearest to it, the arms maybe between two."""
    if state.plan is None:
        return state
    results = state.plan_results.at_position(position)
    step = results.nearest
    task = state.plan.plan.tasks[step]
    hold = next((h for h in task.holds if h.arm == state.arm), task.holds[0])
    pick = Pick(hold.grasp.h, hold.grasp.theta, 0 if np.cos(hold.grasp.roll) > 0 else 1)
    return replace(
        state,
        plan_results=results,
        step=step,
        task=task.name,
        arm=hold.arm,
        delta=task.delta,
        pick=pick,
        map_view=state.map_view.for_another_cell(),
        result=results.maps[task.name, hold.arm],
        problem="",
    )


def show_frame(state: State, frame: int) -> State:
    """Show a step of the hill climbing: the hands on the maps as they were computed."""
    climb = state.plan_results.climb
    if climb is None:
        return state
    arm = state.arm if state.arm in climb.arms else climb.arms[0]
    return replace(
        state,
        plan_results=state.plan_results.at_frame(frame),
        step=None,
        task=climb.task,
        arm=arm,
        delta=0.0,
        pick=None,
        result=state.plan_results.maps[climb.task, arm],
        problem="",
    )


def play_arms(state: State) -> State:
    """Start or stop playing the plan."""
    return _shown(replace(state, plan_results=state.plan_results.play_arms()))


def play_climb(state: State) -> State:
    """Start or stop the replay of the hill climbing."""
    return _shown(replace(state, plan_results=state.plan_results.play_climb()))


def played(state: State, seconds: float) -> State:
    """Let what is played go on; it stops where the person has moved on to something else."""
    playing = state.plan_results.playing
    if not playing:
        return state
    if (state.step if playing == "arms" else state.climb_step) is None:
        return change_plan_results(state, PlanResults.paused)
    return _shown(replace(state, plan_results=state.plan_results.advanced(seconds)))


def _shown(state: State) -> State:
    """Show the step of the climb or the position of the playback that the plan results are at."""
    results = state.plan_results
    if results.playing == "climb" or results.frame is not None:
        return show_frame(state, results.frame or 0)
    return show_position(state, results.position)
