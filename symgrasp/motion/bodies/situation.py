"""What moves and what stands during a part of a motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from symgrasp.collision.pieces import PackedPieces
from symgrasp.collision.tree import Tree
from symgrasp.motion.bodies.joints import MovingJoints
from symgrasp.motion.bodies.linkage import Linkage, Workspace
from symgrasp.motion.bodies.state import State
from symgrasp.poses import Array
from symgrasp.world import BodyName

__all__ = ["Situation"]


@dataclass(frozen=True, eq=False)
class Situation:
    """A linkage with all that compiled code needs to prove lines of it free.

    Attributes:
        moving: the joints that move.
        columns: arm → where its joints are among those of the linkage.
        linkage: what moves.
        pieces: all pieces.
        tree: the boxes of those that stand.
        work: arrays to write to.
        apart: (Q,) whether the pieces of each pair belong to different bodies.
        names: what each piece belongs to.
    """

    moving: MovingJoints
    columns: Mapping[str, np.ndarray]
    linkage: Linkage
    pieces: PackedPieces
    tree: Tree
    work: Workspace
    apart: np.ndarray
    names: list[BodyName] = field(repr=False)

    def with_room(self, room: float) -> Situation:
        """Return the situation with more distance (m) to keep between different bodies."""
        wide = self.linkage._replace(
            margin=self.linkage.margin + room, distance=self.linkage.distance + room * self.apart
        )
        return replace(self, linkage=wide)

    def stacked(self, joints: Mapping[str, Array]) -> Array:
        """Return arm → values (..., dof) as values (..., J) of the linkage."""
        first = next(iter(joints.values()))
        q = np.zeros((*first.shape[:-1], len(self.linkage.parent)))
        for arm, values in joints.items():
            q[..., self.columns[arm]] = values
        return q

    def row(self, state: State) -> Array:
        """Return the values (J,) of the linkage in a state."""
        values = [joint.ratio * state.values[robot.name][joint.source] for robot, joint in self.moving.joints]
        return np.array(values)

    def by_arm(self, q: Array) -> dict[str, Array]:
        """Return values (..., J) of the linkage as arm → values (..., dof)."""
        return {arm: q[..., columns] for arm, columns in self.columns.items()}
