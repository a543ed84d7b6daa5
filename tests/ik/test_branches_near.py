"""The branches near a configuration are those that all branches hold near it."""

from __future__ import annotations

import numpy as np
import pytest

from symgrasp.compiling import ENTRY, njit
from symgrasp.ik import CompiledIK
from symgrasp.ik.branches import branch_count, branches_at, branches_near, new_memory
from symgrasp.ik.chain import Chain
from symgrasp.ik.retreat import retreated
from symgrasp.robot.robot import Arm
from tests.conftest import load_small

MOST = 0.5


@njit(**ENTRY)
def solve_both(chain, k, T, at, most, q, exists, inside, memory):
    """Write all branches inside the limits into index 0, and those near ``at`` into index 1."""
    branches_at(chain, k, T, True, q[0], exists[0], inside[0], memory)
    branches_near(chain, k, T, at, most, q[1], exists[1], inside[1], memory)


@pytest.mark.parametrize(
    ("scene", "arm"),
    [
        ("log_iiwa_and_panda", "panda"),
        ("log_iiwa_and_panda", "iiwa"),
        ("ur5_bottle", "ur5"),
        ("pr2_pour", "left"),
    ],
)
def test_they_are_those_among_all(scene, arm):
    """At tool poses up to a decimetre away, where some are near, some a full turn off, and some elsewhere."""
    own = next(a for name, a in load_small(scene).arms.items() if arm in name)
    own = own.at(0) if own.robot.torso else own
    ik, rng, counts = CompiledIK(own, 8), np.random.default_rng(0), np.zeros(2, dtype=int)
    for _ in range(300):
        k = int(rng.integers(len(ik.phi)))
        at = rng.uniform(np.maximum(own.lower, -7.0), np.minimum(own.upper, 7.0))
        if ik.locked is not None:
            at[ik.locked] = ik.phi[k]
        T = retreated(own.tool_pose(at), rng.uniform(0, 0.1))
        all_of_them, near = (near_ones(own, rows, at) for rows in solved(ik.chain, k, T, at))
        assert near.shape == all_of_them.shape
        assert np.allclose(near, all_of_them, rtol=0, atol=1e-12)
        counts += len(near) > 0, len(near) > 1
    assert counts[0] > 100, counts


def solved(chain: Chain, k: int, T: np.ndarray, at: np.ndarray) -> list[np.ndarray]:
    q = np.empty((2, branch_count(chain), len(at)))
    exists, inside = np.empty(q.shape[:2], dtype=bool), np.empty(q.shape[:2], dtype=bool)
    solve_both(chain, k, np.ascontiguousarray(T), at, MOST, q, exists, inside, new_memory(len(at)))
    return [rows[fits] for rows, fits in zip(q, inside, strict=True)]


def near_ones(arm: Arm, rows: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Those that are within `MOST`, with the full turns that bring them there, and inside the limits."""
    rows = rows + 2 * np.pi * np.round((at - rows) / (2 * np.pi))
    fits = (rows >= arm.lower) & (rows <= arm.upper) & (abs(rows - at) <= MOST)
    return rows[fits.all(axis=1)]
