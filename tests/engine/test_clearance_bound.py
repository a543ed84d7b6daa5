"""The upper bound of an arm's clearance, against what PyBullet measures and what a full search finds."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from symgrasp.engine.clearance_bound import LEVELS, clearance_bound, core
from symgrasp.engine.geometry import arm_geometry
from symgrasp.engine.search import CLEARANCE_TOLERANCE
from symgrasp.feasibility.candidates import CandidateChecker
from symgrasp.feasibility.cell import CLEARANCE_LIMIT, Cell
from symgrasp.feasibility.create import create_map
from symgrasp.poses import inverse
from symgrasp.reason import Reason
from symgrasp.world import BulletWorld
from tests.conftest import load_small
from tests.ik.eaik import independent_solver

TOLERANCE = 1e-3
"""Distances (m) that the engine states are lower bounds, up to 3 % below the true ones."""


@given(seed=st.integers(0, 2**32 - 1))
def test_a_core_lies_inside_however_it_is_turned(seed):
    rng = np.random.default_rng(seed)
    vertices = rng.normal(0, rng.uniform(0.01, 0.2, 3), (rng.integers(4, 40), 3))
    planes = ConvexHull(vertices).equations
    inside = core(vertices)
    if inside is None:  # no point of the axis is inside
        h = np.linspace(-1, 1, 2001)[:, None] * [0, 0, 1]
        assert (h @ planes[:, :3].T + planes[:, 3]).max(axis=1).min() > -1e-3
        return
    r, h = inside.vertices[:, 0], inside.vertices[:, 2]
    gaps = []
    for angle in np.linspace(0, 2 * np.pi, 100):
        points = np.column_stack([r * np.cos(angle), r * np.sin(angle), h])
        gaps.append((points @ planes[:, :3].T + planes[:, 3]).max(axis=1))
    assert np.max(gaps) < 1e-9
    # None could be larger: at each height some point of the circle is nearly on the hull.
    assert np.max(gaps, axis=0).min() > -0.1 * np.ptp(vertices)


def test_the_core_of_a_box():
    corners = np.array(list(np.ndindex(2, 2, 2))) - [0.5, 0.5, 0.5]
    inside = core(corners * [0.2, 0.4, 0.6], rounding=0.01)
    assert inside is not None
    assert (inside.revolved, inside.rounding) == (True, 0.01)
    np.testing.assert_allclose(inside.vertices[:, 0], np.full(LEVELS, 0.1))
    assert np.ptp(inside.vertices[:, 2]) == pytest.approx(0.6)
    assert core(corners + np.array([2.0, 0.0, 0.0])) is None
    assert core(corners * [1.0, 1.0, 0.0]) is None


@cache
def scene():
    return load_small("log_iiwa_and_panda", heights=4, angles=8, redundancy=8)


@pytest.mark.parametrize("name", ["iiwa", "panda"])
def test_no_configuration_has_more_and_some_nearly_that(name):
    arm = scene().arm(name)
    rng = np.random.default_rng(1)
    with BulletWorld(scene()) as world:
        opening = arm.hand.opening(0.02)
        world.set_arms([(arm, arm.home, opening)])
        g = arm_geometry(world, arm, np.array([opening]))
        limits = np.array([arm.lower, arm.upper])
        bound = clearance_bound(g.moving, g.pieces, g.pose, limits, CLEARANCE_LIMIT)
        measured = []
        for q in rng.uniform(arm.lower, arm.upper, (2000, arm.dof)):
            world.set_arms([(arm, q, opening)])
            own = [c.depth for c in world.pairs_within(arm, 0.06) if c.reason == Reason.SELF_COLLISION]
            measured.append(0.06 - max(own, default=0.0))
    assert max(measured) <= bound
    assert max(measured) > bound - CLEARANCE_TOLERANCE
    assert bound < CLEARANCE_LIMIT


@pytest.mark.parametrize("name", ["iiwa", "panda"])
def test_no_candidate_is_much_clearer_than_the_witness(name):
    arm = scene().arm(name)
    m = create_map(scene(), arm=name)
    ik = independent_solver(arm, scene().settings.samples)
    tools = inverse(arm.robot.T_world_base) @ m.manifold.tool_poses(m.T_world_object, arm.hand.finger_depth)
    cells = [Cell(*index) for index in np.argwhere(m.feasible)]
    with BulletWorld(scene()) as world:
        world.margin = scene().settings.margin
        world.set_object(m.T_world_object)
        checker = CandidateChecker(world, arm, ik, scene().settings.approach)
        for cell in cells[:: max(1, len(cells) // 12)]:
            s, best = ik.solve(tools[cell]), 0.0
            opening = float(m.opening[cell.row])
            for q, sample in zip(s.q[s.inside], s.sample[s.inside], strict=True):
                if checker.check(tools[cell], q, int(sample), opening)[0] == Reason.FEASIBLE:
                    world.set_arm(arm, q, opening)
                    best = max(best, world.clearance(arm, CLEARANCE_LIMIT))
            assert 0 < best <= m.clearance[cell] + CLEARANCE_TOLERANCE + TOLERANCE
    assert len(cells) > 12
