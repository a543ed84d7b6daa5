"""Pictures of maps, hands and objects by matplotlib, for files and notebooks."""

from __future__ import annotations

import io
import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from symgrasp.errors import printable, shortened
from symgrasp.feasibility.color_by import ColoredMap
from symgrasp.poses import Array
from symgrasp.reason import Reason

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from symgrasp.object.measure.measurement import Measurement

__all__ = ["draw_errors", "draw_map", "draw_object", "draw_openings", "to_png", "to_svg"]


def draw_map(
    coloured: ColoredMap,
    heights: tuple[float, float],
    theta_start: float,
    title: str,
    panels: Sequence[str],
    marks: Sequence[tuple[float, float]] = (),
) -> Figure:
    """Draw a coloured map with axes, and its legend or scale.

    Args:
        coloured: its index has the shape (panels, H, A).
        heights: bottom and top of the object (m).
        theta_start: angle (rad) where the grid begins.
        title: text above the panels.
        panels: text above each panel.
        marks: grasps (h, θ) (m, rad) to circle in all panels.
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    start = np.rad2deg(theta_start)
    bottom, top = 100 * heights[0], 100 * heights[1]
    figure = Figure(figsize=(2.6 + 4.2 * len(panels), 3.6), layout="constrained")
    axes = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    for panel, cells, name in zip(axes, coloured.colors[coloured.index], panels, strict=True):
        for turn in (0, 360):  # a shifted grid begins a little before -180°: its end comes round again
            extent = (start + turn, start + turn + 360, bottom, top)
            # "none" writes the cells as they are, so that an SVG stays crisp at any size.
            panel.imshow(cells, origin="lower", aspect="auto", extent=extent, interpolation="none")
        for h, theta in marks:
            panel.plot(np.rad2deg(theta), 100 * h, "o", ms=7, mew=2, mfc="none", mec="#e6007e", clip_on=False)
        panel.set(xlabel="θ (°)", title=_plain(name), xticks=np.arange(-180, 181, 60))
        panel.set(xlim=(-180, 180), ylim=(bottom, top))
    axes[0].set_ylabel("h (cm)")
    if coloured.scale:
        _, high, colors = coloured.scale
        mappable = ScalarMappable(Normalize(0, high), ListedColormap(list(colors / 255)))
        figure.colorbar(mappable, ax=list(axes), label=coloured.scale.label)
    patches = [
        Patch(color=color, label=f"{_plain(label, LONGEST_LABEL)} ({count})")
        for color, label, count in coloured.swatches
    ]
    figure.legend(handles=patches, loc="outside right center", frameon=False)
    figure.suptitle(_plain(title))
    return figure


def draw_errors(
    sizes: Sequence[tuple[int, int]], missed: Sequence[float], overstated: Sequence[float], title: str
) -> Figure:
    """Draw over the number of cells what maps get wrong.

    Args:
        sizes: heights and angles of n grids, in order of their cells.
        missed: (n,) feasible area that is called infeasible (% of the feasible area).
        overstated: (n,) infeasible area that is called feasible (% of the feasible area).
        title: text above the picture.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    axes = figure.subplots()
    cells = [heights * angles for heights, angles in sizes]
    axes.plot(cells, np.add(missed, overstated), "k-o", label="all that is wrong")
    axes.plot(cells, missed, "-s", color="#0072b2", label="feasible, called infeasible")
    axes.plot(cells, overstated, "-^", color="#d55e00", label="infeasible, called feasible")
    axes.set(xscale="log", ylim=(0, None), ylabel="% of the feasible area", title=_plain(title))
    axes.set_xticks(cells, [f"{heights} × {angles}" for heights, angles in sizes])
    axes.set_xlabel("cells along × around the object")
    axes.minorticks_off()
    axes.legend(frameon=False)
    return figure


