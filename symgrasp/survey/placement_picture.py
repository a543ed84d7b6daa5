"""The picture of a placement: bases from above, with tasks and obstacles."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from symgrasp.errors import printable
from symgrasp.poses import Array
from symgrasp.scene.parts import Obstacle
from symgrasp.scene.scene import Scene
from symgrasp.survey.placement import Base, Placement

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["draw_placement"]

ARROW = 0.12
"""Length (m) of the arrow that shows where a base looks."""

BESIDE = 0.1
"""How far (m) beyond the bases rectangles are drawn in which none stands."""


def draw_placement(scene: Scene, robot: str, found: Placement) -> Figure:
    """Draw the bases of a robot that were tried, at each place the turn with most margin, and the proposals.

    Args:
        scene: the scene.
        robot: the robot.
        found: what was found.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.4, 7.0), layout="constrained")
    axes: Any = figure.subplots()
    for obstacle in scene.obstacles:
        outline = _outline(obstacle)
        if outline is not None:
            axes.fill(*outline.T, facecolor="#eeeeee", edgecolor="#9a9a9a", lw=0.8, zorder=0)
            axes.annotate(
                _plain(obstacle.name),
                outline.mean(axis=0),
                color="#7a7a7a",
                ha="center",
                fontsize=8,
                zorder=1,
            )
    tried = np.array([(base.x, base.y) for base in found.margins])
    low, high = tried.min(axis=0) - BESIDE, tried.max(axis=0) + BESIDE
    for k, out in enumerate(found.keep_out):  # of a large rectangle, what is near the bases
        (x0, y0), (x1, y1) = (np.clip(corner, low, high) for corner in zip(out.x, out.y, strict=True))
        corners = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
        label = "no base may stand here" if not k else None
        axes.fill(*zip(*corners, strict=True), fc="none", ec="#cb3b2c55", hatch="//", lw=0, label=label)
    best: dict[tuple[float, float], float] = {}
    for base, margin in found.margins.items():
        place = (base.x, base.y)
        best[place] = max(best.get(place, -1.0), np.nan_to_num(margin, nan=-1.0))
    places, values = np.array(list(best)), 1e3 * np.array(list(best.values()))
    none = values < 0
    axes.scatter(*places[none].T, marker="x", s=18, color="#b0b0b0", lw=0.8, label="no plan", zorder=2)
    drawn = axes.scatter(*places[~none].T, c=values[~none], cmap="viridis", s=42, vmin=0, zorder=3)
    figure.colorbar(drawn, ax=axes, label="margin of the best plan (mm)")
    for task in scene.tasks.values():
        x, y = task.T_world_object[:2, 3]
        axes.plot(x, y, "*", ms=13, mfc="#ffd24d", mec="#3b3b3b", zorder=4)
        axes.annotate(_plain(task.name), (x, y), (5, 5), textcoords="offset points", fontsize=9, zorder=5)
    for number, own in enumerate(found.proposals, start=1):
        _mark(axes, own.base, str(number), "#cb3b2c")
    _mark(axes, Base.of(scene.robots[robot].T_world_base), "now", "#3b3b3b")
    axes.set(aspect="equal", xlabel="x (m)", ylabel="y (m)")
    axes.set_title(_plain(f"{scene.name}: where {robot} may stand for all tasks"))
    if none.any() or found.keep_out:
        axes.legend(loc="upper right", fontsize=8)
    return figure


def _mark(axes: Any, base: Base, text: str, color: str) -> None:
    """Draw a base as an arrow along its x axis."""
    along = ARROW * np.array([np.cos(np.deg2rad(base.yaw_deg)), np.sin(np.deg2rad(base.yaw_deg))])
    end = (base.x + along[0], base.y + along[1])
    arrow = {"arrowstyle": "-|>", "color": color, "lw": 1.6, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", end, (base.x, base.y), arrowprops=arrow, zorder=6)
    axes.plot(base.x, base.y, "o", ms=9, mfc="none", mec=color, mew=1.6, zorder=6)
    offset = (-7, -13)
    axes.annotate(
        text, (base.x, base.y), offset, textcoords="offset points", color=color, weight="bold", zorder=7
    )


def _outline(obstacle: Obstacle) -> Array | None:
    """Return the outline (n, 2) of an obstacle from above; None of meshes and URDFs, which have no sizes."""
    from scipy.spatial import ConvexHull

    if obstacle.kind == "box":
        half = np.array(obstacle.size) / 2
        corners = half * (2 * np.indices((2, 2, 2)).reshape(3, -1).T - 1)
    elif obstacle.kind in ("cylinder", "sphere"):
        turn = np.linspace(0, 2 * np.pi, 33)[:-1]
        radius, half = obstacle.size[0], obstacle.size[1] / 2 if obstacle.kind == "cylinder" else 0.0
        ring = radius * np.column_stack([np.cos(turn), np.sin(turn)])
        corners = np.concatenate([np.column_stack([ring, np.full(32, z)]) for z in (-half, half)])
        if obstacle.kind == "sphere":
            return ring + obstacle.T_world_obstacle[:2, 3]
    else:
        return None
    T = obstacle.T_world_obstacle
    above = (corners @ T[:3, :3].T + T[:3, 3])[:, :2]
    return above[ConvexHull(above).vertices]


def _plain(text: str) -> str:
    return printable(text).replace("$", r"\$")
