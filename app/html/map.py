"""The unwrapped map as a picture with axes: small palette PNGs inside HTML.

The picture is drawn in the object's coordinates: h upwards, θ from -180° to 180°. It has four
columns a degree, so a turn by a step of the page's slider rolls it by exactly one column.
"""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence

import numpy as np
from PIL import Image

from symgrasp.feasibility.color_by import ColorBy
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.object.manifold import Manifold, wrap

from ..render.cell_colors import colored_map
from ..render.marks import Mark
from ..render.palette import OVERLAP, PRINTS, faded
from ..render.prints import print_index
from ..state.map_view_state import RollChoice
from .escaping import escape

__all__ = [
    "COLUMNS",
    "THETA_AXIS",
    "circle",
    "h_axis",
    "map_html",
    "picture_html",
    "sample_columns",
    "to_png",
]

COLUMNS = 1440
"""Columns of a picture: four a degree."""

SHADE = 205
"""Alpha of the cells under a hand."""


def sample_columns(manifold: Manifold) -> np.ndarray:
    """Return for each column of the picture the column (COLUMNS,) of the grid that it shows."""
    theta = -np.pi + (np.arange(COLUMNS) + 0.5) * (2 * np.pi / COLUMNS)
    turned = np.mod(theta - manifold.theta_start, 2 * np.pi)
    return np.floor(turned / manifold.dtheta).astype(int) % manifold.angles


def to_png(indices: np.ndarray, colors: np.ndarray, alpha: Sequence[int] | None = None) -> bytes:
    """Encode a palette PNG.

    Args:
        indices: (H, W) indices into the palette, top row first.
        colors: (n, 3) sRGB palette.
        alpha: (n,) opacity of each colour, 0 to 255; None for opaque.
    """
    image = Image.fromarray(np.ascontiguousarray(indices, dtype=np.uint8), "P")
    image.putpalette(colors.ravel().tolist())
    buffer = io.BytesIO()
    options = {"transparency": bytes(alpha)} if alpha else {}
    image.save(buffer, "PNG", compress_level=3, **options)
    return buffer.getvalue()


def map_html(
    m: FeasibilityMap,
    roll: RollChoice,
    marks: Sequence[Mark] = (),
    prints: Sequence[np.ndarray] = (),
    *,
    color_by: ColorBy = ColorBy.REASON,
    stale: bool = False,
    height: int = 230,
    name: str = "map",
) -> str:
    """Draw one map with its axes.

    Args:
        m: the map.
        roll: which rolls to show.
        marks: grasps to circle.
        prints: for each hand, whether a cell (H, A) lies under it; over the unshifted grid, from θ = -π.
        color_by: what the colours stand for.
        stale: fade the colours, for a map that is out of date.
        height: of the picture (px).
        name: alternative text of the picture.
    """
    grid = m.manifold
    colored = colored_map(m, roll, color_by)
    picture = colored.index[::-1, sample_columns(grid)]
    layers = [_img(to_png(picture, faded(colored.colors) if stale else colored.colors), name)]
    unshifted = Manifold(grid.profile, grid.heights, grid.angles)
    if prints:
        index = print_index(prints)[::-1, sample_columns(unshifted)]
        layers.append(_img(to_png(index, PRINTS, (0, *[SHADE] * OVERLAP)), "handprints"))
    layers += [circle(mark, grid) for mark in marks]
    return (
        f'<div class="sg-map" style="height:{height + 48}px">'
        f'<div class="sg-picture">{"".join(layers)}</div>{h_axis(grid, height)}{THETA_AXIS}</div>'
    )


Axis = tuple[Sequence[tuple[float, str]], str]
"""Labels of an axis, each with its position (0 to 1), and the name of the axis with its unit."""


def picture_html(png: bytes, name: str, over: str, height: int, across: Axis, up: Axis) -> str:
    """Draw a picture with two axes.

    Args:
        png: the picture.
        name: its alternative text.
        over: HTML to lie over it.
        height: of the picture (px).
        across, up: the axes.
    """
    below = "".join(f'<span style="left:{100 * at:.2f}%">{escape(text)}</span>' for at, text in across[0])
    beside = "".join(f'<span style="bottom:{100 * at:.2f}%">{escape(text)}</span>' for at, text in up[0])
    return (
        f'<div class="sg-map" style="height:{height + 48}px">'
        f'<div class="sg-picture">{_img(png, name)}{over}</div>'
        f'<div class="sg-h">{beside}<b>{escape(up[1])}</b></div>'
        f'<div class="sg-theta">{below}<b>{escape(across[1])}</b></div></div>'
    )


def _img(png: bytes, name: str) -> str:
    data = base64.b64encode(png).decode()
    return f'<img alt="{escape(name)}" src="data:image/png;base64,{data}">'


def circle(mark: Mark, grid: Manifold) -> str:
    """Draw a mark, as HTML to lie over the picture of a map on this grid."""
    profile = grid.profile
    left = 100 * (float(wrap(mark.theta)) + np.pi) / (2 * np.pi)
    bottom = f"{100 * (mark.h - profile.h_min) / (profile.h_max - profile.h_min):.3f}%"
    circle = f'<span class="sg-mark" style="left:{left:.3f}%;bottom:{bottom}"></span>'
    if not mark.label:
        return circle
    side = f"right:{100 - left:.3f}%" if left > 75 else f"left:{left:.3f}%"
    inside = f"bottom:clamp(7px,{bottom},calc(100% - 9px))"  # keeps a label at an end inside the picture
    return circle + f'<span class="sg-label" style="{side};{inside}">{escape(mark.label)}</span>'


def h_axis(grid: Manifold, height: int) -> str:
    """Draw the axis of heights (cm) beside a picture of a height in px, with labels at round numbers."""
    low, high = 100 * grid.profile.h_min, 100 * grid.profile.h_max
    most = max(3, height / 28)
    decade = 10 ** np.floor(np.log10((high - low) / most))
    step = next(s * decade for s in (1, 2, 5, 10) if (high - low) / (s * decade) <= most * (1 + 1e-9))
    ticks = np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 1) * step
    labels = (f'<span style="bottom:{100 * (h - low) / (high - low):.2f}%">{h + 0.0:g}</span>' for h in ticks)
    return f'<div class="sg-h">{"".join(labels)}<b>h (cm)</b></div>'


def _theta_axis() -> str:
    labels = (f'<span style="left:{(a + 180) / 3.6:.3f}%">{a}</span>' for a in range(-180, 181, 60))
    return f'<div class="sg-theta">{"".join(labels)}<b>θ (°)</b></div>'


THETA_AXIS = _theta_axis()
"""The axis of angles below a picture."""
