"""One look for all figures: sizes in inches, labels, maps with axes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from app.render.palette import INK, PICK
from docs.figures.render import Body, Camera, Picture, render
from symgrasp.files import write_atomically
from symgrasp.object.manifold import Manifold
from symgrasp.poses import Array
from symgrasp.reason import Reason

__all__ = ["DPI", "IMAGES", "bare", "board", "label", "legend", "map_axes", "mark", "new", "photo", "save"]

IMAGES = Path(__file__).parent.parent / "images"

DPI = 200
"""Pixels an inch: 10 inches wide pictures have 2000 columns."""

mpl.rcParams |= {
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "text.color": INK,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.6,
    "axes.titlesize": 10,
    "xtick.color": INK,
    "ytick.color": INK,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
}

Box = tuple[float, float, float, float]
"""Left, bottom, width and height of a panel (inches)."""


def new(width: float, height: float) -> Figure:
    """Return an empty figure of this size (inches)."""
    return Figure(figsize=(width, height), dpi=DPI)


def save(figure: Figure, name: str) -> None:
    """Write a figure as a PNG into the folder of images."""
    with write_atomically(IMAGES / name) as file:
        figure.savefig(file, format="png", dpi=DPI, metadata={"Software": None})


def board(figure: Figure, box: Box) -> Axes:
    """Add axes at a place given in inches."""
    width, height = figure.get_size_inches()
    left, bottom, w, h = box
    return figure.add_axes((left / width, bottom / height, w / width, h / height))


def bare(axes: Axes) -> Axes:
    """Take ticks and frame away."""
    axes.set_axis_off()
    return axes


def photo(figure: Figure, box: Box, bodies: Sequence[Body], camera: Camera) -> tuple[Axes, Picture]:
    """Add a picture of bodies, a pixel of it to a pixel of the figure."""
    picture = render(bodies, camera, (round(DPI * box[2]), round(DPI * box[3])))
    axes = bare(board(figure, box))
    axes.imshow(picture.image, aspect="auto", interpolation="nearest")
    return axes, picture


def label(
    axes: Axes, picture: Picture, point: Array, text: str, offset: tuple[float, float], color: str = INK
) -> None:
    """Name a point (3,) of the world; the text stands ``offset`` (points) from it."""
    axes.annotate(
        text,
        picture.pixel(point),
        offset,
        textcoords="offset points",
        ha="center",
        va="center",
        bbox={"boxstyle": "round,pad=0.3", "facecolor": "white", "edgecolor": color, "linewidth": 0.8},
        arrowprops={"arrowstyle": "-", "color": color, "linewidth": 0.8, "shrinkA": 0, "shrinkB": 1},
    )


def map_axes(axes: Axes, grid: Manifold, colors: np.ndarray, *, h_name: bool = True) -> None:
    """Draw cells (H, A, 3) over θ and h."""
    start = np.rad2deg(grid.theta_start)
    bottom, top = 100 * grid.profile.h_min, 100 * grid.profile.h_max
    axes.imshow(
        colors,
        origin="lower",
        aspect="auto",
        interpolation="nearest",
        extent=(start, start + 360, bottom, top),
    )
    axes.set(xticks=np.arange(-180, 181, 90), xlim=(-180, 180), xlabel="θ (°)")
    if h_name:
        axes.set_ylabel("h (cm)")
    else:
        axes.set_yticklabels([])


def mark(axes: Axes, h: float, theta: float) -> None:
    """Mark a grasp (m, rad) on a map."""
    at = ([np.rad2deg(theta)], [100 * h])
    axes.plot(*at, "o", markersize=9, markerfacecolor="white", markeredgecolor="white")
    axes.plot(*at, "o", markersize=7, markerfacecolor="none", markeredgecolor=PICK, markeredgewidth=2)


def legend(figure: Figure, reason: np.ndarray, place: tuple[float, float], columns: int = 1) -> None:
    """Explain the colours of the reasons that occur; ``place`` is the legend's upper left (inches)."""
    width, height = figure.get_size_inches()
    seen = [r for r in reversed(Reason) if (reason == r).any()]
    figure.legend(
        handles=[Patch(color=r.color, label=r.label) for r in seen],
        loc="upper left",
        bbox_to_anchor=(place[0] / width, place[1] / height),
        ncols=columns,
        frameon=False,
        handlelength=1,
        handleheight=1,
        borderaxespad=0,
    )
