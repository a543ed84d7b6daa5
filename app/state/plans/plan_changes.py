"""Changes of what is shown of plans: which plan, task or step of a climb, and the playback."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from symgrasp.feasibility.cell import Cell
from symgrasp.motion.record import from_plan
from symgrasp.object.manifold import ROLLS
from symgrasp.plan.plan import Plan

from ..state import Pick, State
from .plan_results import HandsByHand, PlanResult, PlanResults

__all__ = [
    "as_planned",
    "change_plan_results",
    "choose_plan",
    "choose_speed",
    "hand_cells",
    "more_listed",
    "motion_found",
    "move_hand",
    "play_arms",
    "play_climb",
    "played",
    "show_frame",
    "show_position",
    "show_results",
    "show_step",
    "slide_map",
    "sort_solutions",
]


def show_results(state: State, results: PlanResults) -> State:
    """Store the results of a planner, and show the first task of its first plan."""
    return show_step(replace(state, plan_results=results, step=None, pick=None), 0)


def more_listed(state: State, plans: tuple[PlanResult, ...], more: bool) -> State:
    """Add further plans to the list; the one that is shown stays."""
    return replace(state, plan_results=state.plan_results.extended(plans, more=more))


def sort_solutions(state: State, column: str) -> State:
    """Sort the list of plans by a column, or the other way round if it is already; see `SolutionOrder`."""
    results = state.plan_results
    return replace(state, plan_results=replace(results, order=results.order.clicked(column)))


def change_plan_results(state: State, change: Callable[[PlanResults], PlanResults]) -> State:
    """Change the plan results and nothing else."""
    results = change(state.plan_results)
    return state if results is state.plan_results else replace(state, plan_results=results)


def choose_plan(state: State, index: int) -> State:
    """Show another plan of the list by its index, at the same task."""
    step = state.step or 0
    return show_step(replace(state, plan_results=state.plan_results.at_plan(index)), step)


def show_step(state: State, step: int) -> State:
    """Show a task of the plan by its index: the object turned by δᵢ and the grasp on its map."""
    return show_position(state, state.plan_results.position_of(step)) if state.plan else state


def show_position(state: State, position: float) -> State:
    """Show the plan at a position of the playback (see `PlanResults`) and the task nearest to it."""
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


def slide_map(state: State, k: int, delta: float) -> State:
    """Slide the map of the k-th task by δ (rad), by hand: the object of that task is turned by it."""
    results = state.plan_results
    after = show_step(state, k)
    if state.plan is None:  # maps without a common grasp
        names = [task for task, _ in results.maps]
        after = replace(state, task=names[k], arm=[arm for _, arm in results.maps][k], step=None)
    turns = {**results.turns, k: delta}
    return replace(
        after, delta=delta, step=None, plan_results=replace(after.plan_results, turns=turns, playing="")
    )


def hand_cells(state: State, k: int) -> tuple[Cell, ...]:
    """Return where the hands of the k-th task of a plan are, over the grid in the object's frame."""
    results, grid = state.plan_results, state.scene.manifold
    if results.by_hand and results.by_hand.step == k:
        return results.by_hand.cells
    if state.climb_step and state.plan and state.plan.plan.tasks[k].name == state.task:
        return state.climb_step.cells
    holds = state.plan.plan.tasks[k].holds if state.plan else ()
    return tuple(
        Cell(ROLLS.index(hold.grasp.roll), *grid.cell(hold.grasp.h, hold.grasp.theta)) for hold in holds
    )


def move_hand(state: State, k: int, hand: int, row: int, column: int) -> State:
    """Move a hand of the k-th task of a plan to a cell of the grid in the object's frame, by hand."""
    cells = list(hand_cells(state, k))
    cells[hand] = Cell(cells[hand].roll, row, column)
    after = show_step(state, k)
    if after.plan is None:
        return state
    grid, name = state.scene.manifold, after.plan.plan.tasks[k].holds[hand].arm
    pick = Pick(float(grid.h[row]), float(grid.theta[column]), cells[hand].roll)
    results = replace(after.plan_results, by_hand=HandsByHand(k, tuple(cells)), playing="")
    result = results.maps[after.task, name]
    return replace(after, plan_results=results, pick=pick, arm=name, result=result)


def as_planned(state: State) -> State:
    """Put maps and hands that a person moved back to where the plan has them."""
    after = change_plan_results(state, PlanResults.as_planned)
    return show_step(after, after.plan_results.nearest)


def motion_found(
    state: State,
    index: int,
    plan: Plan,
    motionless: tuple[str, ...] = (),
    listed: tuple[PlanResult, ...] = (),
) -> State:
    """Show a plan of the list with the motion that was found for it; see `PlanResults.with_motion`.

    Args:
        state: the state.
        index: of the plan in the list, with further plans at its end.
        plan: the plan with its motion.
        motionless: why plans that were tried before have none.
        listed: the further plans.
    """
    if listed:
        results = state.plan_results
        state = replace(state, plan_results=results.extended(listed, more=results.more))
    if index >= len(state.plan_results.plans):
        return state
    old = state.plan_results.plans[index]
    found = replace(old, plan=plan, motion=from_plan(plan, state.scene))
    return show_position(
        replace(state, plan_results=state.plan_results.with_motion(index, found, motionless)), 0.0
    )


def choose_speed(state: State, speed: float) -> State:
    """Play motions at a speed: seconds of a motion in a second."""
    return replace(state, plan_results=replace(state.plan_results, speed=speed))


def show_frame(state: State, frame: int) -> State:
    """Show a step of the hill climbing by its index: the hands on the maps at δ = 0."""
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
    """Start or pause the playback of the plan."""
    return _shown(replace(state, plan_results=state.plan_results.play_arms()))


def play_climb(state: State) -> State:
    """Start or pause the replay of the hill climbing."""
    return _shown(replace(state, plan_results=state.plan_results.play_climb()))


def played(state: State, seconds: float) -> State:
    """Advance what is played by a time (s); pause it if something else is shown by now."""
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
