"""The engine's bounds on distances hold: against quadratic programming, and against PyBullet."""

from __future__ import annotations

import math
from collections import defaultdict

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import nnls
from scipy.spatial.transform import Rotation

from symgrasp.collision.distance import distance_bounds
from symgrasp.collision.pieces import Piece, pack, pose_rows
from symgrasp.compiling import ENTRY, njit
from symgrasp.engine.checks import FREE_BAND, HIT_BAND
from symgrasp.engine.geometry import ArmGeometry, arm_geometry
from symgrasp.engine.kinematics import new_scratch, place_arm, place_hand
from symgrasp.poses import axis_frame
from symgrasp.robot.robot import Arm
from symgrasp.world import BulletWorld
from tests.conftest import PLAIN, load_small

NEAR = 0.1

compiled_bounds = njit(**ENTRY)(distance_bounds)


def bounds(pieces, pose, a: int, b: int) -> tuple[float, float]:
    """Both bounds as sharp as they get."""
    return compiled_bounds(pieces, pose, a, b, math.inf, math.inf, -math.inf, np.zeros((4, 3)))


def distance_of_hulls(a: np.ndarray, b: np.ndarray) -> float:
    """Nearest points of two hulls as mixtures of their corners: a non-negative least-squares problem."""
    weight = 1e4
    sums = np.zeros((2, len(a) + len(b)))
    sums[0, : len(a)] = sums[1, len(a) :] = weight
    mixture, _ = nnls(np.vstack([np.hstack([a.T, -b.T]), sums]), [0, 0, 0, weight, weight])
    return float(np.linalg.norm(mixture[: len(a)] @ a - mixture[len(a) :] @ b))


@given(seed=st.integers(0, 2**32 - 1))
def test_bounds_enclose_the_distance_of_random_hulls(seed):
    rng = np.random.default_rng(seed)
    corners = [rng.normal(0, rng.uniform(0.01, 0.2), (rng.integers(1, 40), 3)) for _ in range(2)]
    rounding = rng.uniform(0, 0.01, 2)
    poses = np.tile(np.eye(4), (2, 1, 1))
    poses[:, :3, :3] = Rotation.random(2, rng).as_matrix()
    poses[:, :3, 3] = rng.normal(0, 0.3, (2, 3))
    pieces = pack([Piece(c, r) for c, r in zip(corners, rounding, strict=True)])
    lower, upper = bounds(pieces, pose_rows(poses), 0, 1)
    placed = [c @ T[:3, :3].T + T[:3, 3] for c, T in zip(corners, poses, strict=True)]
    apart = distance_of_hulls(*placed)
    thick = rounding.sum()
    if apart > 1e-6:
        assert lower - 1e-7 <= apart - thick <= upper + 1e-7
        assert upper - lower < 1e-6
    else:
        assert lower <= 0
        assert upper <= 1e-6


@pytest.mark.parametrize("name", PLAIN)
def test_bounds_enclose_what_pybullet_measures(name):
    """All pairs that are near in random configurations, by link and body; few are ever off by a micron."""
    scene = load_small(name)
    rng = np.random.default_rng(PLAIN.index(name))
    compared = 0
    with BulletWorld(scene) as world:
        arms = scene.task().arms
        for arm_name in arms:
            arm = scene.arm(arm_name)
            radii = scene.profile.radius(scene.manifold.h)
            openings = np.array([arm.hand.opening(float(radius)) for radius in radii])
            world.set_arms([(arm, arm.home, float(openings[0]))])
            geometry = arm_geometry(world, arm, openings)
            geometry.pose[geometry.moving.objects] = pose_rows(axis_frame(scene.task().T_world_object))
            for _ in range(60 // len(arms)):
                compared += compare(world, arm, geometry, openings, rng)
    assert compared > 100


def compare(
    world: BulletWorld, arm: Arm, geometry: ArmGeometry, openings: np.ndarray, rng: np.random.Generator
) -> int:
    """Compare one random configuration; return the number of pairs of bodies."""
    row = int(rng.integers(len(openings)))
    q = rng.uniform(arm.lower, arm.upper)
    world.set_arms([(arm, q, float(openings[row]))])
    measured: dict[frozenset[str], float] = defaultdict(lambda: math.inf)
    for c in world.pairs_within(arm, NEAR):
        key = frozenset((str(c.a), str(c.b)))
        measured[key] = min(measured[key], NEAR - c.depth)
    for key, (lower, upper) in by_bodies(arm, geometry, q, row).items():
        if key in measured:
            assert lower <= measured[key] + FREE_BAND, key
            assert measured[key] <= upper + HIT_BAND, key
    return len(measured)


def by_bodies(
    arm: Arm, geometry: ArmGeometry, q: np.ndarray, row: int
) -> dict[frozenset[str], tuple[float, float]]:
    """Return for every pair of bodies of which one moves the bounds of the true shapes' distance."""
    moving, pieces = geometry.moving, geometry.pieces
    scratch = new_scratch(geometry.pose, pieces.size, len(q))
    T_base_world = np.ascontiguousarray(arm.robot.T_world_base)
    place_hand(moving, pieces, scratch, T_base_world, np.ascontiguousarray(arm.tool_pose(q)), row)
    place_arm(moving, pieces, scratch, q)
    found: dict[frozenset[str], tuple[float, float]] = {}
    for a in range(len(moving.frame)):
        for b in range(len(geometry.names)):
            if geometry.names[a] != geometry.names[b]:
                key = frozenset((str(geometry.names[a]), str(geometry.names[b])))
                lower, upper = bounds(pieces, scratch.pose, a, b)
                upper += pieces.size[a, 1] + pieces.size[b, 1]
                known = found.get(key, (math.inf, math.inf))
                found[key] = min(lower, known[0]), min(upper, known[1])
    return found
