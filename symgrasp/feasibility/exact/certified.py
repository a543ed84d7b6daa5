"""Which cells of a map hold as a whole: feasible, or infeasible, at every height and angle inside."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symgrasp.collision.inner_pieces import inner_pieces
from symgrasp.collision.pieces import pose_rows
from symgrasp.engine.balance import balance_of, loaded
from symgrasp.engine.cell_proof import prove_cells
from symgrasp.engine.cell_types import CellInput
from symgrasp.engine.geometry import ArmGeometry
from symgrasp.engine.kinematics import Scratch
from symgrasp.engine.reach import reach_of
from symgrasp.engine.search_types import Balance
from symgrasp.feasibility.exact.cell_rows import new_rows
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.ik import Solver
from symgrasp.object.manifold import Manifold
from symgrasp.poses import Array, axis_frame, inverse, spin
from symgrasp.progress import Progress, portions
from symgrasp.robot.robot import Arm
from symgrasp.scene.balance import load_of_hand
from symgrasp.scene.parts import Task
from symgrasp.scene.scene import Scene

__all__ = ["LEVELS", "CellProver"]

FIRST_CELLS = 64
"""Cells that are proven before progress is told for the first time."""

LEVELS = 3
"""How often the cells of a map may be cut in two, along and around, to be proven."""


class CellProver:
    """Proves for the cells of maps of one arm that they hold as a whole, see `symgrasp.engine.cell_proof`.

    Not proven are feasible cells of arms with five joints, and of scenes with a retreat.

    Args:
        scene: the scene.
        arm: the arm.
        ik: its inverse kinematics.
        geometry: what the arm moves, and may collide with.
        manifold: the grid; maps may be on others with the same heights.
        levels: how often a cell may be cut in two, along and around, to be proven.
    """

    def __init__(
        self,
        scene: Scene,
        arm: Arm,
        ik: Solver,
        geometry: ArmGeometry,
        manifold: Manifold,
        levels: int = LEVELS,
    ) -> None:
        self._scene, self._arm, self._geometry = scene, arm, geometry
        moving = geometry.moving
        links = [name.link for name in geometry.names[: moving.hand.shape[1]]]
        self._rows, self._first, opening = new_rows(arm, manifold, levels, links, geometry.pieces)
        if arm.pitched:
            return
        joints = [next(j for j in arm.robot.model.joints if j.name == name) for name in arm.joint_names]
        self._balance = balance_of(arm, joints, opening)
        zero = arm.robot.T_world_base @ arm.robot.model.forward(arm.robot_values(np.zeros(arm.dof)))
        frames = np.array([zero[j.child] for j in joints])
        tool = zero[arm.robot.model.link_index(arm.tool)]
        reach, base = reach_of(arm), arm.robot.T_world_base
        self._reach = reach._replace(shoulder=base[:3, :3] @ reach.shoulder + base[:3, 3])
        self._tool = pose_rows(inverse(frames[-1]) @ tool)
        locked = getattr(ik, "locked", None)
        self._free = np.array([j for j in range(arm.dof) if j != locked], dtype=np.int64)
        self._inner = inner_pieces(geometry.pieces)

    def certified(
        self,
        m: FeasibilityMap,
        task: Task,
        scratches: Sequence[Scratch],
        only: np.ndarray | None = None,
        progress: Progress | None = None,
    ) -> np.ndarray:
        """Return which cells (R, H, A) of a map hold as a whole.

        Args:
            m: the map.
            task: its task.
            scratches: the poses of all pieces, for each thread, with the object where the task has it.
            only: (R, H, A) of which cells that is asked; of all if None.
            progress: called with the finished share; may raise `Cancelled`.
        """
        found = np.zeros(m.reason.shape, dtype=bool)
        if self._arm.pitched:
            found[:, self._rows.misfits[: m.manifold.heights]] = True
            return found & ~m.feasible
        settings, geometry = self._scene.settings, self._geometry
        inputs = CellInput(
            object=pose_rows(axis_frame(task.T_world_object)),
            start=spin(task.T_world_object) + m.manifold.theta_start,
            width=m.manifold.dtheta,
            rows=self._rows,
            first=self._first,
            tool=self._tool,
            free=self._free,
            limits=np.array([self._arm.lower, self._arm.upper]),
            margin=float(settings.margin),
            inner=self._inner,
            reach=self._reach,
        )
        wanted = ~m.feasible if settings.approach else np.ones_like(found)
        if only is not None:
            wanted &= only
        # Of one layout, however many there are: for another one all would be compiled once more.
        cells = np.ascontiguousarray(np.argwhere(wanted))
        balance, q = self._loaded(task), m.q[wanted]
        whole = np.zeros(len(cells), dtype=bool)
        for some in portions(len(cells), progress, FIRST_CELLS):
            whole[some] = prove_cells(
                geometry.moving, geometry.pieces, geometry.tree, scratches, inputs, balance, cells[some],
                q[some],
            )  # fmt: skip
        found[wanted] = whole
        return found

    def _loaded(self, task: Task) -> Balance:
        """Return what decides whether the robot stands in each row of boxes."""
        if not len(self._balance.edges):  # it stands, whatever it bears
            return self._balance
        heights: Array = self._rows.h
        load = [
            load_of_hand(self._scene, self._arm, task.arms, task.T_world_object, float(h)) for h in heights
        ]
        return loaded(self._balance, load)
