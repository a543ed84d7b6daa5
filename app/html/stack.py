"""The maps of a sequence below each other, each shifted by its task's δ: figure 6 of the paper."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from itertools import groupby

import numpy as np

from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.object.manifold import ROLLS, wrap
from symgrasp.plan.plan import CLEARANCE_LIMIT, Grasp, Hold, PlanTask
from symgrasp.reason import Reason

from ..render.marks import Mark
from ..render.palette import INK, REASONS, rgb
from ..render.weak_cache import cached_with_first
from ..state.requests import MapResult
from ..state.state import State
from .escaping import escape
from .map import THETA_AXIS, circle, h_axis, sample_columns, to_png
from .readout import pitch_text

__all__ = ["margin_texts", "shared_columns", "stack_html"]

TOTAL_HEIGHT = 300
"""Height (px) that all strips share."""

MAX_HEIGHT, MIN_HEIGHT = 64, 26
"""Limits of the height (px) of a strip."""

SHARED = np.array([rgb("#eceef1"), rgb(Reason.FEASIBLE.color)], dtype=np.uint8)
"""(2, 3) sRGB: cells that some task excludes, and those that serve all."""

HEADINGS = ("task", "turned by δ", "room along", "around", "clear")


def stack_html(state: State) -> str:
    """Draw the maps of the plan's tasks below each other, with the grasp marked in each."""
    if state.plan is None or state.plan.plan.kind != "sequential":
        return _unplanned(state)
    plan = state.plan
    steps = [(k, task, task.holds[0]) for k, task in enumerate(plan.plan.tasks)]
    groups = [list(group) for _, group in groupby(steps, lambda step: step[2].grasp)]
    height = _height(len(steps) + sum(len(group) > 1 for group in groups))
    rows = [_row(HEADINGS, "sg-faint")]
    for number, group in enumerate(groups, start=1):
        grasp = group[0][2].grasp
        if len(groups) > 1:
            rows.append(f'<div class="sg-part">grasp {number}: {_grasp_text(grasp)}</div>')
        for k, task, hold in group:
            turn = f"{np.rad2deg(task.delta) + 0.0:.1f}°"
            now = "sg-now" if k == state.step else ""
            rows.append(_row((f"{k + 1} · {task.name}", turn, *margin_texts(hold)), now))
            result = state.plan_results.maps[task.name, hold.arm]
            rows.append(_strip(result, grasp, state.plan_results.slide * task.delta, task.delta, height))
        if len(group) > 1:
            turns = tuple(state.plan_results.slide * task.delta for _, task, _ in group)
            maps = _maps(state, [task for _, task, _ in group])
            shared = shared_columns(maps, turns, ROLLS.index(grasp.roll))
            cells = round(float(shared.mean(axis=1).sum()) * maps[0].manifold.angles)
            text = f"all {len(group)} over each other: {cells} common {'cell' if cells == 1 else 'cells'}"
            rows.append(_row((text, "", "", "", ""), "sg-wide"))
            rows.append(_overlay(maps[0], shared, grasp, height))
    axis = f'<div class="sg-map sg-axis">{THETA_AXIS}</div>'
    return f'<div class="sg-stack" role="img" aria-label="maps of the tasks">{"".join(rows)}{axis}</div>'


def margin_texts(hold: Hold) -> tuple[str, str, str]:
    """Return texts for a hold: its margins along the axis (mm) and around it (°), and its clearance (mm)."""
    more = "> " if hold.clearance >= CLEARANCE_LIMIT else ""
    return (
        f"{1e3 * hold.margin_along:.0f} mm",
        f"{np.rad2deg(hold.margin_around):.0f}°",
        f"{more}{1e3 * hold.clearance:.0f} mm",
    )


def shared_columns(maps: Sequence[FeasibilityMap], turns: Sequence[float], roll: int) -> np.ndarray:
    """Return where one roll is feasible in all maps, each shifted by its own angle.

    Args:
        maps: the maps, over equal grids.
        turns: the angle (rad) by which the object of each is turned.
        roll: index of the roll.

    Returns:
        (H, COLUMNS) bool, over the columns of a picture.
    """
    shared = []
    for m, turn in zip(maps, turns, strict=True):
        grid, k = m.manifold.shift(turn)  # cheaper than m.shift(turn): this runs while a slider moves
        shared.append(np.roll(m.feasible[roll], -k, axis=1)[:, sample_columns(grid)])
    return np.logical_and.reduce(shared)


