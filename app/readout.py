"""What the page says in words, and where it puts the arms: everything read off the state."""

from __future__ import annotations

from html import escape

import numpy as np

from app.state import State
from symgrasp.manifold import ROLLS
from symgrasp.poses import Array

__all__ = ["check_html", "grasp_html", "map_title", "notes_html", "plan_line", "postures", "status_html"]


def postures(state: State) -> dict[str, Array]:
    """Return robot name → values (n,) of all its joints.

    Robots park at home, except the arms that hold the object in the plan's task that is shown,
    or the chosen arm at the witness of the picked cell.
    """
    values = {robot.name: robot.home.copy() for robot in state.scene.robots.values()}
    if state.shown:
        for hold in state.shown.holds:
            names = state.scene.robots[hold.robot].model.joint_names
            for joint, value in (hold.joints | hold.hand_joints).items():
                values[hold.robot][names.index(joint)] = value
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
    check = state.looking.check
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
    place = _place(state.pick.h, state.pick.theta)
    if not state.is_fresh or state.map is None or state.cell is None:
        return f'<div class="sg"><b>{place}</b><br>waits for the map</div>'
    place += f", roll {np.rad2deg(ROLLS[state.cell.roll]):.0f}°"
    why = escape(state.map.why(state.cell))
    witness = state.map.witness(state.cell)
    if witness is None:
        return f'<div class="sg"><b>{place}</b><br>{escape(state.arm)} cannot hold it here: {why}</div>'
    margin = state.map.margin(state.cell)
    holds = state.shown.holds if state.shown else ()
    q = next((list(hold.joints.values()) for hold in holds if hold.arm == state.arm), witness.q)
    joints = ", ".join(f"{angle + 0.0:.0f}°" for angle in np.round(np.rad2deg(q)))
    return (
        f'<div class="sg"><b>{place}</b><br>{escape(state.arm)} holds it: {why}; '
        f"room for {100 * margin.along:.1f} cm along and {np.rad2deg(margin.around):.1f}° around"
        f"<br>Joints {joints}; fingers {100 * witness.opening:.1f} cm apart</div>"
    )


def status_html(state: State) -> str:
    """Say what to try and what is going on, in the same number of lines whatever it is."""
    thing = escape(state.scene.file.object.name)
    doing = "Ready."
    if state.busy and state.is_waiting:
        doing = f"{state.busy.label} … {100 * state.busy.share:.0f} %"
    elif not state.busy and not state.is_current:
        doing = "Stopped: no map for this pose yet."
    return (
        f'<div class="sg">Drag <b>Rotation</b>: the {thing} turns and its map slides along, with nothing '
        "computed anew. Then click a green cell to see the grasp.</div>"
        f'<div class="sg sg-faint sg-line">{escape(doing)}</div>'
    )


def notes_html(state: State) -> str:
    """Say what went wrong and what the object is inside of."""
    notes = [_note(state.problem, "error")] if state.problem else []
    return "".join(notes + [_note(contact, "warning") for contact in state.contacts])


def plan_line(state: State) -> str:
    """Sum the plan up in a line."""
    if state.plan is None:
        if state.can_plan("bimanual"):
            return ""
        return '<div class="sg sg-faint">Every task of this scene is for one arm.</div>'
    plan = state.plan.plan
    first = plan.tasks[0].holds
    if plan.kind == "sequential":
        grasp = first[0].grasp
        text = (
            f"One grasp for {_count(len(plan.tasks), 'task')}: {_place(grasp.h, grasp.theta)}, "
            f"roll {np.rad2deg(grasp.roll):.0f}°."
        )
    else:
        text = f"{len(first)} arms hold the object together in {plan.tasks[0].name}."
    return f'<div class="sg">{escape(text)}</div>'


def _place(h: float, theta: float) -> str:
    return f"h = {round(100 * h, 2):g} cm, θ = {round(np.rad2deg(theta), 2):g}°"


def _count(n: int, noun: str) -> str:
    return f"{n} {noun}" if n == 1 else f"{n} {noun}s"


def _note(text: str, kind: str) -> str:
    return f'<div class="sg sg-note sg-{kind}" role="alert">{escape(text)}</div>'
