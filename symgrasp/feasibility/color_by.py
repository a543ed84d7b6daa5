"""Colouring a map by its reasons, or by a value with a scale; all colours suit the colour-blind."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from symgrasp.poses import Array
from symgrasp.reason import Reason

__all__ = [
    "FEASIBLE", "INFEASIBLE", "NONE", "SCALE", "ColorBy", "ColoredMap", "Scale", "Swatch", "color_map",
]  # fmt: skip


class ColorBy(StrEnum):
    """What the colours of a map stand for; the value is what it is called."""

    REASON = "reason"
    FEASIBLE = "feasible"
    CLEARANCE = "clearance"
    ALONG = "margin along"
    AROUND = "margin around"
    OPENING = "hand opening"
    PROBABILITY = "probability"
    WINDOW = "elbow window"

    @property
    def has_parts(self) -> bool:
        """Whether it colours reasons, which are known of the parts of cells too, and no values."""
        return self in (ColorBy.REASON, ColorBy.FEASIBLE)

    @property
    def unit(self) -> str:
        """Unit of its values, empty where it shows none."""
        return _UNITS.get(self, "")


_UNITS = {ColorBy.CLEARANCE: "mm", ColorBy.ALONG: "mm", ColorBy.AROUND: "°", ColorBy.OPENING: "mm",
          ColorBy.PROBABILITY: "%", ColorBy.WINDOW: "°"}  # fmt: skip

FEASIBLE = (0x5F, 0xBF, 0x77)
INFEASIBLE = (0xA3, 0x1D, 0x2A)
"""The paper's green and red, made to differ in lightness as well."""

NONE = (0xE4, 0xE6, 0xEA)
"""Colour of cells without a value; no colour of the scale is near it."""

SCALE = np.array(
    [[0x44, 0x01, 0x54], [0x47, 0x2D, 0x7B], [0x3B, 0x52, 0x8B], [0x2C, 0x72, 0x8E], [0x21, 0x91, 0x8C],
     [0x28, 0xAE, 0x80], [0x5E, 0xC9, 0x62], [0xAD, 0xDC, 0x30]], dtype=np.uint8
)  # fmt: skip
"""(8, 3) sRGB stops of the scale, from low to high: it only grows lighter. Viridis without its yellow,
which the tritanopic see as near white."""

STEPS = 255
"""Steps of the scale in a picture."""

SMALLEST = 0.001
"""Smallest end of a scale."""

NICE = (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
"""Where a scale may end, times a power of ten."""


class Swatch(NamedTuple):
    """A line of a legend: colour as #rrggbb, what it stands for, and how many cells have it."""

    color: str
    label: str
    cells: int


class Scale(NamedTuple):
    """A colour scale, from zero.

    Attributes:
        label: what it measures, with the unit.
        high: the value at its end, in that unit.
        colors: (n, 3) sRGB from low to high.
    """

    label: str
    high: float
    colors: np.ndarray


@dataclass(frozen=True, eq=False)
class ColoredMap:
    """A coloured map.

    Attributes:
        index: (..., H, A) uint8 into ``colors``.
        colors: (n, 3) uint8, sRGB.
        swatches: its legend.
        scale: its scale, if it shows values.
    """

    index: np.ndarray
    colors: np.ndarray
    swatches: tuple[Swatch, ...]
    scale: Scale | None = None


LIGHTER = 0.55
"""How much of the colour of what is not proven is white."""


def color_map(
    color_by: ColorBy, reason: np.ndarray, values: Array, certified: np.ndarray | None = None
) -> ColoredMap:
    """Colour a map.

    Args:
        color_by: what its colours stand for.
        reason: (..., H, A) of `Reason`.
        values: (..., H, A) values in the unit of ``color_by``; NaN where there is none.
        certified: (..., H, A) bool, which cells are proven to hold as a whole: reasons of the others are
            lighter, and so is whether they are feasible. None where nothing is known of that.
    """
    colored = _colored(color_by, reason, values)
    if certified is None or colored.scale is not None:
        return colored
    shades = np.round((1 - LIGHTER) * colored.colors + LIGHTER * 255).astype(np.uint8)
    open_cells = int(np.count_nonzero(~certified))
    swatch = Swatch(_hex(NONE), "lighter: not proven as a whole", open_cells)
    return ColoredMap(
        np.where(certified, colored.index, colored.index + len(shades)).astype(np.uint8),
        np.concatenate([colored.colors, shades]),
        (*colored.swatches, swatch),
    )


def _colored(color_by: ColorBy, reason: np.ndarray, values: Array) -> ColoredMap:
    """Colour a map, whatever is proven of it."""
    if color_by is ColorBy.REASON:
        colors = np.array([_channels(r.color) for r in Reason], dtype=np.uint8)
        counts = np.bincount(reason.ravel(), minlength=len(Reason))
        swatches = [Swatch(r.color, r.legend, int(counts[r])) for r in reversed(Reason) if counts[r]]
        return ColoredMap(reason.astype(np.uint8), colors, tuple(swatches))
    feasible = reason == Reason.FEASIBLE
    count = int(np.count_nonzero(feasible))
    rest = feasible.size - count
    if color_by is ColorBy.FEASIBLE:
        swatches = (
            Swatch(_hex(FEASIBLE), "feasible", count),
            Swatch(_hex(INFEASIBLE), "not feasible", rest),
        )
        return ColoredMap(
            feasible.astype(np.uint8), np.array([INFEASIBLE, FEASIBLE], dtype=np.uint8), swatches
        )
    known = ~np.isnan(values)
    high = _nice(float(values[known].max())) if known.any() else 1.0
    swatches = (Swatch(_hex(NONE), "not feasible", rest),)
    if color_by is ColorBy.WINDOW and (feasible & ~known).any():
        unknown = int(np.count_nonzero(~known))
        swatches = (Swatch(_hex(NONE), "not feasible, or not known", unknown),)
    if color_by is ColorBy.PROBABILITY:
        high, unknown = 100.0, int(np.count_nonzero(~known))
        swatches = (Swatch(_hex(NONE), "not computed yet", unknown),) if unknown else ()
    steps = 1 + np.round(np.clip(np.where(known, values, 0.0) / high, 0, 1) * (STEPS - 1))
    at = np.linspace(0, len(SCALE) - 1, STEPS)
    ramp = np.stack([np.interp(at, np.arange(len(SCALE)), SCALE[:, k]) for k in range(3)], axis=-1)
    colors = np.vstack([[NONE], np.round(ramp)]).astype(np.uint8)
    scale = Scale(f"{color_by} ({color_by.unit})", high, colors[1:])
    index = np.where(known, steps, 0).astype(np.uint8)
    return ColoredMap(index, colors, swatches, scale)


def _nice(value: float) -> float:
    """Return a round number that is not smaller, for the end of a scale."""
    if value < SMALLEST:
        return SMALLEST
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * next(step for step in NICE if step * power >= value * (1 - 1e-9)))


def _channels(color: str) -> tuple[int, int, int]:
    return int(color[1:3], 16), int(color[3:5], 16), int(color[5:7], 16)


def _hex(color: tuple[int, int, int]) -> str:
    return "#{:02x}{:02x}{:02x}".format(*color)
