"""Where a state's robots and object are drawn: joint values and the object's pose."""

from __future__ import annotations

from symgrasp.feasibility.cell import Cell
from symgrasp.plan.plan import PlanTask
from symgrasp.poses import Array
from symgrasp.reason import Reason

from ..state.plans.plan_results import HandsByHand
from ..state.state import State
from .playback import motion_state, plan_joint_values

__all__ = ["drawn_joint_values", "drawn_object_pose"]


def drawn_joint_values(state: State) -> dict[str, Array]:
    """Return the joint values that the robots of a state are drawn at.

    Those of the plan's motion where one is shown. Else robots park at home, except the arms that hold the
    object in the plan's task that is shown, or the chosen arm at the chosen candidate of the picked cell, if
    that is feasible, with the elbow where it was moved to, or its witness.

    Returns:
        Robot name → values (n,) of all its joints, in rad or m.
    """
    if moment := motion_state(state):
        return dict(moment.values)
    if state.shown_task and state.plan_results.by_hand:
        return _values_by_hand(state, state.shown_task, state.plan_results.by_hand)
    if state.shown_task:
        return plan_joint_values(state.scene, state.shown_task)
    values = {robot.name: robot.home.copy() for robot in state.scene.robots.values()}
    if state.climb_step and state.plan_results.climb:
        for name, cell in zip(state.plan_results.climb.arms, state.climb_step.cells, strict=True):
            arm = state.scene.arm(name)
            witness = state.plan_results.maps[state.task, name].map.witness(cell)
            if witness:
                q = arm.robot_values(witness.q, witness.opening)
                moved = q != arm.robot.home
                values[arm.robot.name][moved] = q[moved]
    elif state.shown_candidate and state.explanation:
        if state.shown_candidate.reason == Reason.FEASIBLE:
            arm = state.scene.arm(state.arm)
            assert state.shown_values is not None
            values[arm.robot.name] = arm.robot_values(state.shown_values, state.explanation.opening)
    elif state.is_current and state.map and state.cell and (witness := state.map.witness(state.cell)):
        arm = state.scene.arm(state.arm)
        values[arm.robot.name] = arm.robot_values(witness.q, witness.opening)
    return values


def drawn_object_pose(state: State) -> Array:
    """Return the pose (4, 4) that the object is drawn at; in a motion a hand may carry it."""
    moment = motion_state(state)
    return moment.T_world_object if moment else state.T_world_object


def _values_by_hand(state: State, task: PlanTask, by_hand: HandsByHand) -> dict[str, Array]:
    """Return the joint values where a person moved the hands: arms that cannot hold there are at home."""
    values = {robot.name: robot.home.copy() for robot in state.scene.robots.values()}
    grid = state.scene.manifold
    for hold, cell in zip(task.holds, by_hand.cells, strict=True):
        m = state.plan_results.maps[task.name, hold.arm].map.shift(task.delta)
        at = m.manifold.cell(float(grid.h[cell.row]), float(grid.theta[cell.column]))
        if witness := m.witness(Cell(cell.roll, *at)):
            arm = state.scene.arm(hold.arm)
            q = arm.robot_values(witness.q, witness.opening)
            moved = q != arm.robot.home
            values[arm.robot.name][moved] = q[moved]
    return values
