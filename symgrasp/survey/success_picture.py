"""The picture of how probable it is that the grasps of a map are feasible."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from symgrasp.errors import printable
from symgrasp.survey.success import SuccessMap

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["draw_success"]


def draw_success(found: SuccessMap) -> Figure:
    """Draw the probability of every cell, roll by roll; a line is around what is feasible where expected."""
    from matplotlib.figure import Figure

    m = found.nominal
    grid = m.manifold
    figure = Figure(figsize=(9.4, 3.8), layout="constrained")
    panels: Any = figure.subplots(1, 2, sharey=True)
    start = np.rad2deg(grid.theta_start)
    extent = (start, start + 360, 100 * grid.profile.h_min, 100 * grid.profile.h_max)
    drawn: Any = None
    for roll, (axes, name) in enumerate(zip(panels, ("roll 0°", "roll 180°"), strict=True)):
        share = 100 * found.probability[roll]
        look = {"origin": "lower", "aspect": "auto", "extent": extent}
        drawn = axes.imshow(share, cmap="viridis", vmin=0, vmax=100, interpolation="none", **look)
        if m.feasible[roll].any() and not m.feasible[roll].all():
            # Each cell as several, so that the line follows their edges.
            fine = np.kron(m.feasible[roll], np.ones((8, 8)))
            axes.contour(fine, levels=[0.5], colors="#e6007e", linewidths=1.0, origin="lower", extent=extent)
        axes.set(xlabel="θ (°)", title=name, xticks=np.arange(-180, 181, 60))
    panels[0].set_ylabel("h (cm)")
    figure.colorbar(drawn, ax=list(panels), label="feasible with probability (%)")
    title = f"{m.scene} · {m.task} · {m.arm} · {len(found.feasible)} draws"
    figure.suptitle(printable(title).replace("$", r"\$"))
    return figure
