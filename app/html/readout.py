"""What the page says in words, and where it puts the arms: everything read off the state."""

from __future__ import annotations

from html import escape

import numpy as np

from symgrasp.object.manifold import ROLLS
from symgrasp.poses import Array
from symgrasp.reason import Reason

from ..render.playback import plan_joint_values, playback_frame
from ..state.state import State

__all__ = [
    "check_html",
    "counted",
    "grasp_html",
    "hands_line",
    "joint_values",
    "map_title",
    "notes_html",
    "sequence_html",
    "solution_html",
    "status_html",
    "tasks_html",
]


def joint_values(state: State) -> dict[str, Array]:
    """Return robot name → values (n,) of all its joints.

    Robots park at home, except the arms that hold the object in the plan's task that is shown,
    or the chosen arm at the chosen candidate of the picked cell, if that is feasible, or its witness.
    """
    if frame := playback_frame(state):
        return frame.joint_values
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
            values[arm.robot.name] = arm.robot_values(state.shown_candidate.q, state.explanation.opening)
    elif state.is_current and state.map and state.cell and (witness := state.map.witness(state.cell)):
        arm = state.scene.arm(state.arm)
        values[arm.robot.name] = arm.robot_values(witness.q, witness.opening)
    return values


def map_title(state: State) -> str:
    """Name the map that is shown."""
    names = f"{escape(state.scene.name)} · {escape(state.task)} · {escape(state.arm)}"
    age = "" if state.is_fresh or not state.result else " — of an earlier pose"
    busy = "false" if state.is_current and not state.busy else "true"
    return f'<div class="sg sg-title" aria-busy="{busy}">{names}{age}</div>'


def check_html(state: State) -> str:
    """Say how many cells of the shifted map, drawn above this line, differ from the one drawn below it."""
    check = state.map_view.comparison
    if check is None:
        return '<div class="sg sg-faint">The map is being computed from scratch …</div>'
    turn, cells = np.rad2deg(check.request.delta), check.map.reason.size
    return (
        f'<div class="sg sg-check" role="status">Above: shifted. Below: from scratch for {turn:.2f}°: '
        f"<b>{check.differing} of {cells} cells differ.</b></div>"
    )


def grasp_html(state: State) -> str:
    """Say how the picked grasp is held, or why it cannot be."""
    if state.pick is None:
        text = "No grasp picked: click a cell on the object or on the map beside it, or enter h and θ."
        return f'<div class="sg sg-faint">{text}</div>'
    where = _place(state.pick.h, state.pick.theta)
    if not state.is_fresh or state.map is None or state.cell is None:
        return f'<div class="sg"><b>{where}</b><br>waits for the map</div>'
    where += f", roll {np.rad2deg(ROLLS[state.cell.roll]):.0f}°"
    why = escape(state.map.why(state.cell))
    witness = state.map.witness(state.cell)
    if witness is None and state.explanation and state.shown_candidate:
        best = "The best" if state.candidate == 0 else "One"
        ways = counted(len(state.explanation.candidates), "way")
        return (
            f'<div class="sg"><b>{where}</b><br>{escape(state.arm)} cannot hold it here: '
            f"{escape(state.explanation.reason.label)}. {best} of {ways} to try is the ghost.</div>"
        )
    if witness is None:
        return f'<div class="sg"><b>{where}</b><br>{escape(state.arm)} cannot hold it here: {why}</div>'
    margin = state.map.margin(state.cell)
    holds = state.shown_task.holds if state.shown_task else ()
    q = next((list(hold.joints.values()) for hold in holds if hold.arm == state.arm), witness.q)
    joints = ", ".join(f"{angle + 0.0:.0f}°" for angle in np.round(np.rad2deg(q)))
    return (
        f'<div class="sg"><b>{where}</b><br>{escape(state.arm)} holds it: {why}; '
        f"room for {100 * margin.along:.1f} cm along and {np.rad2deg(margin.around):.1f}° around"
        f"<br>Joints {joints}; fingers {100 * witness.opening:.1f} cm apart</div>"
    )


