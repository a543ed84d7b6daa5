"""A coarse map to look at while the code of the exact one is compiled, once on a machine."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from symgrasp.engine.redundancy.cover import is_cover_compiled
from symgrasp.engine.search import is_search_compiled
from symgrasp.feasibility.creation.algorithm1 import create_map_reference
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.ik import InterpretedIK
from symgrasp.object.manifold import Manifold
from symgrasp.progress import Progress
from symgrasp.robot.robot import Arm
from symgrasp.scene.parts import Task
from symgrasp.scene.scene import Scene
from symgrasp.world import BulletWorld

__all__ = ["coarse_map", "is_map_compiled"]

HEIGHTS, ANGLES, SAMPLES = 8, 16, 4
"""Rows, columns and redundancy samples that are tried at most: a second or two of Algorithm 1."""


def is_map_compiled(scene: Scene, arm: Arm) -> bool:
    """Whether the exact map of an arm is computed at once on this machine, with nothing to compile."""
    searches_all = scene.settings.redundancy == "auto" and len(arm.joint_names) >= 7  # others have no φ
    return is_search_compiled() and (is_cover_compiled() or not searches_all)


def coarse_map(
    world: BulletWorld, arm: Arm, task: Task, progress: Progress | None = None
) -> FeasibilityMap | None:
    """Compute a coarse map by Algorithm 1, without compiling anything.

    Args:
        world: a world of the scene's robots, obstacles and object; the arm ends at home.
        arm: the arm.
        task: the task; it need not be one of the scene's.
        progress: called with the finished share after every row; may raise `Cancelled`.

    Returns:
        A preliminary map on the scene's grid, on which every cell has the reason of the coarse cell that its
        centre lies in; None for arms whose inverse kinematics is too slow uncompiled: those that have no
        closed form, a torso, or are held at a pitch.

    Raises:
        UrdfError: no inverse kinematics is known for the arm.
    """
    if arm.pitched or arm.robot.torso is not None:
        return None
    ik = InterpretedIK(arm, min(SAMPLES, world.scene.settings.samples))
    if ik.searches:
        return None
    grid = world.scene.manifold
    heights, angles = min(HEIGHTS, grid.heights), min(ANGLES, grid.angles)
    few = Manifold(grid.profile, heights, angles, grid.theta_start)
    found = create_map_reference(world, arm, task, few, progress, lambda _: ik)
    row = (2 * np.arange(grid.heights) + 1) * heights // (2 * grid.heights)
    column = (2 * np.arange(grid.angles) + 1) * angles // (2 * grid.angles)
    reason = found.reason[:, row[:, None], column]
    nowhere, none = np.full(reason.shape, np.nan), np.full(reason.shape, -1)
    return replace(
        found,
        manifold=grid,
        reason=reason,
        q=np.full((*reason.shape, arm.dof), np.nan),
        sample=none.astype(np.int32),
        branch=none.astype(np.int16),
        clearance=nowhere,
        opening=np.array([arm.hand.opening(float(r)) for r in grid.profile.radius(grid.h)]),
        bodies=(),
        pair=np.full((*reason.shape, 2), -1, dtype=np.int16),
        depth=nowhere,
        proven=np.zeros(reason.shape, dtype=bool),
        certified=None,
        refined=None,
        preliminary=True,
    )
