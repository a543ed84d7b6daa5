"""The paper's figure 2: the coordinates of a point on an object of revolution."""

from __future__ import annotations

import numpy as np

from app.render.palette import INK, PICK
from docs.figures.models import floor, object_body
from docs.figures.render import Camera
from docs.figures.style import new, photo, save
from symgrasp.poses import Array
from symgrasp.scene.scene import Scene

__all__ = ["coordinates"]

GLASS = np.array([0.80, 0.86, 0.90])

H, THETA = 0.105, np.deg2rad(58)
"""Height (m) and angle of the point."""


def coordinates() -> None:
    """Figure 2: height along z, radius, and angle from the polar axis a, of a point of a bottle."""
    profile = Scene.load("bottle_on_table").profile
    figure = new(6, 5.6)
    bottle = object_body(profile, np.eye(4), lambda h, theta: np.tile(GLASS, (len(h), 1)))
    camera = Camera((0.02, 0.03, 0.145), 20, 24, 0.47, 14)
    axes, picture = photo(figure, (0.1, 0.1, 5.8, 5.4), [bottle, floor(0)], camera)
    r = float(profile.radius(H))
    out = np.array([np.cos(THETA), np.sin(THETA), 0.0])
    top, point = np.array([0.0, 0.0, H]), np.array([0.0, 0.0, H]) + r * out
    origin, foot, far = np.zeros(3), r * out, 0.13 * out

    def line(*points: Array, color: str = INK, style: str = "-", width: float = 1.4) -> None:
        axes.plot(*np.transpose([picture.pixel(p) for p in points]), style, color=color, linewidth=width)

    def arrow(start: Array, end: Array, name: str, offset: tuple[float, float]) -> None:
        look = {"arrowstyle": "-|>", "color": INK, "linewidth": 1.4, "mutation_scale": 14}
        axes.annotate("", picture.pixel(end), picture.pixel(start), arrowprops=look)
        write(end, name, offset)

    def write(at: Array, name: str, offset: tuple[float, float], color: str = INK) -> None:
        axes.annotate(
            name, picture.pixel(at), offset, textcoords="offset points",
            ha="center", va="center", style="italic", fontsize=13, color=color,
        )  # fmt: skip

    round_it = [np.array([r * np.cos(a), r * np.sin(a), H]) for a in np.linspace(-np.pi, np.pi, 121)]
    turn = [0.085 * np.array([np.cos(a), np.sin(a), 0.0]) for a in np.linspace(0, THETA, 31)]
    line(*round_it, style="--", width=1.0)
    arrow(origin, np.array([0.0, 0.0, profile.h_max + 0.035]), "z", (-10, 0))
    arrow(origin, np.array([0.13, 0.0, 0.0]), "a", (-10, -4))
    line(origin, far, style="--")
    line(*turn, color=PICK, width=2)
    write(turn[15], "θ", (0, -12), PICK)
    line(top, point, color=PICK, width=2)
    write(0.5 * (top + point), "r", (0, 10), PICK)
    line(foot, point, color=PICK, width=2)
    write(0.5 * (foot + point), "h", (10, 0), PICK)
    axes.plot(*picture.pixel(point), "o", markersize=8, markerfacecolor="white", markeredgecolor=PICK, mew=2)
    write(point, "x = (h, θ)", (44, 4))
    save(figure, "coordinates.png")
