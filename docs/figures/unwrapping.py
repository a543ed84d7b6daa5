"""The figures about the map itself: the paper's figures 3, 5 and 6."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import ConnectionPatch

from app.render.palette import INK, PICK, rgb
from docs.figures.models import SurfacePaint, cells_paint, floor, map_colors, object_body, with_seam
from docs.figures.render import Camera
from docs.figures.style import board, label, legend, map_axes, mark, new, photo, save
from symgrasp.feasibility.create import create_map
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.object.manifold import ROLLS, turn_text, wrap
from symgrasp.object.profile import Profile
from symgrasp.planners.planning import plan_sequential
from symgrasp.poses import Array
from symgrasp.reason import Reason
from symgrasp.scene.scene import Scene

__all__ = ["maps_slide", "soda_can", "turn_shifts"]

ALUMINIUM = np.array([226, 229, 233]) / 255
DOT = 0.0026
"""Radius (m) of the points on the can."""

Point = tuple[float, float]

TASKS = np.array([rgb(color) for color in ("#eceef1", "#c7e9d2", "#74c69a", Reason.FEASIBLE.color)]) / 255
"""Colours of cells that so many tasks allow."""

TURNS = np.deg2rad([0, 60, 120])


def soda_can() -> None:
    """Figure 3: the points of a soda can's surface, and the same points unwrapped."""
    profile = Scene.load("soda_can").profile
    h, theta = _lattice(profile)
    colors = _hues(theta)
    figure = new(10, 4.6)
    camera = Camera((0, 0, 0.0565), 0, 20, 0.125, 14)
    can = object_body(profile, np.eye(4), _dotted(profile, h, theta, colors))
    axes, picture = photo(figure, (0.2, 0.1, 3.6, 4.4), [can, floor(0)], camera)
    pick = int(np.argmin((h - 0.0725) ** 2 + (0.0331 * (theta + 0.5)) ** 2))
    r = float(profile.radius(h[pick]))
    point = np.array([r * np.cos(theta[pick]), r * np.sin(theta[pick]), h[pick]])
    x, y, z = 100 * point
    label(axes, picture, point, f"p = ({x:.1f}, {y:.1f}, {z:.1f}) cm", (-40, 78))

    flat = board(figure, (5.1, 0.75, 4.7, 3.45))
    flat.scatter(np.rad2deg(theta), 100 * h, s=42, c=colors, linewidths=0)
    flat.set(xlim=(-180, 180), ylim=(0, 100 * profile.h_max), xticks=np.arange(-180, 181, 90))
    flat.set(xlabel="θ (°)", ylabel="h (cm)")
    at = (np.rad2deg(theta[pick]), 100 * h[pick])
    text = f"f(p) = ({at[1]:.1f} cm, {at[0]:.0f}°)"
    box = {"boxstyle": "round,pad=0.3", "facecolor": "white", "edgecolor": INK, "linewidth": 0.8}
    flat.annotate(text, at, (58, 42), textcoords="offset points", ha="center", bbox=box,
                  arrowprops={"arrowstyle": "-", "color": INK, "linewidth": 0.8, "shrinkB": 4})  # fmt: skip
    for ax, where in ((axes, picture.pixel(point)), (flat, at)):
        ax.plot(*where, "o", markersize=9, markerfacecolor="none", markeredgecolor=INK, markeredgewidth=1.4)
    for y, start, end, name in ((2.6, 3.85, 4.45, "f"), (2.1, 4.45, 3.85, "f⁻¹")):
        _arrow(figure, (start, y), (end, y))
        figure.text(4.15 / 10, (y + 0.12) / 4.6, name, ha="center", style="italic", fontsize=11)
    save(figure, "soda_can.png")


def turn_shifts() -> None:
    """Figure 5: the bottle turns, and its map shifts by the same angle."""
    scene = Scene.load("bottle_on_table")
    first = create_map(scene)
    roll = 0
    figure = new(10, 6.2)
    for k, delta in enumerate(TURNS):
        shifted = first.shift(delta)
        grid, colors = shifted.manifold, map_colors(shifted, roll)
        pose = shifted.T_world_object
        paint = with_seam(cells_paint(grid, colors), scene.profile)
        left = 0.75 + 3.15 * k
        camera = Camera((0.55, 0, 0.147), 60, 16, 0.31, 14)
        box = (left, 2.95, 2.75, 3.0)
        axes, picture = photo(figure, box, [object_body(scene.profile, pose, paint), floor(0)], camera)
        at_seam = (pose @ [scene.profile.radius(0.1), 0, 0.1, 1])[:3]
        if picture.camera.axes()[2] @ pose[:3, 0] > 0:
            label(axes, picture, at_seam, "θ = 0", (62 if k else -62, 0))
        flat = board(figure, (left, 0.95, 2.75, 1.7))
        map_axes(flat, grid, colors, h_name=k == 0)
        # What was at θ = 0 before the turn is at -δ now.
        seam = float(np.rad2deg(wrap(-delta)))
        flat.axvline(seam, color="white", linewidth=2.5)
        flat.axvline(seam, color=INK, linewidth=1.2, linestyle=(0, (4, 2)))
        anew = create_map(scene.with_task(replace(scene.task(), T_world_object=pose)), manifold=grid)
        differing = np.count_nonzero(anew.reason != shifted.reason)
        turned = f"turned by δ = {turn_text(delta)}" if k else "as it stands"
        note = f"computed anew: {differing} of {anew.reason.size} cells differ" if k else ""
        figure.text((left + 1.375) / 10, 6.0 / 6.2, turned, ha="center", fontsize=10)
        flat.set_title(note, fontsize=8)
    legend(figure, first.reason[roll], (0.75, 0.38), columns=5)
    save(figure, "turn_shifts.png")


