"""The colours of clearances along a motion."""

from __future__ import annotations

import numpy as np
from matplotlib import colormaps

__all__ = ["CLEAR", "clearance_color"]

CLEAR = 0.03
"""Clearance (m) from which on all have the same colour."""

_MAP = colormaps["plasma"]


def clearance_color(clearance: float) -> np.ndarray:
    """Return the sRGB colour (3,) (0 to 255) of a clearance (m), yellow where small."""
    share = float(np.clip(clearance / CLEAR, 0.0, 1.0))
    return np.round(255 * np.array(_MAP(0.9 * (1.0 - share))[:3])).astype(np.uint8)
