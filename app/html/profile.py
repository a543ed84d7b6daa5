"""The object's profile beside its map, which hand holds it where, and how symmetric it was measured to be."""

from __future__ import annotations

from functools import lru_cache
from html import escape

import numpy as np

from symgrasp.feasibility.object_report import holding_heights
from symgrasp.object.manifold import Manifold
from symgrasp.object.measure.measurement import Measurement
from symgrasp.object.profile import Profile
from symgrasp.robot.hand import Hand

from ..render.palette import DIVERGING, PRINTS
from ..render.prints import hand_color
from ..state.state import State

__all__ = ["deviation_cells", "deviation_colors", "holds_html", "profile_html", "symmetry_html"]

BAR = 6
"""Width (px) of the bar that shows where a hand can hold the object."""


NO_SURFACE = (150, 150, 150)
"""Colour of cells where an open mesh has no surface."""


@lru_cache(maxsize=64)
def _holding(hand: Hand, profile: Profile) -> tuple[tuple[float, float], ...]:
    return holding_heights(hand, profile)


def _hands(state: State) -> dict[str, tuple[int, Hand]]:
    """Return hand name → colour and hand, of the first arm of the task with it."""
    hands: dict[str, tuple[int, Hand]] = {}
    for k, name in enumerate(state.scene.task(state.task).arms):
        hand = state.scene.arm(name).hand
        hands.setdefault(hand.name, (hand_color(k), hand))
    return hands


def profile_html(state: State, height: int = 230) -> str:
    """Draw r(h), the axis on the left, on the heights of the map beside it, with a bar for each hand.

    Args:
        state: the state.
        height: of the map's picture (px).
    """
    profile = state.scene.profile
    bars = []
    for k, (color, hand) in enumerate(_hands(state).values()):
        for low, high in _holding(hand, profile):
            bottom, top = _share(profile, low), _share(profile, high)
            bars.append(
                f'<i class="sg-hold" style="right:{(BAR + 2) * k}px;width:{BAR}px;bottom:{bottom:.2f}%;'
                f'height:{top - bottom:.2f}%;background:{_css(color)}"></i>'
            )
    room = (BAR + 2) * len(_hands(state)) + 4
    return (
        f'<div class="sg-profile" style="height:{height + 48}px" role="img" aria-label="profile">'
        f'<svg viewBox="0 0 100 100" preserveAspectRatio="none" style="width:calc(100% - {room}px)">'
        f'<path d="{_outline(profile)}"/></svg>'
        f'<div class="sg-holds">{"".join(bars)}</div>'
        f'<div class="sg-r" style="right:{room}px"><span style="left:0">0</span>'
        f'<span style="left:100%">{1e3 * profile.r_max:.3g}</span><b>r (mm)</b></div></div>'
    )


def _share(profile: Profile, h: float) -> float:
    """Return how far up (%) a height lies."""
    return 100 * (h - profile.h_min) / (profile.h_max - profile.h_min)


def _outline(profile: Profile) -> str:
    """Return the half section as an SVG path in a square of 100, r to the right, h upwards."""
    knots = [(100 * r / profile.r_max, 100 - _share(profile, h)) for h, r in profile.points]
    corners = [(0.0, 100.0), *knots, (0.0, 0.0)]
    return "M" + "L".join(f"{x:.2f} {y:.2f}" for x, y in corners) + "Z"


def holds_html(state: State) -> str:
    """Say which hand can hold the object where, as far as openings, palm and slopes go."""
    rows = []
    for color, hand in _hands(state).values():
        parts = [f"{100 * low:.1f} to {100 * high:.1f}" for low, high in _holding(hand, state.scene.profile)]
        where = f"from {' and '.join(parts)} cm" if parts else "nowhere"
        rows.append(
            f'<div class="sg-row"><i style="background:{_css(color)}"></i>'
            f"<span>The hand {escape(hand.name)} fits {where}.</span></div>"
        )
    return f'<div class="sg sg-rows">{"".join(rows)}</div>'


def symmetry_html(state: State) -> str:
    """Say how far an uploaded mesh is from a surface of revolution, with the scale of the colours."""
    m = state.object_choice.measurement if state.object_choice else None
    if m is None:
        return ""
    worst, h, theta = m.worst
    text = (
        f"Symmetry error: {1e3 * worst:.2f} mm at most (h = {100 * h:.1f} cm, θ = {np.rad2deg(theta):.0f}°), "
        f"{1e3 * m.overall_rms:.2f} mm RMS; {1e3 * m.tolerance:.2f} mm are allowed."
    )
    scale = ""
    if state.display.symmetry_error:
        stops = ", ".join(_rgb(color) for color in DIVERGING)
        limit = f"{1e3 * _limit(m):.2g} mm"
        scale = (
            f'<div class="sg-scale"><span>{limit} inside</span>'
            f'<i style="background:linear-gradient(to right, {stops})"></i><span>outside {limit}</span></div>'
        )
    return f'<div class="sg sg-rows">{escape(text)}{scale}</div>'


def deviation_cells(m: Measurement, grid: Manifold) -> np.ndarray:
    """Return the deviation (H, A) that is largest in size in each cell (m), NaN where there is none.

    Args:
        m: the measurement.
        grid: the grid, in the object's frame.
    """
    bottom = grid.profile.h_min
    row = np.clip(((m.heights - bottom) / grid.dh).astype(int), 0, grid.heights - 1)
    column = [grid.cell(bottom, angle)[1] for angle in m.angles]
    rows, columns = np.meshgrid(row, column, indexing="ij")
    # Cells between the samples take the nearest one.
    near_rows = np.abs(grid.h[:, None] - m.heights).argmin(axis=1)
    near_columns = np.abs(np.exp(1j * grid.theta[:, None]) - np.exp(1j * m.angles)).argmin(axis=1)
    near = m.deviation[np.ix_(near_rows, near_columns)]
    highest, lowest = near.copy(), near.copy()
    np.fmax.at(highest, (rows, columns), m.deviation)
    np.fmin.at(lowest, (rows, columns), m.deviation)
    return np.where(highest >= -lowest, highest, lowest)


@lru_cache(maxsize=4)
def deviation_colors(m: Measurement, grid: Manifold) -> np.ndarray:
    """Return the colours (H, A, 3) of the deviation: sRGB, from inside over none to outside."""
    cells = deviation_cells(m, grid)
    share = np.nan_to_num(cells) / _limit(m)
    at = (np.clip(share, -1, 1) + 1) / 2 * (len(DIVERGING) - 1)
    stops = np.arange(len(DIVERGING))
    channels = [np.interp(at, stops, DIVERGING[:, k]) for k in range(3)]
    colors = np.round(np.stack(channels, axis=-1)).astype(np.uint8)
    colors[np.isnan(cells)] = NO_SURFACE
    return colors


def _limit(m: Measurement) -> float:
    """Return the deviation (m) at the ends of the colour scale."""
    return max(m.worst[0], 1e-5)


def _css(color: int) -> str:
    return _rgb(PRINTS[color])


def _rgb(color: np.ndarray) -> str:
    return f"rgb{tuple(color.tolist())}"
