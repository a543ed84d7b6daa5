"""The heights of the object that each hand can hold, and the measured symmetry error."""

from __future__ import annotations

import numpy as np

from ..render.deviation import deviation_limit
from ..render.holds import hand_holds
from ..render.palette import DIVERGING, PRINTS
from ..state.state import State
from .escaping import escape

__all__ = ["holds_html", "symmetry_html"]


def holds_html(state: State) -> str:
    """Say at which heights each hand fits the object, by its opening, palm and the slope alone."""
    rows = []
    for holds in hand_holds(state):
        parts = [f"{100 * low:.1f} to {100 * high:.1f}" for low, high in holds.spans]
        where = f"from {' and '.join(parts)} cm" if parts else "nowhere"
        rows.append(
            f'<div class="sg-row"><i style="background:{_css(holds.color)}"></i>'
            f"<span>The hand {escape(holds.hand)} fits {where}.</span></div>"
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