def status_html(state: State) -> str:
    """Say what to try and what is going on, in the same number of lines whatever it is."""
    name = escape(state.scene.file.object.name)
    doing = "Ready."
    if state.busy and state.is_waiting:
        doing = f"{state.busy.label} … {100 * state.busy.share:.0f} %"
        if state.busy.compiling:
            doing = "Compiling, once on this machine: a minute …"
    elif state.is_stopped:
        doing = "Stopped." if state.is_current else "Stopped: no map for this pose yet."
    return (
        f'<div class="sg">Drag <b>Rotation</b>: the {name} turns and its map slides along, with nothing '
        "computed anew. Then click a green cell to see the grasp.</div>"
        f'<div class="sg sg-faint sg-line">{escape(doing)}</div>'
    )


def notes_html(state: State) -> str:
    """Say what went wrong and what the object is inside of."""
    notes = [_note(state.problem, "error")] if state.problem else []
    return "".join(notes + [_note(contact, "warning") for contact in state.contacts])


def sequence_html(state: State) -> str:
    """Say what the sequential planner plans."""
    names = [task.name for task in state.scene.tasks.values() if task.arms == (state.arm,)]
    if not names:
        text = f"{state.arm} does no task alone: the tab Hands plans for several arms."
        return f'<div class="sg sg-faint">{escape(text)}</div>'
    what = f'<div class="sg sg-what">{escape(state.arm)}: {escape(" → ".join(names))}</div>'
    return what + _until_planned(
        state, "Slides the tasks' maps over each other until one grasp is feasible in all of them."
    )


def hands_line(state: State) -> str:
    """Say what the planner for several arms plans."""
    if not state.can_plan("bimanual"):
        return '<div class="sg sg-faint">Every task of this scene is for one arm.</div>'
    task = state.scene.task(state.bimanual_task)
    what = f'<div class="sg sg-what">{escape(task.name)}: {escape(" and ".join(task.arms))}</div>'
    return what + _until_planned(
        state, "Every hand leaves a print on the map: places the hands so that they do not meet."
    )


def _until_planned(state: State, text: str) -> str:
    """Say what a planner does, until it has been tried."""
    return "" if state.plan_results.kind else f'<div class="sg sg-faint">{escape(text)}</div>'


def tasks_html(state: State) -> str:
    """List the tasks in their order, the chosen one marked."""
    rows = []
    for k, task in enumerate(state.scene.tasks.values(), start=1):
        now = ' class="sg-now"' if task.name == state.task else ""
        rows.append(
            f"<div{now}>{k} · {escape(task.name)} <small>{escape(', '.join(task.arms))}</small></div>"
        )
    return f'<div class="sg sg-tasks">{"".join(rows)}</div>'


def solution_html(state: State) -> str:
    """Sum the plan that is shown up in a line."""
    if state.plan is None:
        return ""
    plan = state.plan.plan
    first = plan.tasks[0].holds
    grasps = len({(hold.arm, hold.grasp) for task in plan.tasks for hold in task.holds})
    if plan.kind == "handover":
        text = f"Handed over in {counted(len(plan.tasks), 'task')} with {counted(grasps, 'grasp')}."
    elif plan.kind == "bimanual":
        text = f"{len(first)} arms hold the object together in {plan.tasks[0].name}."
    elif grasps > 1:
        text = f"{counted(grasps, 'grasp')}, the object set down in between."
    else:
        grasp = first[0].grasp
        text = (
            f"One grasp for {counted(len(plan.tasks), 'task')}: {_place(grasp.h, grasp.theta)}, "
            f"roll {np.rad2deg(grasp.roll):.0f}°."
        )
    return f'<div class="sg">{escape(text)}</div>'


def _place(h: float, theta: float) -> str:
    return f"h = {round(100 * h, 2):g} cm, θ = {round(np.rad2deg(theta), 2):g}°"


def counted(n: int, noun: str) -> str:
    """Say how many there are."""
    return f"{n} {noun}" if n == 1 else f"{n} {noun}s"


def _note(text: str, kind: str) -> str:
    return f'<div class="sg sg-note sg-{kind}" role="alert">{escape(text)}</div>'
