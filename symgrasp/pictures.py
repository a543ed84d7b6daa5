"""Pictures of maps, for files and notebooks."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from symgrasp.measure import Measurement
from symgrasp.poses import Array
from symgrasp.reason import Reason

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["draw_map", "draw_object", "draw_openings", "to_png"]


def draw_map(reason: np.ndarray, heights: tuple[float, float], theta_start: float, title: str) -> Figure:
    """Draw a map, one panel for each roll, with a legend of reasons and counts.

    Args:
        reason: (rolls, heights, angles) of `Reason`.
        heights: bottom and top of the object (m).
        theta_start: angle (rad) where the grid begins.
        title: text above the panels.
    """
    from matplotlib.colors import BoundaryNorm, ListedColormap
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    colors = ListedColormap([r.color for r in Reason])
    norm = BoundaryNorm(np.arange(len(Reason) + 1) - 0.5, len(Reason))
    start = np.rad2deg(theta_start)
    extent = (start, start + 360, 100 * heights[0], 100 * heights[1])
    figure = Figure(figsize=(11, 3.6), layout="constrained")
    axes = figure.subplots(1, len(reason), sharey=True, squeeze=False)[0]
    for panel, cells, name in zip(axes, reason, ("roll 0°", "roll 180°"), strict=True):
        panel.imshow(cells, origin="lower", aspect="auto", extent=extent, cmap=colors, norm=norm)
        panel.set(xlabel="θ (°)", title=name, xticks=np.arange(-180, 181, 60), xlim=extent[:2])
    axes[0].set_ylabel("h (cm)")
    patches = [
        Patch(color=r.color, label=f"{r.label} ({np.count_nonzero(reason == r)})")
        for r in reversed(Reason)
        if (reason == r).any()
    ]
    figure.legend(handles=patches, loc="outside right center", frameon=False)
    figure.suptitle(title)
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
        wide.plot(held, 100 * h, linewidth=width, color=line.get_color(), label=f"{name} holds")
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
    strips.set_xticks(range(len(names)), names, rotation=90)
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
    figure.suptitle(title)
    return figure


def to_png(figure: Figure) -> bytes:
    """Render a figure as PNG."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=120)
    return buffer.getvalue()