def _unplanned(state: State) -> str:
    """Draw the maps that the planner used although it found no plan, at δ = 0."""
    maps = {
        key: result
        for key, result in state.plan_results.maps.items()
        if state.plan_results.kind == "sequential"
    }
    if not maps:
        return ""
    height = _height(len(maps))
    rows = [
        _row((task, "", "", "", ""), "") + _strip(r, None, 0.0, 0.0, height) for (task, _), r in maps.items()
    ]
    axis = f'<div class="sg-map sg-axis">{THETA_AXIS}</div>'
    return f'<div class="sg-stack" role="img" aria-label="maps of the tasks">{"".join(rows)}{axis}</div>'


def _height(strips: int) -> int:
    return int(np.clip(TOTAL_HEIGHT / strips - 17, MIN_HEIGHT, MAX_HEIGHT))


def _row(cells: Sequence[str], css_class: str) -> str:
    return (
        f'<div class="sg-head {css_class}">{"".join(f"<span>{escape(cell)}</span>" for cell in cells)}</div>'
    )


def _grasp_text(grasp: Grasp) -> str:
    turn, roll = np.rad2deg(grasp.theta) + 0.0, np.rad2deg(grasp.roll)
    return f"h = {100 * grasp.h:.1f} cm, θ = {turn:.1f}°, roll {roll:.0f}°{pitch_text(grasp)}"


def _strip(result: MapResult, grasp: Grasp | None, slid: float, delta: float, height: int) -> str:
    """Draw one map with the cell that the grasp uses.

    Args:
        result: the map.
        grasp: the grasp; None to draw no mark, and either roll.
        slid: the angle (rad) that the picture is shifted by so far.
        delta: the task's δ (rad), the shift in the end.
        height: of the strip (px).
    """
    roll = None if grasp is None else ROLLS.index(grasp.roll)
    share = float(np.mod(slid / (2 * np.pi), 1.0))
    source = _picture(result.map, roll)
    name = f"plan map {result.request.task} {result.request.arm}"
    images = f'<img alt="{escape(name)}" src="{source}"><img alt="" src="{source}">'
    sliding = f'<div class="sg-sliding" style="transform:translateX(-{50 * share:.4f}%)">{images}</div>'
    marks = ""
    if grasp:
        at = Mark(grasp.h, float(wrap(grasp.theta + delta - slid)))
        marks = _theta_line(grasp.theta) + circle(at, result.map.manifold)
    return _framed(sliding + marks, result.map, height)


def _maps(state: State, tasks: Sequence[PlanTask]) -> list[FeasibilityMap]:
    return [state.plan_results.maps[task.name, task.holds[0].arm].map for task in tasks]


def _overlay(m: FeasibilityMap, shared: np.ndarray, grasp: Grasp, height: int) -> str:
    """Draw where a roll is feasible in all maps, see `shared_columns`; one of them gives the axes."""
    source = _uri(to_png(shared[::-1].astype(np.uint8), SHARED))
    picture = f'<img class="sg-whole" alt="common grasps" src="{source}">'
    marks = _theta_line(grasp.theta) + circle(Mark(grasp.h, grasp.theta), m.manifold)
    return _framed(picture + marks, m, height)


def _framed(picture: str, m: FeasibilityMap, height: int) -> str:
    axis = h_axis(m.manifold, height)
    return (
        f'<div class="sg-strip" style="height:{height}px">{axis}<div class="sg-window">{picture}</div></div>'
    )


def _theta_line(theta: float) -> str:
    """Draw the grasp's θ across a strip."""
    left = 100 * (float(wrap(theta)) + np.pi) / (2 * np.pi)
    return f'<i class="sg-line-theta" style="left:{left:.3f}%;border-color:{INK}"></i>'


@cached_with_first
def _picture(m: FeasibilityMap, roll: int | None) -> str:
    """Return a map's picture as a data URI: of one roll, or of either (None)."""
    reason = m.reason.max(axis=0) if roll is None else m.reason[roll]
    return _uri(to_png(reason[::-1, sample_columns(m.manifold)], REASONS))


def _uri(png: bytes) -> str:
    return f"data:image/png;base64,{base64.b64encode(png).decode()}"