def draw_openings(
    h: Array, diameter: Array, names: Sequence[str], openings: Array, reason: np.ndarray
) -> Figure:
    """Draw the object's diameter and the hands' openings over the height, and a strip of reasons a hand.

    Args:
        h: (n,) heights (m), evenly spaced.
        diameter: (n,) of the object (m).
        names: of the m hands.
        openings: (m, n) openings (m).
        reason: (m, n) of `Reason`; `Reason.FEASIBLE` where the hand fits.
    """
    from matplotlib.colors import BoundaryNorm, ListedColormap
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    figure = Figure(figsize=(9, 4.2), layout="constrained")
    wide, strips = figure.subplots(1, 2, sharey=True, width_ratios=(3, 0.35 * len(names) + 0.4))
    wide.fill_betweenx(100 * h, 0, 1e3 * diameter, color="#dcdcdc", label="object")
    wide.plot(1e3 * diameter, 100 * h, color="#3b3b3b")
    for k, name in enumerate(names):
        (line,) = wide.plot(1e3 * openings[k], 100 * h, linewidth=1, linestyle=":")
        held = np.where(reason[k] == Reason.FEASIBLE, 1e3 * openings[k], np.nan)
        # Hands often open equally far; the thinner line lies on the thicker one.
        width = 3 * (len(names) - k)
        wide.plot(
            held,
            100 * h,
            linewidth=width,
            color=line.get_color(),
            label=f"{_plain(name, LONGEST_LABEL)} holds",
        )
    wide.set(xlabel="opening (mm)", ylabel="h (cm)", xlim=(0, None))
    wide.legend(frameon=False)
    strips.imshow(
        reason.T,
        origin="lower",
        aspect="auto",
        interpolation="nearest",
        extent=(-0.5, len(names) - 0.5, 100 * h[0], 100 * h[-1]),
        cmap=ListedColormap([r.color for r in Reason]),
        norm=BoundaryNorm(np.arange(len(Reason) + 1) - 0.5, len(Reason)),
    )
    for k in range(1, len(names)):
        strips.axvline(k - 0.5, color="white", linewidth=3)
    strips.set_xticks(range(len(names)), [_plain(name, LONGEST_LABEL // 2) for name in names], rotation=90)
    seen = [r for r in reversed(Reason) if (reason == r).any()]
    labels = {Reason.FEASIBLE: "fits"}
    patches = [Patch(color=r.color, label=labels.get(r, r.label)) for r in seen]
    figure.legend(handles=patches, loc="outside right center", frameon=False)
    return figure


def draw_object(points: Array, measurement: Measurement | None, title: str) -> Figure:
    """Draw a profile, and beside it how far the mesh it was measured from deviates from it.

    Args:
        points: (n, 2) knots [h, r] (m).
        measurement: of the mesh, if there is one.
        title: text above the panels.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 4.2) if measurement else (4, 4.2), layout="constrained")
    if measurement:
        outline, panel = figure.subplots(1, 2, sharey=True, width_ratios=(1, 2))
        limit = 1e3 * max(measurement.worst[0], 1e-5)
        image = panel.imshow(
            1e3 * measurement.deviation,
            origin="lower",
            aspect="auto",
            interpolation="nearest",
            extent=(-180, 180, 100 * measurement.heights[0], 100 * measurement.heights[-1]),
            cmap="RdBu_r",
            vmin=-limit,
            vmax=limit,
        )
        panel.set(xlabel="θ (°)", xticks=np.arange(-180, 181, 60))
        panel.set_title(f"deviation, at most {measurement.worst[0] * 1e3:.2g} mm", fontsize="medium")
        figure.colorbar(image, ax=panel, label="mm outside the profile")
    else:
        outline = figure.subplots()
    h, r = 100 * points[:, 0], 1e3 * points[:, 1]
    outline.fill_betweenx(h, -r, r, color="#dcdcdc")
    outline.plot(r, h, marker=".", color="#3b3b3b")
    outline.plot(-r, h, color="#3b3b3b")
    outline.set(xlabel="r (mm)", ylabel="h (cm)")
    figure.suptitle(_plain(title))
    return figure


LONGEST_NAME = 80
"""Most characters of a text that holds a name: more would leave no room for the picture."""


LONGEST_LABEL = 30
"""Most characters of a label beside the picture."""


def _plain(text: str, most: int = LONGEST_NAME) -> str:
    """Return a text as Matplotlib shows it as it is: no formula, one line of bearable length."""
    return shortened(printable(text), most).replace("$", r"\$")


def to_png(figure: Figure) -> bytes:
    """Render a figure as PNG."""
    return _rendered(figure, "png", dpi=120)


def to_svg(figure: Figure) -> bytes:
    """Render a figure as SVG, the same bytes every time."""
    from matplotlib import rc_context

    with rc_context({"svg.hashsalt": "symgrasp", "image.composite_image": False}):
        return _rendered(figure, "svg", metadata={"Date": None})


def _rendered(figure: Figure, kind: str, **options: Any) -> bytes:
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        # Names may have letters that the font has not: their place stays empty.
        warnings.filterwarnings("ignore", r"Glyph \d+", UserWarning)
        figure.savefig(buffer, format=kind, **options)
    return buffer.getvalue()
