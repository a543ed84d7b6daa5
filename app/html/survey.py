"""Surveys as HTML: how far one is, its heat map from above, and the best bases."""

from __future__ import annotations

from datetime import timedelta

import numpy as np

from symgrasp.feasibility.color_by import FEASIBLE, INFEASIBLE, NONE, SCALE
from symgrasp.survey.evaluation import State as PointState
from symgrasp.survey.placement import Base

from ..render.palette import INK, PICK
from ..render.survey_colors import place_colors
from ..state.state import State
from ..state.surveys.survey import Places
from .escaping import escape
from .readout import count_text

__all__ = ["places_html", "run_html", "stands_html"]

LABELS = {"share": ("feasible cells", "%"), "margin": ("largest margin", "mm"), "plan": ("", "")}

ARROW = 0.12
"""Length (m) of the arrow that shows where a base looks."""


def run_html(state: State) -> str:
    """Say how far the survey is, how fast, and how long it takes yet; or what went wrong."""
    survey = state.survey
    if survey.problem:
        return f'<div class="sg sg-note sg-error" role="alert">{escape(survey.problem)}</div>'
    run = survey.run
    if run is None:
        return ""
    if not run.points:
        return '<div class="sg sg-faint" role="status">Preparing …</div>'
    each = run.seconds / run.points
    left = timedelta(seconds=round(each * (run.of - run.points)))
    text = f"{run.label}: {run.points} of {run.of}, {1 / max(each, 1e-9):.1f} a second, {left} left"
    return f'<div class="sg sg-faint" role="status">{escape(text)}</div>'


def places_html(state: State) -> str:
    """Draw the places from above, x to the right, with the object, the robots and the best bases."""
    places = state.shown_places
    if places is None:
        text = ""
        if state.survey.places is not None:
            text = "The survey was of something else: try all places again."
        return f'<div class="sg sg-faint">{text}</div>' if text else ""
    survey = state.survey
    colors, high = place_colors(survey.value, survey.values)
    half = places.size.max() / 2
    low, far = places.xy.min(axis=0) - half, places.xy.max(axis=0) + half
    marks = np.array(
        [state.T_world_object[:2, 3], *(r.T_world_base[:2, 3] for r in state.scene.robots.values())]
    )
    low, far = np.minimum(low, marks.min(axis=0) - 0.05), np.maximum(far, marks.max(axis=0) + 0.05)
    width, height = far - low
    shapes = [_squares(places, colors), '<g pointer-events="none">']  # clicks are meant for the places
    for robot in state.scene.robots.values():
        shapes.append(_base(Base.of(robot.T_world_base), "currentColor"))
    for k, stand in enumerate(survey.stands, start=1):
        shapes.append(_base(stand.base, PICK, str(k)))
    x, y = state.T_world_object[:2, 3]
    radius = max(state.scene.profile.r_max, 0.012)
    shapes.append(
        f'<circle cx="{x:.4f}" cy="{-y:.4f}" r="{radius:.4f}" fill="#ffd24d" stroke="{INK}" '
        'stroke-width="0.004"><title>the object</title></circle></g>'
    )
    what = "places of the object" if survey.kind == "object" else f"bases of {state.robot.name}"
    label = f"heat map of {what} from above"
    click = "Click a place, here or in the 3D view, and the object goes there."
    if survey.kind == "robot":
        click = "Click a place, here or in the 3D view, or a ghost, and the robot goes there."
    return (
        f'<svg class="sg-places" role="img" aria-label="{escape(label)}" '
        f'viewBox="{low[0]:.4f} {-far[1]:.4f} {width:.4f} {height:.4f}">{"".join(shapes)}</svg>'
        f"{_legend(state, places, high)}"
        f'<div class="sg sg-faint">{click}</div>'
    )


def stands_html(state: State) -> str:
    """List the best bases."""
    if state.survey.kind != "robot" or state.shown_places is None:
        return ""
    rows = []
    for k, stand in enumerate(state.survey.stands, start=1):
        x, y, _, yaw = stand.base
        rows.append(
            f"<tr><td>{k}</td><td>{100 * x:.0f}</td><td>{100 * y:.0f}</td><td>{yaw:.0f}°</td>"
            f"<td>{1e3 * stand.margin:.1f} mm</td></tr>"
        )
    if not rows:
        return ""
    head = "<tr><th>base</th><th>x (cm)</th><th>y (cm)</th><th>turn</th><th>margin</th></tr>"
    return (
        f'<table class="sg sg-table">{head}{"".join(rows)}</table>'
        '<div class="sg sg-faint">Planned and verified from each of them.</div>'
    )


def _squares(places: Places, colors: np.ndarray) -> str:
    """Draw the places, the smaller ones over the larger."""
    parts = []
    for k in np.argsort(-places.size, kind="stable"):
        (x, y), size = places.xy[k], 0.96 * places.size[k]
        r, g, b = colors[k].tolist()
        parts.append(
            f'<rect x="{x - size / 2:.4f}" y="{-y - size / 2:.4f}" width="{size:.4f}" height="{size:.4f}" '
            f'fill="#{r:02x}{g:02x}{b:02x}" data-place="{k}"/>'
        )
    return "".join(parts)


def _base(base: Base, color: str, text: str = "") -> str:
    """Draw a base as an arrow along its x axis, with a text beside it."""
    yaw = np.deg2rad(base.yaw_deg)
    end = base.x + ARROW * np.cos(yaw), base.y + ARROW * np.sin(yaw)
    label = (
        f'<text x="{base.x + 0.03:.4f}" y="{0.1 - base.y:.4f}" font-size="0.09" fill="{color}">{text}</text>'
    )
    return (
        f'<line x1="{base.x:.4f}" y1="{-base.y:.4f}" x2="{end[0]:.4f}" y2="{-end[1]:.4f}" '
        f'stroke="{color}" stroke-width="0.012"/>'
        f'<circle cx="{base.x:.4f}" cy="{-base.y:.4f}" r="0.025" fill="{color}"/>{label if text else ""}'
    )


def _legend(state: State, places: Places, high: float) -> str:
    """Say what the colours stand for, and what became of places without a value."""
    survey = state.survey
    values = survey.values
    rows = []
    if survey.value == "plan":
        found = int((values > 0).sum())
        rows.append(_swatch(FEASIBLE, f"a plan for all tasks: {count_text(found, 'place')}"))
        rows.append(_swatch(INFEASIBLE, f"none: {count_text(int((values == 0).sum()), 'place')}"))
    else:
        name, unit = LABELS[survey.value]
        stops = ", ".join(f"rgb{tuple(color)}" for color in SCALE.tolist())
        rows.append(
            f'<div class="sg-ramp"><span>{name} ({unit})</span><span>0</span>'
            f'<i style="background:linear-gradient(to right, {stops})"></i><span>{high:.3g}</span></div>'
        )
    blocked = {
        PointState.OBJECT_BLOCKED: "the object would be inside something",
        PointState.ROBOT_BLOCKED: "the robot would stand in something",
        PointState.UNUSABLE: "the scene cannot be built",
    }
    for state_, text in blocked.items():
        count = int((places.state == state_).sum())
        if count:
            rows.append(_swatch(NONE, f"{text}: {count_text(count, 'place')}"))
    return f'<div class="sg sg-what-colors">{"".join(rows)}</div>'


def _swatch(color: tuple[int, int, int], text: str) -> str:
    r, g, b = color
    return f'<div><i style="background:#{r:02x}{g:02x}{b:02x}"></i>{escape(text)}</div>'
