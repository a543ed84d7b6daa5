"""The paper's figure 7: handprints that collide, and where hill climbing takes them."""

from __future__ import annotations

import numpy as np
from matplotlib.patches import Patch

from app.render.palette import INK, OVERLAP, PRINTS
from app.render.prints import print_index
from docs.figures.holding import WOOD
from docs.figures.models import cells_paint, object_body, robot
from docs.figures.render import Body, Camera
from docs.figures.style import board, new, photo, save
from symgrasp.feasibility.create import create_map
from symgrasp.planners.bimanual import ClimbStep
from symgrasp.planners.planning import plan_bimanual
from symgrasp.scene.scene import Scene

__all__ = ["handprints"]

SEED = 20327
"""A start with both hands at one height, one across the other."""

CLOSE = 34
"""Lowest row that the maps show."""


def handprints() -> None:
    """Figure 7: the hands before and after the climb, on the log and on the map."""
    scene = Scene.load("log_two_robots")
    task, grid = scene.task(), scene.manifold
    arms = [scene.arm(name) for name in task.arms]
    maps = {(task.name, arm.name): create_map(scene, arm=arm.name) for arm in arms}
    trace: list[ClimbStep] = []
    plan_bimanual(scene, maps=maps, method="hill_climb", seed=SEED, trace=trace)
    climb = [step for step in trace if step.restart == trace[-1].restart]
    figure = new(10, 6.6)
    ends = [(climb[0], "at first"), (climb[-1], f"after {len(climb) - 1} steps")]
    for k, (step, when) in enumerate(ends):
        prints = [
            arm.handprint(grid, cell.row, cell.roll).on(grid, cell.column)
            for arm, cell in zip(arms, step.cells, strict=True)
        ]
        index = print_index(prints)
        colors = np.where(index[..., None] > 0, PRINTS[index] / 255, WOOD)
        bodies = [object_body(scene.profile, task.T_world_object, cells_paint(grid, colors))]
        for color, arm, cell in zip(PRINTS[1:], arms, step.cells, strict=False):
            witness = maps[task.name, arm.name].witness(cell)
            assert witness, "hands climb over feasible cells"
            values = arm.robot_values(witness.q, witness.opening)
            hand = robot(arm.robot, values, arm.hand.links)
            bodies += [Body(body.corners, body.normals, 0.35 + 0.65 * color / 255) for body in hand]
        left = 0.75 + 4.7 * k
        photo(figure, (left - 0.1, 2.95, 4.4, 3.2), bodies, Camera((0.40, 0, 0.42), -90, 8, 0.42))
        figure.text((left + 2.1) / 10, 6.28 / 6.6, when, ha="center", fontsize=10)
        axes = board(figure, (left, 0.8, 4.2, 2.0))
        bottom = 100 * (grid.profile.h_min + CLOSE * grid.dh)
        extent = (-180, 180, bottom, 100 * grid.profile.h_max)
        axes.imshow(colors[CLOSE:], origin="lower", aspect="auto", interpolation="nearest", extent=extent)
        axes.set(xticks=np.arange(-180, 181, 90), xlabel="θ (°)")
        axes.set_title(f"{step.collisions} cells shared", fontsize=9)
        if k == 0:
            axes.set_ylabel("h (cm)")
        for arm in range(len(arms)):
            path = [s.cells[arm] for s in climb[: 1 if k == 0 else None]]
            theta = np.rad2deg(np.unwrap(grid.theta[[cell.column for cell in path]]))
            h = 100 * grid.h[[cell.row for cell in path]]
            axes.plot(theta, h, "-", color="white", linewidth=3.5)
            axes.plot(theta, h, "-", color=INK, linewidth=1.4)
            axes.plot(theta[-1], h[-1], "o", color=INK, markeredgecolor="white", markersize=7)
    named = {**dict(enumerate((arm.name for arm in arms), start=1)), OVERLAP: "both"}
    patches = [Patch(color=tuple(PRINTS[k] / 255), label=name) for k, name in named.items()]
    figure.legend(handles=patches, loc="lower right", ncols=3, frameon=False, handlelength=1)
    save(figure, "handprints.png")
