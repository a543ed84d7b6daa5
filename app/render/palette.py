"""The colours of the page: of reasons, handprints, marks and lines."""

from __future__ import annotations

import numpy as np

from symgrasp.reason import Reason

__all__ = ["DIVERGING", "INK", "OVERLAP", "PICK", "PRINTS", "REASONS", "faded", "rgb", "to_linear"]


def rgb(color: str) -> tuple[int, int, int]:
    """Return the channels (0 to 255) of ``#rrggbb``."""
    return int(color[1:3], 16), int(color[3:5], 16), int(color[5:7], 16)


REASONS = np.array([rgb(reason.color) for reason in Reason], dtype=np.uint8)
"""(reasons, 3) sRGB: the colour of each `Reason`, by its value."""

INK = "#1d2733"
"""Lines and labels."""

PICK = "#e6007e"
"""The picked grasp; no reason has a colour near it."""

HANDS = ("#0b3c9c", "#5fc9f0", "#a8641c", "#fff0c8")
"""The hands of a task, in turn; they differ in lightness, so that the colour-blind can distinguish them."""

PRINTS = np.array([rgb(color) for color in ("#ffffff", *HANDS, "#000000")], dtype=np.uint8)
"""(2 + hands, 3) sRGB: nothing, each hand, and where hands overlap."""

OVERLAP = len(PRINTS) - 1
"""Index into `PRINTS` where hands overlap."""

DIVERGING = np.array([rgb(c) for c in ("#2166ac", "#92c5de", "#f7f7f7", "#f4a582", "#b2182b")])
"""(5, 3) sRGB: from negative over zero to positive; the colour-blind can distinguish the ends."""

FADED_TO = np.array([236, 238, 241])
"""(3,) sRGB: what `faded` blends with."""


def faded(colors: np.ndarray) -> np.ndarray:
    """Return sRGB colours (..., 3) blended with grey, for a map that is out of date."""
    return np.round(0.3 * colors + 0.7 * FADED_TO).astype(np.uint8)


def _linear() -> np.ndarray:
    share = np.arange(256) / 255
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return np.round(255 * linear).astype(np.uint8)


_LINEAR = _linear()


def to_linear(colors: np.ndarray) -> np.ndarray:
    """Return sRGB colours (..., 3) in linear RGB, which viser's batched meshes expect; both 0 to 255."""
    return _LINEAR[np.round(colors).astype(np.uint8)]
