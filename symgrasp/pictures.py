"""Pictures of maps, for files and notebooks."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

import numpy as np

from symgrasp.reason import Reason

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["draw_map", "to_png"]


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


def to_png(figure: Figure) -> bytes:
    """Render a figure as PNG."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=120)
    return buffer.getvalue()
