"""The object's profile beside its map, the heights each hand can hold, and the measured symmetry error."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from symgrasp.feasibility.object_report import holding_heights
from symgrasp.object.profile import Profile
from symgrasp.robot.hand import Hand

from ..render.deviation import deviation_limit
from ..render.palette import DIVERGING, PRINTS
from ..render.prints import hand_color
from ..state.state import State
from .escaping import escape

__all__ = ["holds_html", "profile_html", "symmetry_html"]

BAR_WIDTH = 6
"""Width (px) of the bar that shows where a hand can hold the object."""


@lru_cache(maxsize=64)
def _holding(hand: Hand, profile: Profile) -> tuple[tuple[float, float], ...]:
    return holding_heights(hand, profile)


def _hands(state: State) -> dict[str, tuple[int, Hand]]:
    """Return the hands of the task: name → index of its colour in `PRINTS`, and the hand."""
    hands: dict[str, tuple[int, Hand]] = {}
    for k, name in enumerate(state.scene.task(state.task).arms):
        hand = state.scene.arm(name).hand
        hands.setdefault(hand.name, (hand_color(k), hand))
    return hands


def profile_html(state: State, height: int = 230) -> str:
    """Draw r(h) at the scale of the map beside it, with a bar at the heights that each hand can hold.

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
                f'<i class="sg-hold" style="right:{(BAR_WIDTH + 2) * k}px;width:{BAR_WIDTH}px;'
                f"bottom:{bottom:.2f}%;"
                f'height:{top - bottom:.2f}%;background:{_css(color)}"></i>'
            )
    room = (BAR_WIDTH + 2) * len(_hands(state)) + 4
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
    """Say at which heights each hand fits the object, by its opening, palm and the slope alone."""
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
        limit = f"{1e3 * deviation_limit(m):.2g} mm"
        scale = (
            f'<div class="sg-scale"><span>{limit} inside</span>'
            f'<i style="background:linear-gradient(to right, {stops})"></i><span>outside {limit}</span></div>'
        )
    return f'<div class="sg sg-rows">{escape(text)}{scale}</div>'


def _css(color: int) -> str:
    return _rgb(PRINTS[color])


def _rgb(color: np.ndarray) -> str:
    return f"rgb{tuple(color.tolist())}"
