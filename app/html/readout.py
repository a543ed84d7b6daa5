"""What the page says in words about a state, as HTML."""

from __future__ import annotations

import numpy as np

from symgrasp.object.manifold import ROLLS, turn_text
from symgrasp.plan.plan import Grasp
from symgrasp.survey.success import CONFIDENCE, interval

from ..state.state import State
from .escaping import escape
from .hint import hint_html

__all__ = [
    "bimanual_html",
    "comparison_html",
    "count_text",
    "grasp_html",
    "notes_html",
    "pitch_text",
    "scene_notes_html",
    "sequence_html",
    "solution_html",
    "status_html",
    "tasks_html",
]


def comparison_html(state: State) -> str:
    """Say how many cells of the shifted map differ from the recomputed map, which is drawn below."""
    comparison = state.map_view.comparison
    if comparison is None:
        return '<div class="sg sg-faint">The map is being computed from scratch …</div>'
    turn, cells = turn_text(comparison.request.delta), comparison.map.reason.size
    rolls, heights, angles = comparison.map.reason.shape
    return (
        f'<div class="sg sg-check" role="status">Below: from scratch for {turn}: '
        f"<b>{comparison.differing} of {cells} cells differ</b>: {heights * angles} places "
        f"with {rolls} rolls each.</div>"
    )


def grasp_html(state: State) -> str:
    """Say how the picked grasp is held, or why it cannot be."""
    if state.pick is None:
        text = "No grasp picked: click a cell on the object or on the map beside it, or enter h and θ."
        return f'<div class="sg sg-faint">{text}</div>'
    where = _position_text(state.pick.h, state.pick.theta)
    if not state.is_fresh or state.map is None or state.cell is None:
        return f'<div class="sg"><b>{where}</b><br>waits for the map</div>'
    where += f", roll {np.rad2deg(ROLLS[state.cell.roll]):.0f}°"
    why = ", ".join(filter(None, [escape(state.map.why(state.cell)), state.map.holds(state.cell)]))
    where += _probability_text(state)
    witness = state.map.witness(state.cell)
    rests_on = f"<br>Rests on {escape(state.map.rests_on(state.cell))}."
    if witness is None and state.explanation and state.shown_candidate:
        best = "The best" if state.candidate == 0 else "One"
        ways = count_text(len(state.explanation.candidates), "way")
        return (
            f'<div class="sg"><b>{where}</b><br>{escape(state.arm)} cannot hold it here: '
            f"{escape(state.explanation.reason.label)}. {best} of {ways} to try is the ghost.{rests_on}</div>"
        )
    if witness is None:
        cannot = f"{escape(state.arm)} cannot hold it here: {why}.{rests_on}"
        return f'<div class="sg"><b>{where}</b><br>{cannot}</div>'
    margin = state.map.margin(state.cell)
    least = "" if state.map.refined is None else "at least "
    holds = state.shown_task.holds if state.shown_task else ()
    hold = next((hold for hold in holds if hold.arm == state.arm), None)
    arm = state.scene.arm(state.arm)
    q = list(hold.joints.values()) if hold else witness.q[: len(arm.joint_names)].tolist()
    joints = ", ".join(f"{angle + 0.0:.0f}°" for angle in np.round(np.rad2deg(q)))
    if arm.pitched:
        pitch = hold.grasp.pitch if hold else arm.pitch_and_azimuth(witness.q, state.cell.roll)[0]
        joints += f"; hand pitched by {np.round(np.rad2deg(pitch)) + 0.0:.0f}°"
    return (
        f'<div class="sg"><b>{where}</b><br>{escape(state.arm)} holds it: {why}; '
        f"room for {least}{100 * margin.along:.1f} cm along and {np.rad2deg(margin.around):.1f}° around"
        f"<br>Joints {joints}; fingers {100 * witness.opening:.1f} cm apart</div>"
    )


def _probability_text(state: State) -> str:
    """Say how probable the picked grasp is, and how far the draws tell; nothing where that is not known."""
    found = state.probability
    if found is None or state.base_cell is None:
        return ""
    count = int(found.feasible[state.base_cell])
    low, high = interval([count], found.draws)
    of = f"{100 * low:.0f} to {100 * high:.0f} % at {100 * CONFIDENCE:.0f} % confidence"
    return f", feasible at {count} of {found.draws} poses ({of})"


