"""The unwrapped map as a picture with axes and a legend: small PNGs inside HTML, crisp at any size.

The picture is drawn in the object's coordinates: h upwards, θ from -180° to 180°. It has four
columns a degree, so a turn by a step of the page's slider rolls it by exactly one column.
"""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from html import escape

import numpy as np
from PIL import Image

from symgrasp.feasibility.color_by import ColorBy, Scale
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.object.manifold import Manifold, wrap

from ..render.cell_colors import coloured
from ..render.marks import Mark
from ..render.palette import OVERLAP, PRINTS, faded
from ..render.prints import hand_color, print_index
from ..state.map_view_state import RollChoice

__all__ = [
    "COLUMNS",
    "THETA_AXIS",
    "circle",
    "h_axis",
    "legend_html",
    "map_html",
    "picture_html",
    "prints_html",
    "sample_columns",
    "scale_html",
    "to_png",
]

COLUMNS = 1440
"""Columns of a picture: four a degree."""

SHADE = 205
"""Alpha of the cells under a hand."""


def sample_columns(manifold: Manifold) -> np.ndarray:
    """Return the column (COLUMNS,) of the grid that each column of the picture shows."""
    theta = -np.pi + (np.arange(COLUMNS) + 0.5) * (2 * np.pi / COLUMNS)
    turned = np.mod(theta - manifold.theta_start, 2 * np.pi)
    return np.floor(turned / manifold.dtheta).astype(int) % manifold.angles


def to_png(indices: np.ndarray, colors: np.ndarray, alpha: Sequence[int] | None = None) -> bytes:
    """Return a palette PNG of indices (H, W), top row first, into sRGB colours (n, 3) and alphas (n,)."""
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
    view: ColorBy = ColorBy.REASON,
    stale: bool = False,
    height: int = 230,
    name: str = "map",
) -> str:
    """Draw one map with its axes.

    Args:
        m: the map.
        roll: which rolls to show.
        marks: grasps to circle.
        prints: cells (H, A) under each hand, over the grid that begins at -π.
        view: what the colours stand for.
        stale: wash the colours out.
        height: of the picture (px).
        name: alternative text of the picture.
    """
    grid = m.manifold
    found = coloured(m, roll, view)
    picture = found.index[::-1, sample_columns(grid)]
    layers = [_img(to_png(picture, faded(found.colors) if stale else found.colors), name)]
    still = Manifold(grid.profile, grid.heights, grid.angles)
    if prints:
        index = print_index(prints)[::-1, sample_columns(still)]
        layers.append(_img(to_png(index, PRINTS, (0, *[SHADE] * OVERLAP)), "handprints"))
    layers += [circle(mark, grid) for mark in marks]
    return (
        f'<div class="sg-map" style="height:{height + 48}px">'
        f'<div class="sg-picture">{"".join(layers)}</div>{h_axis(grid, height)}{THETA_AXIS}</div>'
    )


Axis = tuple[Sequence[tuple[float, str]], str]
"""Labels with how far along (0 to 1) they stand, and the name with its unit."""


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


def legend_html(m: FeasibilityMap, roll: RollChoice, view: ColorBy = ColorBy.REASON) -> str:
    """List what occurs on a map, with its colours and how many cells have them, or show the scale."""
    found = coloured(m, roll, view)
    rows = []
    for color, label, count in found.swatches:
        share = (
            f"{100 * count / found.index.size:.0f}" if 200 * count >= found.index.size or not count else "<1"
        )
        rows.append(
            f'<div><i style="background:{color}"></i><span>{escape(label)}</span>'
            f"<small>{count} · {escape(share)} %</small></div>"
        )
    scale = scale_html(found.scale) if found.scale else ""
    return f'{scale}<div class="sg-legend">{"".join(rows)}</div>'


def scale_html(scale: Scale) -> str:
    """Draw a colour scale with its ends."""
    stops = ", ".join(f"rgb{tuple(color)}" for color in scale.colors[::36].tolist())
    return (
        f'<div class="sg sg-rows sg-scale" role="img" aria-label="scale"><span>{escape(scale.label)}</span>'
        f'<span>0</span><i style="background:linear-gradient(to right, {stops})"></i>'
        f"<span>{scale.high:g}</span></div>"
    )


def prints_html(names: Sequence[str], prints: Sequence[np.ndarray]) -> str:
    """List the colours of the hands of some arms on a map, and that of their overlap if there is one."""
    rows = [(hand_color(k), f"hand of {name}") for k, name in enumerate(names)]
    if OVERLAP in print_index(prints):
        rows.append((OVERLAP, "both hands"))
    swatches = (
        f'<div><i style="background:rgb{tuple(PRINTS[color].tolist())}"></i><span>{escape(name)}</span></div>'
        for color, name in rows
    )
    return f'<div class="sg-legend">{"".join(swatches)}</div>'


def _img(png: bytes, name: str) -> str:
    data = base64.b64encode(png).decode()
    return f'<img alt="{escape(name)}" src="data:image/png;base64,{data}">'


def circle(mark: Mark, grid: Manifold) -> str:
    """Draw a mark on a picture of a map."""
    profile = grid.profile
    left = 100 * (float(wrap(mark.theta)) + np.pi) / (2 * np.pi)
    bottom = f"{100 * (mark.h - profile.h_min) / (profile.h_max - profile.h_min):.3f}%"
    circle = f'<span class="sg-mark" style="left:{left:.3f}%;bottom:{bottom}"></span>'
    if not mark.label:
        return circle
    side = f"right:{100 - left:.3f}%" if left > 75 else f"left:{left:.3f}%"
    inside = f"bottom:clamp(7px,{bottom},calc(100% - 9px))"  # all of the name is read, also at an end
    return circle + f'<span class="sg-label" style="{side};{inside}">{escape(mark.label)}</span>'


def h_axis(grid: Manifold, height: int) -> str:
    """Draw the axis of heights beside a picture of that height (px)."""
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
