"""The colours of the places of a survey, the same in the picture and in 3D."""

from __future__ import annotations

import numpy as np

from symgrasp.feasibility.color_by import FEASIBLE, INFEASIBLE, NONE, SCALE
from symgrasp.poses import Array

from ..state.surveys.survey import SurveyValue

__all__ = ["place_colors"]


def place_colors(value: SurveyValue, values: Array) -> tuple[np.ndarray, float]:
    """Return sRGB colours (n, 3) of places, and the value at the end of the scale, which begins at zero.

    Args:
        value: what the values are.
        values: (n,) values; NaN where there is none.
    """
    known = np.isfinite(values)
    colors = np.tile(np.array(NONE, dtype=np.uint8), (len(values), 1))
    if value == "plan":
        colors[known] = np.where(values[known, None] > 0, FEASIBLE, INFEASIBLE)
        return colors, 1.0
    high = float(values[known].max(initial=0.0)) or 1.0
    at = values[known] / high * (len(SCALE) - 1)
    stops = np.arange(len(SCALE))
    colors[known] = np.round(np.stack([np.interp(at, stops, channel) for channel in SCALE.T], axis=-1))
    return colors, high
