"""The trees of free motions, and projections onto what a limited tilt allows."""

from __future__ import annotations

import numpy as np
import pytest

from symgrasp.compiling import ENTRY, njit
from symgrasp.motion.bodies.motion_scene import MotionScene
from symgrasp.motion.paths import trees
from symgrasp.motion.paths.trees import new_trees
from symgrasp.poses import inverse
from symgrasp.world import open_world
from tests.conftest import load_small

_project = trees._project  # compiled code takes it from this module alone


@njit(**ENTRY)
def project(linkage, size, work, q, low, high):
    return _project(linkage, size, work, q, low, high)


@pytest.mark.parametrize("seed", [0, -1, 10**11, 2**64, 2**200])
def test_any_seed_starts_the_random_numbers(seed):
    roots = np.zeros((1, 2))
    assert new_trees(roots, roots, 1, seed).random[0] > 0


def test_random_configurations_are_projected_onto_a_small_tilt():
    """Of an object that is upright in the hand at home; it may turn about its axis as it likes."""
    largest = np.deg2rad(10)
    scene = load_small("pick_pour_place")
    arm = scene.arm()
    with open_world(scene) as world:
        bodies = MotionScene(scene, world)
        state = bodies.home()
        T = np.eye(4)
        T[:3, 3] = state.tool(arm)[:3, 3]
        state = state.with_object(T)
        s = bodies.situation(state, [arm], held_by=[arm], tilt=largest)
    low, high = s.linkage.limits
    rng, fixed = np.random.default_rng(0), inverse(state.tool(arm)) @ T
    upright, moved, headings, before = 0, [], [], 0
    for _ in range(200):
        q = rng.uniform(low, high)
        start = q.copy()
        ok = project(s.linkage, s.pieces.size, s.work, q, low, high)
        poses = [arm.world_tool_pose(values) @ fixed for values in (start, q)]
        was, tilt = (float(np.arccos(np.clip(pose[2, 2], -1, 1))) for pose in poses)
        before += was <= largest
        assert ((q >= low) & (q <= high)).all()
        if ok:
            upright += 1
            assert tilt < largest
            moved.append(np.linalg.norm(q - start) / max(was, largest))
            headings.append(np.arctan2(poses[1][1, 0], poses[1][0, 0]))
    assert before < 10  # so hardly any would do without
    assert upright > 150
    assert np.median(moved) < 1.5  # it goes about as far as the axis has to turn
    assert np.ptp(headings) > 5.0