def status_html(state: State) -> str:
    """Say what to try and what is being computed, always in the same number of lines."""
    doing = "Ready."
    if state.busy and state.is_waiting:
        share = f"{100 * state.busy.share:.0f} %"
        doing = f"{state.busy.label} … {'done, to be shown' if share == '100 %' else share}"
        if state.busy.compiling:
            doing = "Compiling, once on this machine: half a minute …"
            if state.is_preliminary:
                coarse = state.result is not None and state.result.map.preliminary
                doing = f"Compiling once; this map is {'coarse' if coarse else 'preliminary'} …"
        elif state.busy.waiting:
            doing = f"{state.busy.label} … when other browsers have had their turn"
    elif state.is_stopped:
        doing = "Stopped." if state.is_current else "Stopped: no map for this pose yet."
    return f'<div class="sg">{hint_html(state)}</div><div class="sg sg-faint sg-line">{escape(doing)}</div>'


def notes_html(state: State) -> str:
    """Show the last problem and the obstacles that the object is inside of."""
    notes = [_note(state.problem, "error")] if state.problem else []
    return "".join(notes + [_note(contact, "warning") for contact in state.contacts])


def scene_notes_html(state: State) -> str:
    """Show what the scene's file does not say and was guessed."""
    notes = "".join(f"<li>{escape(note)}</li>" for note in state.scene.notes)
    return (
        f'<div class="sg sg-note sg-guessed" role="note">Not in the scene file:<ul>{notes}</ul></div>'
        if notes
        else ""
    )


def sequence_html(state: State) -> str:
    """Say which tasks the sequential planner plans for, and until it was run what it does."""
    names = [task.name for task in state.scene.tasks.values() if task.arms == (state.arm,)]
    if not names:
        text = f"{state.arm} does no task alone: the tab Hands plans for several arms."
        return f'<div class="sg sg-faint">{escape(text)}</div>'
    what = f'<div class="sg sg-what">{escape(state.arm)}: {escape(" → ".join(names))}</div>'
    return what + _until_planned(
        state, "Slides the tasks' maps over each other until one grasp is feasible in all of them."
    )


def bimanual_html(state: State) -> str:
    """Say which task the bimanual planner plans for, and until it was run what it does."""
    if not state.can_plan("bimanual"):
        return '<div class="sg sg-faint">Every task of this scene is for one arm.</div>'
    task = state.scene.task(state.bimanual_task)
    what = f'<div class="sg sg-what">{escape(task.name)}: {escape(" and ".join(task.arms))}</div>'
    return what + _until_planned(
        state, "Every hand leaves a print on the map: places the hands so that they do not meet."
    )


def _until_planned(state: State, text: str) -> str:
    """Show a text as long as no planner has been run."""
    return "" if state.plan_results.kind else f'<div class="sg sg-faint">{escape(text)}</div>'


def tasks_html(state: State) -> str:
    """List the tasks in their order, the chosen one marked."""
    rows = []
    for k, task in enumerate(state.scene.tasks.values(), start=1):
        now = ' class="sg-now"' if task.name == state.task else ""
        rows.append(
            f"<div{now}>{k} · {escape(task.name)} <small>{escape(', '.join(task.arms))}</small></div>"
        )
    where = f"A new task comes after {state.task}, the chosen one."
    return f'<div class="sg sg-tasks">{"".join(rows)}<small>{escape(where)}</small></div>'


def solution_html(state: State) -> str:
    """Summarize the plan that is shown in one sentence."""
    if state.plan is None:
        return ""
    plan = state.plan.plan
    first = plan.tasks[0].holds
    grasps = len({(hold.arm, hold.grasp) for task in plan.tasks for hold in task.holds})
    if plan.kind == "handover":
        text = f"Handed over in {count_text(len(plan.tasks), 'task')} with {count_text(grasps, 'grasp')}."
    elif plan.kind == "bimanual":
        text = f"{len(first)} arms hold the object together in {plan.tasks[0].name}."
    elif grasps > 1:
        text = f"{count_text(grasps, 'grasp')}, the object set down in between."
    else:
        grasp = first[0].grasp
        text = (
            f"One grasp for {count_text(len(plan.tasks), 'task')}: {_position_text(grasp.h, grasp.theta)}, "
            f"roll {np.rad2deg(grasp.roll):.0f}°{pitch_text(grasp)}."
        )
    return f'<div class="sg">{escape(text)}</div>'


def pitch_text(grasp: Grasp) -> str:
    """Return ", pitch 20°" for a grasp with a pitch, nothing for one without."""
    return f", pitch {np.rad2deg(grasp.pitch):.0f}°" if grasp.pitch else ""


def _position_text(h: float, theta: float) -> str:
    return f"h = {round(100 * h, 2):g} cm, θ = {round(np.rad2deg(theta), 2):g}°"


def count_text(n: int, noun: str) -> str:
    """Return a count with its noun, in the plural unless it is one."""
    return f"{n} {noun}" if n == 1 else f"{n} {noun}s"


def _note(text: str, kind: str) -> str:
    return f'<div class="sg sg-note sg-{kind}" role="alert">{escape(text)}</div>'