def maps_slide() -> None:
    """Figure 6: the maps of three tasks slide over each other until one grasp serves all."""
    scene = Scene.load("pick_pour_place")
    plan = plan_sequential(scene)
    grasp = plan.tasks[0].holds[0].grasp
    roll = ROLLS.index(grasp.roll)
    maps = [create_map(scene, task=task.name) for task in plan.tasks]
    figure = new(10, 7.4)
    slid: list[FeasibilityMap] = []
    for k, (task, m) in enumerate(zip(plan.tasks, maps, strict=True)):
        slid.append(m.shift(task.delta))
        bottom = 5.75 - 1.6 * k
        before, after = board(figure, (0.75, bottom, 3.9, 1.25)), board(figure, (5.3, bottom, 3.9, 1.25))
        own = float(wrap(grasp.theta + task.delta))
        for axes, shown, theta in ((before, m, own), (after, slid[k], grasp.theta)):
            map_axes(axes, shown.manifold, map_colors(shown, roll), h_name=axes is before)
            mark(axes, grasp.h, theta)
            if k < 2 or axes is after:
                axes.set(xlabel="", xticklabels=[])
        before.set_title(task.name, loc="left", pad=3)
        after.set_title(f"turned by δ = {turn_text(task.delta)}", loc="left", pad=3)
    seen = np.concatenate([m.reason[roll] for m in maps])
    legend(figure, seen, (0.75, 1.7), columns=2)
    common = board(figure, (5.3, 0.55, 3.9, 1.25))
    count = np.sum([m.feasible[roll] for m in slid], axis=0)
    map_axes(common, slid[0].manifold, TASKS[count])
    mark(common, grasp.h, grasp.theta)
    common.set_title("over each other", loc="left", pad=3)  # short of the line that joins the marks
    common.set_xlabel("θ (°); the greener, the more tasks")
    for upper, lower in pairwise([*figure.axes[1:6:2], common]):
        at = np.rad2deg(grasp.theta), 100 * grasp.h
        join = {"coordsA": "data", "coordsB": "data", "axesA": upper, "axesB": lower}
        figure.add_artist(ConnectionPatch(at, at, **join, color=PICK, linewidth=1.6, shrinkA=6, shrinkB=6))
    save(figure, "maps_slide.png")


def _lattice(profile: Profile) -> tuple[Array, Array]:
    """Return points (n,) h and θ, about 9 mm apart all over the surface."""
    heights = np.linspace(profile.h_min, profile.h_max, 15)[1:-1]
    theta = wrap(np.arange(24) * (2 * np.pi / 24) + np.pi / 24)
    h, t = np.meshgrid(heights, theta, indexing="ij")
    return h.ravel(), t.ravel()


def _hues(theta: Array) -> Array:
    """Return colours (n, 3) that go round with the angle."""
    return 0.88 * mpl.colormaps["hsv"](np.mod(theta / (2 * np.pi), 1))[:, :3]


def _dotted(profile: Profile, h: Array, theta: Array, colors: Array) -> SurfacePaint:
    def paint(at_h: Array, at_theta: Array) -> Array:
        painted = np.tile(ALUMINIUM, (len(at_h), 1))
        for k in range(len(h)):
            around = wrap(at_theta - theta[k]) * profile.radius(at_h)
            painted[(at_h - h[k]) ** 2 + around**2 < DOT**2] = colors[k]
        return painted

    return paint


def _arrow(figure: Figure, start: Point, end: Point) -> None:
    """Draw an arrow between points given in inches."""
    size = figure.get_size_inches()
    look = {"arrowstyle": "-|>", "color": INK, "linewidth": 1.2, "mutation_scale": 14}
    ends = {"xyA": np.array(start) / size, "xyB": np.array(end) / size}
    figure.add_artist(ConnectionPatch(**ends, coordsA="figure fraction", **look))
