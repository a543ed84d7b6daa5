"""The figures with whole robots: the paper's figures 1, 4 and 8, and the tutorial's."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from app.render.palette import INK, PRINTS
from docs.figures.models import (
    cells_paint,
    floor,
    map_colors,
    object_body,
    obstacles,
    robot,
    robots,
    with_seam,
)
from docs.figures.render import Camera
from docs.figures.style import IMAGES, board, label, legend, map_axes, mark, new, photo, save
from docs.pages import refresh
from symgrasp.feasibility.cell import Cell
from symgrasp.feasibility.create import create_map
from symgrasp.object.manifold import ROLLS, Manifold, turn_text
from symgrasp.plan.plan import Hold, Plan
from symgrasp.planners.planning import plan_bimanual, plan_sequential
from symgrasp.scene.scene import Scene

__all__ = ["log_four_robots", "log_two_humanoids", "pick_pour_place", "tutorial", "wine_bottle"]

GLAZE = np.array([60, 120, 160]) / 255
WOOD = np.array([214, 178, 131]) / 255
HANDS = PRINTS[1:-1]


def log_two_humanoids() -> None:
    """Figure 1: two humanoids hold a long log, and the prints of their hands share no cell."""
    _log("log_two_humanoids", Camera((0, 0, 0.88), -48, 16, 4.6), (62, 62, 108, 62))


def log_four_robots() -> None:
    """Figure 1 with four arms."""
    _log("log_four_robots", Camera((0.02, 0, 0.27), -64, 25, 3.3), (62, 62, 62, 62))


def _log(name: str, camera: Camera, away: Sequence[int]) -> None:
    """Draw robots that hold a log, with labels so far away from their hands, and the prints on the log."""
    scene = Scene.load(name)
    (task,) = plan_bimanual(scene).tasks
    pose, grid = task.object_pose_turned.array(), scene.manifold
    fine = Manifold(grid.profile, 4 * grid.heights, 4 * grid.angles)
    colors = np.tile(WOOD, (fine.heights, fine.angles, 1))
    for hold, color in zip(task.holds, HANDS, strict=True):
        colors[_print(scene, hold, fine)] = color / 255
    log = object_body(scene.profile, pose, cells_paint(grid, colors))

    figure = new(10, 6.6)
    bodies = [*robots(scene, task), *obstacles(scene, without=("floor",)), log, floor(0)]
    axes, picture = photo(figure, (0, 1.75, 10, 4.85), bodies, camera)
    for hold, distance in zip(task.holds, away, strict=True):
        point = (pose @ [*grid.contact(hold.grasp.h, hold.grasp.theta), 1.0])[:3]
        offset = (0, distance if hold.grasp.theta > 0 else -distance)
        label(axes, picture, point, hold.arm, offset)

    unwrapped = board(figure, (0.75, 0.55, 8.9, 1.05))
    extent = (0, 100 * scene.profile.h_max, -180, 180)
    unwrapped.imshow(
        colors.swapaxes(0, 1), origin="lower", aspect="auto", interpolation="nearest", extent=extent
    )
    unwrapped.set(xlabel="h (cm)", ylabel="θ (°)", yticks=(-180, 0, 180))
    for hold in task.holds:
        text = {"ha": "center", "va": "center", "fontsize": 8}
        box = {"boxstyle": "round,pad=0.2", "facecolor": "white", "edgecolor": "none", "alpha": 0.85}
        below = -105 if hold.grasp.theta > 0 else 105
        unwrapped.text(100 * hold.grasp.h, below, hold.arm, **text, bbox=box)
    save(figure, f"{name}.png")


def wine_bottle() -> None:
    """Figure 4: every cell of a wine bottle tried, on the bottle and unwrapped."""
    scene = Scene.load("bottle_on_table")
    task, grid = scene.task(), scene.manifold
    the_map = create_map(scene)
    roll = 0
    cell = Cell(roll, *grid.cell(0.137, np.deg2rad(150)))
    witness = the_map.witness(cell)
    assert witness, "the picture shows a grasp"
    arm = scene.arm()
    colors = map_colors(the_map, roll)
    bottle = object_body(scene.profile, task.T_world_object, cells_paint(grid, colors))

    figure = new(10, 4.4)
    things = [*obstacles(scene), bottle, floor(-0.04)]
    holding = [*robot(arm.robot, arm.robot_values(witness.q, witness.opening)), *things]
    photo(figure, (0, 0, 4.3, 4.4), holding, Camera((0.33, -0.02, 0.3), 62, 20, 1.12))
    photo(figure, (4.3, 0, 1.75, 4.4), [bottle, floor(0)], Camera((0.55, 0, 0.145), 150, 14, 0.165, 14))
    axes = board(figure, (6.65, 1.25, 3.15, 2.85))
    map_axes(axes, grid, colors)
    mark(axes, float(grid.h[cell.row]), float(grid.theta[cell.column]))
    legend(figure, the_map.reason[roll], (6.65, 0.75), columns=2)
    save(figure, "wine_bottle.png")


def pick_pour_place() -> None:
    """Figure 8: one grasp from the first task to the last."""
    scene = Scene.load("pick_pour_place")
    plan = plan_sequential(scene)
    figure = new(10, 4.2)
    for k, task in enumerate(plan.tasks):
        (hold,) = task.holds
        the_map = create_map(scene, task=task.name).shift(task.delta)
        colors = map_colors(the_map, ROLLS.index(hold.grasp.roll))
        paint = with_seam(cells_paint(the_map.manifold, colors), scene.profile)
        thing = object_body(scene.profile, task.object_pose_turned.array(), paint)
        bodies = [*robots(scene, task), *obstacles(scene), thing, floor(-0.04)]
        box = (3.35 * k, 0.5, 3.3, 3.7)
        photo(figure, box, bodies, Camera((0.36, 0.01, 0.33), -14, 20, 1.14))
        turned = f", bottle turned by {turn_text(task.delta)}" if k else ""
        figure.text(
            (3.35 * k + 1.65) / 10, 0.09, f"{task.name}{turned}", ha="center", va="center", fontsize=10
        )
    (hold,) = plan.tasks[0].holds
    grasp = f"the same grasp in all: h = {100 * hold.grasp.h:.1f} cm, θ = {np.rad2deg(hold.grasp.theta):.1f}°"
    figure.text(0.5, 0.02, grasp, ha="center", va="bottom", color=INK, fontsize=9)
    save(figure, "pick_pour_place.png")


def tutorial() -> None:
    """The tutorial's pictures: those that its commands write, and its plan."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        refresh(IMAGES.parent / "tutorial.md", folder)
        for path in folder.glob("*.png"):
            shutil.copy(path, IMAGES / f"tutorial_{path.name}")
        plan = Plan.load(folder / "plan.json")
    scene = Scene.from_content(plan.scene.content)
    figure = new(10, 4.6)
    for k, task in enumerate(plan.tasks):
        pose = task.object_pose_turned.array()
        vase = object_body(scene.profile, pose, lambda h, _: np.tile(GLAZE, (len(h), 1)))
        bodies = [*robots(scene, task), *obstacles(scene), vase, floor(-0.04)]
        photo(figure, (5.05 * k, 0.35, 4.95, 4.25), bodies, Camera((0.4, 0.1, 0.4), -108, 18, 1.4))
        figure.text((5.05 * k + 2.5) / 10, 0.03, task.name, ha="center", fontsize=10)
    save(figure, "tutorial_plan.png")


def _print(scene: Scene, hold: Hold, grid: Manifold) -> np.ndarray:
    """Return the cells (H, A) under the hand that holds."""
    row, column = grid.cell(hold.grasp.h, hold.grasp.theta)
    handprint = scene.arm(hold.arm).handprint(grid, row, ROLLS.index(hold.grasp.roll))
    return handprint.on(grid, column)
