"""Windows of cells: against every one of 2,048 values of the redundancy, as Algorithm 1 checks them."""

# The widths of windows may be None in general, but not where these tests look.
# pyright: reportArgumentType=false, reportOptionalSubscript=false, reportCallIssue=false

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from symgrasp.errors import Cancelled, InputError, SymgraspError
from symgrasp.feasibility.candidates import CandidateChecker
from symgrasp.feasibility.cell import Window
from symgrasp.feasibility.color_by import ColorBy
from symgrasp.feasibility.create import MapMaker, create_map
from symgrasp.feasibility.exact.settling import settled
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.ik import solver_for
from symgrasp.poses import inverse
from symgrasp.reason import Reason
from symgrasp.world import BulletWorld, open_world
from tests.conftest import load_small, some

DENSE = 2048
"""Values of the redundancy that are tried."""

NEAR = 1.1e-4
"""Windows end (rad) to so much."""


def tried(world: BulletWorld, m: FeasibilityMap, cell: tuple[int, int, int]) -> set[tuple[int, float]]:
    """Return the branches and values of φ (rad) at which Algorithm 1 says that a cell is free."""
    scene = world.scene
    arm = scene.arm(m.arm)
    torso = arm.robot.torso and arm.robot.torso.samples_at(
        m.q[cell][: len(arm.robot.torso.joint_names)].tolist()
    )
    ik = solver_for(arm, DENSE, torso)
    for name in scene.robots:
        world.park(name)
    world.set_object(m.T_world_object)
    T = (inverse(arm.robot.T_world_base) @ arm.hand.tool_poses(m.manifold, m.T_world_object))[cell]
    checker = CandidateChecker(world, arm, ik, scene.settings.approach, holders=scene.task(m.task).arms)
    found = checker.candidates(T, float(m.opening[cell[1]]))
    return {(c.branch, c.phi) for c in found if c.reason is Reason.FEASIBLE}


@pytest.mark.parametrize(
    ("name", "task", "settings"),
    some(
        3,
        [
            ("pick_pour_place", "pour", {}),
            ("pick_pour_place", "pick", {"margin": 0.004}),
            ("pr2_handover", None, {}),
            ("pick_pour_place", "place", {"approach": 0.05}),
            ("log_iiwa_and_panda", "lift", {}),
            ("log_two_humanoids", None, {"approach": 0.0}),
        ],
    ),
)
def test_windows_hold_what_dense_samples_hold(name, task, settings):
    scene = load_small(name, 8, 16).with_settings(**settings)
    with open_world(scene) as world:
        maker = MapMaker(world)
        m = maker.map(None, task)
        cells = np.random.default_rng(1).permutation(np.argwhere(m.feasible))[:3]
        several = 0
        for cell, windows in zip(cells.tolist(), maker.windows(m, cells), strict=True):
            free = tried(world, m, tuple(cell))
            assert free
            several += len(windows) > 1
            phi = np.unique(solver_for(scene.arm(m.arm), DENSE).phi)
            for w in windows:
                inside = phi[(phi > w.low + NEAR) & (phi < w.high - NEAR)]
                assert [at for at in inside if (w.branch, at) not in free] == []
            within = [
                any(w.branch == b and w.low - NEAR <= at <= w.high + NEAR for w in windows) for b, at in free
            ]
            assert all(within)
            assert list(windows) == sorted(windows)
        assert several


def test_a_map_finds_the_windows_of_its_cells():
    m = create_map(load_small("pick_pour_place", 8, 16), task="pour")
    cell = tuple(np.argwhere(m.feasible)[5].tolist())
    witness = m.witness(cell)
    assert witness
    windows = m.windows(cell)
    assert any(w.branch == witness.branch and w.low <= witness.phi <= w.high for w in windows)
    with open_world(load_small("pick_pour_place", 8, 16)) as world:
        maker = MapMaker(world)
        widest = maker.with_windows(m)
        assert widest.widest is not None
        assert np.array_equal(np.isnan(widest.widest), ~m.feasible)
        # Without PyBullet, windows end up to half a millimetre before a collision.
        width = max(w.width for w in windows)
        assert 0.8 * width <= widest.widest[cell] <= width + 1e-9
        turned = m.shift(3 * m.manifold.dtheta)
        column = (cell[0], cell[1], (cell[2] - 3) % 16)
        (again,) = maker.windows(turned, np.array([column]))
        assert np.allclose([(w.low, w.high) for w in again], [(w.low, w.high) for w in windows], atol=NEAR)
    nowhere = tuple(np.argwhere(m.reason == Reason.UNREACHABLE)[0].tolist())
    assert m.windows(nowhere) == ()


def test_the_view_shows_degrees():
    scene = load_small("pick_pour_place", 6, 12)
    with open_world(scene) as world:
        m = MapMaker(world).with_windows(MapMaker(world).map(None, "pour"))
    values = m.values(ColorBy.WINDOW)
    assert m.widest is not None
    assert np.allclose(values[m.feasible], np.rad2deg(m.widest[m.feasible]))
    assert np.isnan(values[~m.feasible]).all()
    assert ColorBy.WINDOW.unit == "°"
    assert np.array_equal(m.shift(m.manifold.dtheta).widest, np.roll(m.widest, -1, axis=2), equal_nan=True)


def test_windows_tell_progress_and_can_be_cancelled():
    scene = load_small("pick_pour_place", 8, 24)
    shares: list[float] = []

    def cancel(share: float) -> None:
        raise Cancelled

    with open_world(scene) as world:
        maker = MapMaker(world)
        m = maker.map(None, "pour")
        whole = maker.with_windows(m)
        told = maker.with_windows(m, shares.append)
        assert np.array_equal(told.widest, whole.widest, equal_nan=True)
        assert shares == sorted(shares)
        assert len(shares) > 1
        assert shares[-1] == 1.0
        with pytest.raises(Cancelled):
            maker.with_windows(m, cancel)


def test_arms_without_redundancy_have_none():
    m = create_map(load_small("ur5_bottle", 4, 8))
    cell = tuple(np.argwhere(m.feasible)[0].tolist())
    with pytest.raises(InputError, match="seven joints"):
        m.windows(cell)
    with pytest.raises(SymgraspError, match="scene of the map"):
        replace(m, find_windows=None).windows(cell)


def test_ends_are_settled_to_a_ten_thousandth():
    """Whatever the windows are up to where pieces all but touch."""
    real = {0: [(0.1, 0.5), (0.9, 1.2)], 1: [(0.30003, 0.3103)]}

    def is_free(branch: int, phi: float) -> bool:
        return any(low <= phi <= high for low, high in real[branch])

    known = [Window(0, 0.13, 0.3, True), Window(0, 0.3005, 0.5, True), Window(1, 0.8, 0.9, True)]
    found = settled(known, [(0, 1.0), (0, 0.7), (1, 0.305), (1, 0.7)], is_free, (0.0, 1.1))
    assert [w.branch for w in found] == [0, 0, 1]
    expected = [(0.1, 0.5), (0.9, 1.1), (0.30003, 0.3103)]
    assert np.allclose([(w.low, w.high) for w in found], expected, atol=NEAR)
    assert not any(w.whole for w in found)
