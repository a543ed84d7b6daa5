"""The joints between a robot's base and its arms that maps sample: a lift, a waist."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from symgrasp.poses import Array
from symgrasp.robot.model import RobotModel

__all__ = ["Torso"]

SAME = 1e-9
"""Joint values (rad or m) that differ by less are the same."""


@dataclass(frozen=True, eq=False)
class Torso:
    """Joints that move all arms of a robot together, and the values at which maps try them.

    Attributes:
        joint_names: its m joints, from the base outwards.
        indices: (m,) their indices into the robot's joint values.
        values: (K, m) the samples (rad or m): every combination of the joints' own.
    """

    joint_names: tuple[str, ...]
    indices: np.ndarray
    values: Array

    @staticmethod
    def of(model: RobotModel, samples: Mapping[str, int]) -> Torso:
        """Return the torso of a robot.

        Args:
            model: the robot's model.
            samples: joint of the model → in how many equal parts its range is cut, whose centres are tried.
        """
        order = [j.name for j in model.joints if j.name in samples]
        indices = np.array([model.joint_names.index(name) for name in order])
        axes = [
            _centres(float(model.lower[i]), float(model.upper[i]), samples[n])
            for n, i in zip(order, indices, strict=True)
        ]
        grid = np.meshgrid(*axes, indexing="ij")
        return Torso(tuple(order), indices, np.column_stack([axis.ravel() for axis in grid]))

    def samples_at(self, values: Sequence[float]) -> list[int]:
        """Return the samples at joint values (m,), none where maps do not try them."""
        return np.flatnonzero(np.abs(self.values - np.asarray(values)).max(axis=1) <= SAME).tolist()

    def __len__(self) -> int:
        """Return the number K of samples."""
        return len(self.values)


def _centres(lower: float, upper: float, parts: int) -> Array:
    """Return the centres (parts,) of equal parts of a joint's range; a full turn where it has no limits."""
    if not np.isfinite(upper - lower):
        lower, upper = -np.pi, np.pi
    return lower + (np.arange(parts) + 0.5) * (upper - lower) / parts
