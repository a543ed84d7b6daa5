"""The maps of a scene: by the exact engine, or as Algorithm 1 is written; and their cells explained."""

from __future__ import annotations

from contextlib import nullcontext
from typing import Literal

import numpy as np

from symgrasp.feasibility.algorithm1 import create_map_reference
from symgrasp.feasibility.cell import Cell
from symgrasp.feasibility.exact import ExactEngine
from symgrasp.feasibility.explain import Explanation, explain
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.ik import ClosedFormIK, solver_for
from symgrasp.object.manifold import Manifold
from symgrasp.progress import Progress
from symgrasp.robot.robot import Arm
from symgrasp.scene.parts import Task
from symgrasp.scene.scene import Scene
from symgrasp.world import BulletWorld

__all__ = ["MapMaker", "Method", "create_map"]

Method = Literal["exact", "reference"]
"""How a map is computed: both give the same feasible cells."""


class MapMaker:
    """Computes maps of one scene, and keeps what belongs to its arms, obstacles and grid.

    Moving or turning the object rebuilds nothing of that.

    Args:
        world: a world of the scene's robots, obstacles and object.
        scene: the scene, for its arms and settings.
    """

    def __init__(self, world: BulletWorld, scene: Scene) -> None:
        self.world, self.scene = world, scene
        self._engines: dict[str, ExactEngine | None] = {}
        self._solvers: dict[str, ClosedFormIK] = {}

    def map(
        self,
        arm: str | None = None,
        task: Task | str | None = None,
        *,
        method: Method = "exact",
        manifold: Manifold | None = None,
        progress: Progress | None = None,
    ) -> FeasibilityMap:
        """Compute a map; see `create_map`. The task need not be one of the scene's."""
        the_task = task if isinstance(task, Task) else self.scene.task(task)
        the_arm = self.scene.arm(arm or the_task.arms[0])
        grid = manifold or self.scene.manifold
        engine = self._engine(the_arm, grid) if method == "exact" else None
        if engine:
            return engine.map(the_task, grid, progress)
        return create_map_reference(self.world, self.scene, the_arm, the_task, grid, progress)

    def explain(
        self,
        arm: str | None,
        task: Task | str | None,
        cell: Cell | tuple[int, int, int],
        *,
        manifold: Manifold | None = None,
        progress: Progress | None = None,
    ) -> Explanation:
        """Say what becomes of every candidate of a cell; see `symgrasp.feasibility.explain.explain`.

        Args:
            arm: name of the arm; the task's first if None.
            task: the task or its name; the scene's first if None. It need not be one of the scene's.
            cell: (roll, row, column).
            manifold: another grid than the scene's.
            progress: told the finished share; may raise `Cancelled`.
        """
        the_task = task if isinstance(task, Task) else self.scene.task(task)
        the_arm = self.scene.arm(arm or the_task.arms[0])
        if the_arm.name not in self._solvers:
            self._solvers[the_arm.name] = solver_for(the_arm, self.scene.settings.redundancy)
        ik, grid = self._solvers[the_arm.name], manifold or self.scene.manifold
        return explain(self.world, the_arm, ik, the_task, grid, Cell(*cell), progress)

    def _engine(self, arm: Arm, grid: Manifold) -> ExactEngine | None:
        """Return an arm's engine for a grid's heights, or None where the engine does not know the arm."""
        known = self._engines.get(arm.name)
        if known and not np.array_equal(known.manifold.h, grid.h):
            known = None
        if known is None and ExactEngine.knows(arm):
            known = ExactEngine(self.world, self.scene, arm, grid)
        self._engines[arm.name] = known
        return known


def create_map(
    scene: Scene,
    arm: str | None = None,
    task: str | None = None,
    *,
    method: Method = "exact",
    manifold: Manifold | None = None,
    world: BulletWorld | None = None,
    progress: Progress | None = None,
) -> FeasibilityMap:
    """Compute the feasibility map of an arm and a task.

    Args:
        scene: the scene.
        arm: name of the arm; the task's first if None.
        task: name of the task; the scene's first if None.
        method: ``exact`` is the fast engine, for arms whose closed form it knows; ``reference`` is
            Algorithm 1 of the paper, and what ``exact`` does for other arms. The feasible cells are
            the same, and so are the reasons up to JOINT_LIMITS; the engine's witnesses have the
            largest clearance that it found, the reference's are the first.
        manifold: another grid than the scene's.
        world: a world of this scene's robots, obstacles and object to use again; one is made if None.
        progress: told the finished share; may raise `Cancelled`.

    Raises:
        SceneError: there is no such arm or task.
        UrdfError: the arm has no closed-form inverse kinematics.
    """
    the_task = scene.task(task)
    the_arm = scene.arm(arm or the_task.arms[0])
    with nullcontext(world) if world else BulletWorld(scene) as used:
        maker = MapMaker(used, scene)
        return maker.map(the_arm.name, the_task, method=method, manifold=manifold, progress=progress)
