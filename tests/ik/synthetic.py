"""Arms that are their axes alone, and how far apart configurations are."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from numpy.typing import ArrayLike

from symgrasp.poses import Array
from symgrasp.robot.robot import Arm

__all__ = ["distance", "samples", "synthetic"]


def synthetic(H: ArrayLike, P: ArrayLike, R0: Array | None = None) -> Arm:
    """Return an arm that is its axes alone: what a solver reads of it."""
    arm = object.__new__(Arm)
    H = np.array(H, dtype=float)
    n = len(H)
    arm.__dict__.update(
        name="synthetic",
        H=H / np.linalg.norm(H, axis=1, keepdims=True),
        P=np.array(P, dtype=float),
        R0=np.eye(3) if R0 is None else R0,
        joint_names=tuple(f"j{k}" for k in range(n)),
        pitched=False,
        lower=np.full(n, -2.9),
        upper=np.full(n, 2.9),
        robot=SimpleNamespace(model=SimpleNamespace(path="synthetic"), torso=None),
    )
    return arm


def distance(a: Array, b: Array) -> Array:
    """Largest joint difference modulo full turns."""
    return np.abs((a - b + np.pi) % (2 * np.pi) - np.pi).max(axis=-1)


def samples(arm: Arm, count: int, seed: int) -> Array:
    """Return random configurations (count, n) inside the limits of an arm, of one turn where it has none."""
    lower, upper = np.maximum(arm.lower, -np.pi), np.minimum(arm.upper, np.pi)
    return np.random.default_rng(seed).uniform(lower, upper, (count, len(lower)))
