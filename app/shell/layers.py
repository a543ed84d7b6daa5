"""The maps that the page stacks below the main one: of tasks of a sequence, of several hands, of both rolls.

Each is drawn by the same element as the main map. What a drag of one does depends on its `LayerKind`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import groupby

import numpy as np

from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.object.manifold import ROLLS
from symgrasp.plan.plan import Grasp
from symgrasp.reason import Reason

from ..render.marks import Mark, hand_marks, marks_of
from ..render.prints import shown_prints, task_prints
from ..state.map_view_state import RollChoice
from ..state.plans.plan_changes import hand_cells
from ..state.state import State

__all__ = ["Layer", "LayerKind", "layers_of"]


class LayerKind(StrEnum):
    """What a map of the stack is of."""

    ROLL = "roll"
    """One roll of the main map: a drag turns the object."""
    TASK = "task"
    """A task of a sequence: a drag slides it by the task's δ."""
    HAND = "hand"
    """A hand of a plan's task: a drag moves the print under the pointer."""


@dataclass(frozen=True, eq=False)
class Layer:
    """A map of the stack.

    Attributes:
        kind: what it is of.
        title: what is written over it.
        map: the map at δ = 0.
        roll: the rolls that it shows.
        turn: the angle (rad) by which it is shifted.
        marks: grasps to circle, in the frame of the turned object.
        prints: cells (H, A) under each hand of its task, in that frame.
        step: index of its task in the plan, or among the maps that the planner used in vain.
        hand: index of its hand among those of the task.
        group: layers of one kind with the same number have one grasp; only cells that all of them share can
            serve it.
        is_shown: whether its task is the one that is shown.
        planned: the angle of the plan, where it is another.
    """

    kind: LayerKind
    title: str
    map: FeasibilityMap
    roll: RollChoice
    turn: float
    marks: Sequence[Mark] = ()
    prints: Sequence[np.ndarray] = ()
    step: int = 0
    hand: int = 0
    group: int = 0
    is_shown: bool = False
    planned: float | None = None


def layers_of(state: State) -> list[Layer]:
    """Return the maps of the stack, from top to bottom."""
    layers = []
    if state.map_view.rolls_apart and state.result:
        layers += [
            Layer(LayerKind.ROLL, f"roll {roll.value}", state.result.map, roll, state.delta, marks_of(state))
            for roll in (RollChoice.ZERO, RollChoice.HALF_TURN)
        ]
    results = state.plan_results
    if results.kind == "sequential":
        return layers + (_of_tasks(state) if state.plan else _without_plan(state))
    if state.climb_step:
        return layers + _of_climb(state)
    return layers + (_of_hands(state) if state.plan else [])


def _of_tasks(state: State) -> list[Layer]:
    """Return the maps of a sequence: tasks with the same grasp, until the object is set down, are a group."""
    results, layers = state.plan_results, []
    if state.plan is None:
        return []
    tasks = list(enumerate(state.plan.plan.tasks))
    for group, (_, steps) in enumerate(groupby(tasks, lambda step: step[1].holds[0].grasp)):
        for k, task in steps:
            hold, turn = task.holds[0], results.turn(k)
            layers.append(
                Layer(
                    LayerKind.TASK,
                    f"{k + 1} · {task.name}",
                    results.maps[task.name, hold.arm].map,
                    _roll(hold.grasp),
                    turn,
                    [Mark(hold.grasp.h, hold.grasp.theta)],
                    step=k,
                    group=group,
                    is_shown=state.task == task.name,
                    planned=task.delta if k in results.turns else None,
                )
            )
    return layers


def _without_plan(state: State) -> list[Layer]:
    """Return the maps that the planner used although no grasp serves all of them."""
    results = state.plan_results
    return [
        Layer(
            LayerKind.TASK,
            f"{k + 1} · {task}",
            result.map,
            RollChoice.EITHER,
            results.turn(k),
            step=k,
            is_shown=state.task == task,
            planned=0.0 if k in results.turns else None,
        )
        for k, ((task, _), result) in enumerate(results.maps.items())
    ]


def _of_hands(state: State) -> list[Layer]:
    """Return the maps of the hands of all tasks of a plan, each with the prints of all hands of its task."""
    results, layers = state.plan_results, []
    if state.plan is None:
        return []
    several = len(state.plan.plan.tasks) > 1
    for k, task in enumerate(state.plan.plan.tasks):
        marks, prints, cells = hand_marks(state, k), task_prints(state, k), hand_cells(state, k)
        for i, (hold, cell) in enumerate(zip(task.holds, cells, strict=True)):
            m, roll = results.maps[task.name, hold.arm].map, _roll(hold.grasp)
            at = m.shift(task.delta).manifold.cell(marks[i].h, marks[i].theta)
            reason = Reason(int(m.shift(task.delta).reason[cell.roll][at]))
            name = f"{k + 1} · {task.name}: " if several else ""
            title = f"{name}{hold.arm}, roll {roll.value}: {reason.label}"
            shown = state.step == k
            layers.append(
                Layer(LayerKind.HAND, title, m, roll, task.delta, marks, prints, k, i, k, shown, None)
            )
    return layers


def _of_climb(state: State) -> list[Layer]:
    """Return the maps of the hands at a step of the hill climbing."""
    climb, step, grid = state.plan_results.climb, state.climb_step, state.scene.manifold
    if climb is None or step is None:
        return []
    marks = [
        Mark(float(grid.h[cell.row]), float(grid.theta[cell.column]), name)
        for name, cell in zip(climb.arms, step.cells, strict=True)
    ]
    prints = shown_prints(state)
    return [
        Layer(
            LayerKind.HAND,
            f"{name}, roll {_ROLLS[cell.roll].value}",
            state.plan_results.maps[climb.task, name].map,
            _ROLLS[cell.roll],
            0.0,
            marks,
            prints,
            hand=i,
            is_shown=True,
        )
        for i, (name, cell) in enumerate(zip(climb.arms, step.cells, strict=True))
    ]


_ROLLS = (RollChoice.ZERO, RollChoice.HALF_TURN)


def _roll(grasp: Grasp) -> RollChoice:
    return _ROLLS[ROLLS.index(grasp.roll)]
