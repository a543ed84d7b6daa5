"""Certificates of cells, against the engine at points inside them, and what they rest on."""

# What is certified may be None in general, but not where these tests look.
# pyright: reportOptionalMemberAccess=false, reportArgumentType=false, reportOptionalSubscript=false
# pyright: reportOptionalOperand=false, reportCallIssue=false, reportOperatorIssue=false

import math
from copy import copy
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from symgrasp.bench.maps.random_scenes import KINDS, scene_of_kind
from symgrasp.engine.reach import arm_reach
from symgrasp.errors import Cancelled, MapError, SceneError
from symgrasp.feasibility.create import MapMaker, create_map
from symgrasp.feasibility.creation.torso_maps import merged
from symgrasp.feasibility.exact.cell_rows import new_rows
from symgrasp.feasibility.fit import fit, fits_all, fits_none
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.feasibility.margins import way_to_unproven
from symgrasp.object.manifold import Manifold, wrap
from symgrasp.object.profile import Profile
from symgrasp.poses import from_position_rpy
from symgrasp.robot.hand import HANDS
from symgrasp.scene.parts import Task
from symgrasp.scene.scene import Scene
from symgrasp.world import open_world
from tests.conftest import some
from tests.feasibility.test_pitched import so101

SAMPLES = 25
"""Points of a cell along and around at which the engine is asked."""


@pytest.mark.parametrize(
    ("name", "task", "whole", "none"),
    some(1, [("ur5_bottle", "place", 100, 100), ("pick_pour_place", "pour", 40, 100)]),
)
def test_no_point_contradicts_a_certificate(name, task, whole, none):
    scene = Scene.load(name).with_settings(heights=12, angles=36)
    _compare(scene, scene.task(task), whole, none)


@pytest.mark.parametrize("seed", range(3))
def test_no_point_of_an_object_at_a_random_place_contradicts_a_certificate(seed):
    rng = np.random.default_rng(seed)
    scene = Scene.load("pick_pour_place").with_settings(heights=8, angles=16, redundancy=4, margin=0.003)
    task = scene.task("pour")
    T = task.T_world_object @ from_position_rpy(rng.normal(0, 0.08, 3), rng.normal(0, 0.4, 3))
    _compare(scene, Task("moved", task.arms, T), 0, 1)


@pytest.mark.parametrize("kind", KINDS)
def test_no_point_of_scenes_of_other_kinds_contradicts_a_certificate(kind, tmp_path):
    scenes = [Scene.from_content(scene_of_kind(kind, seed, tmp_path)) for seed in range(3)]
    found = [_compared(scene.with_settings(approach=0.0), scene.task()) for scene in scenes]
    assert sum(none for _, none in found) > 0
    # In cells that large none holds feasible grasps alone: in small ones some do.
    small = {"heights": 40, "angles": 40, "redundancy": 4, "approach": 0.0}
    seed = {"meshes": 300, "cusps": 300, "long": 300, "fat": 301, "plates": 305}[kind]
    scene = Scene.from_content(scene_of_kind(kind, seed, tmp_path)).with_settings(**small)
    assert _compared(scene, scene.task(), 5)[0] > 10


def _compare(scene, task, least_whole, least_none):
    """At least so many feasible and infeasible cells must be certified; none may be wrong."""
    whole, none = _compared(scene, task)
    assert whole >= least_whole
    assert none >= least_none


def _compared(scene, task, samples=SAMPLES):
    """Compare a map with a finer one; return how many feasible and infeasible cells are certified."""
    grid = scene.manifold
    fine = Manifold(grid.profile, grid.heights * samples, grid.angles * samples)
    with open_world(scene) as world:
        maker = MapMaker(world)
        m = maker.map(None, task, certify=True)
        points = maker.map(None, task, manifold=fine).feasible
    cells = points.reshape(2, grid.heights, samples, grid.angles, samples).transpose(0, 1, 3, 2, 4)
    assert cells[m.certified & m.feasible].all()
    assert not cells[m.certified & ~m.feasible].any()
    return (m.certified & m.feasible).sum(), (m.certified & ~m.feasible).sum()


@pytest.mark.thorough
def test_no_point_contradicts_the_parts_of_cells_nor_margins():
    scene = Scene.load("bottle_on_table").with_settings(heights=8, angles=24, resolution={"mm": 20, "deg": 4})
    grid = scene.manifold
    fine = Manifold(grid.profile, 160, 480)
    with open_world(scene) as world:
        maker = MapMaker(world)
        m = maker.map()
        points = maker.map(manifold=fine, certify=False).feasible
    parts = m.refined
    assert (parts.manifold.heights, parts.manifold.angles) == (16, 96)
    each = points.reshape(2, 16, 10, 96, 5).transpose(0, 1, 3, 2, 4)
    assert each[parts.certified & parts.feasible].all()
    assert not each[parts.certified & ~parts.feasible].any()
    assert parts.area.least <= points.mean() <= parts.area.most
    assert parts.certified.mean() > m.certified.mean() + 0.03
    assert ((m.margins > 0).all(axis=-1) <= m.feasible).all()
    some = np.argwhere(m.margins.min(axis=-1) > 0)
    assert len(some) > 5
    for roll, row, column in some:
        along, around = m.margin((roll, row, column))
        h, theta = m.manifold.h[row], m.manifold.theta[column]
        up = np.abs(fine.h - h) < along
        near = np.abs(wrap(fine.theta - theta)) < around
        assert points[roll, up][:, np.abs(wrap(fine.theta - theta)).argmin()].all()
        assert points[roll, np.abs(fine.h - h).argmin(), near].all()


@settings(max_examples=100, deadline=None)
@given(st.integers(1, 4), st.integers(1, 4), st.integers(1, 4), st.booleans(), st.integers(0, 2**32 - 1))
def test_way_to_what_is_not_proven_is_that_of_single_steps(lines, cells, parts, closed, seed):
    whole = np.random.default_rng(seed).random((2, lines * parts, cells * parts)) < 0.8
    found = way_to_unproven(whole, lines, cells, closed)
    for roll, line, cell in np.ndindex(2, lines, cells):
        at, middle = parts * (cell + 0.5), parts * (line + 0.5)
        best = 0.0
        for own in {math.ceil(middle) - 1, math.floor(middle)}:  # both where the middle is between two
            step = 0.0
            while all(
                (closed or 0 <= place < cells * parts)
                and whole[roll, own, math.floor(place) % (cells * parts)]
                for place in (at + step, at + step + 0.49, at - step - 0.01, at - step - 0.49)
            ):
                step += 0.5
                if step >= 0.5 * cells * parts:
                    break
            best = max(best, step)
        assert found[roll, line, cell] == pytest.approx(best)


def test_scenes_ask_for_a_resolution(tmp_path):
    scene = Scene.load("soda_can").with_settings(heights=6, angles=12, redundancy=4)
    m = create_map(scene.with_settings(resolution={"mm": 15, "deg": 10}))
    m.save(tmp_path / "map.npz")
    again = FeasibilityMap.load(tmp_path / "map.npz")
    assert np.array_equal(again.refined.reason, m.refined.reason)
    assert np.array_equal(again.margins, m.margins)
    turned = m.shift(3 * m.manifold.dtheta)
    assert np.array_equal(turned.margins, np.roll(m.margins, -3, axis=2))
    masked = m.masked(np.zeros_like(m.feasible)).refined
    factors = np.divide(masked.reason.shape, m.reason.shape).astype(int)
    assert m.refined.feasible[np.kron(m.feasible, np.ones(factors)) > 0].any()
    assert not masked.feasible[np.kron(m.feasible, np.ones(factors)) > 0].any()
    for refused in ({"mm": 0, "deg": 1}, {"mm": 0.01, "deg": 0.01}, {"mm": 1}):
        with pytest.raises(SceneError, match="resolution"):
            scene.with_settings(resolution=refused)
    with pytest.raises(SceneError, match="approach"):
        scene.with_settings(resolution={"mm": 2, "deg": 1}, approach=0.1)


def test_is_kept_in_files_shifts_and_merged_maps(tmp_path):
    scene = Scene.load("soda_can").with_settings(heights=6, angles=12, redundancy=4)
    m = create_map(scene, certify=True)
    m.save(tmp_path / "map.npz")
    again = FeasibilityMap.load(tmp_path / "map.npz")
    assert np.array_equal(again.certified, m.certified)
    assert again.to_dict()["certified"] == m.certified.tolist()
    assert np.array_equal(m.shift(2 * m.manifold.dtheta).certified, np.roll(m.certified, -2, axis=2))
    assert m.certified_share == m.certified.mean() > 0
    assert not m.masked(np.zeros_like(m.feasible)).certified[m.feasible].any()
    cell = tuple(np.argwhere(m.certified)[0])
    assert m.holds(cell) == "proven for the whole cell"
    plain = create_map(scene)
    assert plain.certified is None
    assert plain.holds(cell) == ""


def test_a_map_put_together_is_certified_only_if_all_its_parts_are():
    scene = Scene.load("soda_can").with_settings(heights=6, angles=12, redundancy=4)
    m = create_map(scene, certify=True)
    nothing = m.masked(np.zeros_like(m.feasible))
    sure = replace(nothing, certified=np.ones_like(m.feasible))
    assert merged([sure, replace(m, certified=None)]).certified is None
    both = merged([sure, m])
    assert np.array_equal(both.certified, m.certified)  # what either can hold counts


def test_a_map_put_together_is_searched_as_finely_as_the_least_of_its_parts():
    m = create_map(Scene.load("soda_can").with_settings(heights=6, angles=12, redundancy=4))
    fine, coarse = replace(m, resolution=1e-4), replace(m, resolution=2e-4)
    assert merged([fine, coarse]).resolution == merged([coarse, fine]).resolution == 2e-4
    assert merged([fine, m]).resolution == merged([m, fine]).resolution == 0.0


def test_pitched_maps_are_put_together_whatever_resolution_the_scene_asks_for():
    scene = so101("upright").with_settings(resolution={"mm": 10, "deg": 5})
    with open_world(scene) as world:
        found = MapMaker(world).maps_at_pitches("so101", "hold", [-1.2, -0.8, -0.4])
    assert found.certified is None
    assert found.refined is None
    assert not found.masked(np.zeros_like(found.feasible)).feasible.any()


def test_a_hand_without_joints_moves_nothing():
    scene = Scene.load("soda_can")
    arm = scene.arm("panda")
    stiff = copy(arm)
    stiff.hand = replace(arm.hand, joints={})
    with open_world(scene) as world:
        geometry = MapMaker(world)._engine(arm, None, scene.manifold)._geometry
    links = [n.link for n in geometry.names[: geometry.moving.hand.shape[1]]]
    rows, *_ = new_rows(stiff, scene.manifold, 1, links, geometry.pieces)
    assert rows.play.shape == (3 * scene.manifold.heights, len(links))
    assert not rows.play.any()


@pytest.mark.parametrize(
    "damage",
    [
        lambda parts: parts[:, :0],
        lambda parts: parts[:, :-1],
        lambda parts: parts[:1],
        lambda parts: parts[0],
    ],
)
def test_damaged_parts_of_a_saved_map_are_refused(damage, tmp_path):
    scene = Scene.load("soda_can").with_settings(heights=6, angles=12, redundancy=4)
    m = create_map(scene.with_settings(resolution={"mm": 15, "deg": 10}))
    m.save(tmp_path / "map.npz")
    with np.load(tmp_path / "map.npz") as file:
        data = dict(file)
    data |= {name: damage(data[name]) for name in ("refined_reason", "refined_certified")}
    np.savez(tmp_path / "damaged.npz", **data)
    with pytest.raises(MapError, match="whole parts of the cells"):
        FeasibilityMap.load(tmp_path / "damaged.npz")


@st.composite
def profiles(draw):
    heights = np.cumsum(draw(st.lists(st.floats(0.002, 0.05), min_size=2, max_size=6)))
    radii = draw(st.lists(st.floats(0.0, 0.06), min_size=len(heights), max_size=len(heights)))
    return Profile(np.column_stack([heights, np.maximum(radii, 1e-3)]))


@settings(max_examples=60, deadline=None)
@given(profiles(), st.floats(0, 1), st.floats(0, 1), st.sampled_from(["franka", "wsg50", "pr2"]))
def test_fit_of_ranges_agrees_with_fit_at_heights(profile, a, b, name):
    hand = HANDS[name]
    low, high = profile.h_min + (profile.h_max - profile.h_min) * np.sort([a, b])
    at = np.clip(np.linspace(low, high, 41), profile.h_min, profile.h_max)
    fits = [fit(hand, profile, float(h)) is None for h in at]
    assert all(fits) or not fits_all(hand, profile, float(low), float(high))
    assert not (any(fits) and fits_none(hand, profile, float(low), float(high)))


def test_arm_never_reaches_further():
    rng = np.random.default_rng(0)
    arm = Scene.load("bottle_on_table").arm("panda")
    axes = np.cumsum(arm.P, axis=0)[:-1]
    first, last, reach = arm_reach(axes, arm.H)
    wrist = arm.R0.T @ (last - arm.P.sum(axis=0))  # in the tool frame: it is on the last axis
    q = rng.uniform(np.maximum(arm.lower, -np.pi), np.minimum(arm.upper, np.pi), (20_000, arm.dof))
    T = arm.tool_pose(q)
    away = np.linalg.norm(T[:, :3, :3] @ wrist + T[:, :3, 3] - first, axis=-1)
    assert away.max() <= reach
    assert away.max() > 0.9 * reach


@pytest.mark.parametrize("name", ["soda_can", "handover_between_robots", "g1_bottle"])
def test_hands_move_no_further_than_their_play(name):
    scene = Scene.load(name)
    grid = scene.manifold
    with open_world(scene) as world:
        maker = MapMaker(world)
        for arm in scene.arms.values():
            engine = maker._engine(arm, None, grid)
            geometry = engine._geometry
            count = geometry.moving.hand.shape[1]
            links = [n.link for n in geometry.names[:count]]
            rows, first, _ = new_rows(arm, grid, 2, links, geometry.pieces)
            for level in range(2):  # the rows of the next level lie in these
                own = np.arange(first[level], first[level + 1])
                finer = first[level + 1] + np.arange(2 * len(own))
                parent = own[np.arange(len(finer)) // 2]
                for k in range(count):
                    start, end, _ = geometry.pieces.ranges[k]
                    corners = geometry.pieces.vertices[start:end]
                    placed = [
                        np.einsum("rij,pj->rpi", T[:, :9].reshape(-1, 3, 3), corners) + T[:, None, 9:]
                        for T in (rows.hand[finer, k], rows.hand[parent, k])
                    ]
                    moved = np.linalg.norm(placed[0] - placed[1], axis=-1).max(axis=1)
                    assert (moved <= rows.play[parent, k] + 1e-12).all()


def test_proofs_tell_progress_and_can_be_cancelled():
    scene = Scene.load("pick_pour_place").with_settings(heights=6, angles=24)
    shares: list[float] = []

    def cancel(share: float) -> None:
        if share > 0.5:  # searched, and the first cells are proven
            raise Cancelled

    with open_world(scene) as world:
        maker = MapMaker(world)
        told = maker.map(progress=shares.append, certify=True)
        assert shares == sorted(shares)
        assert sum(0.5 < share < 1.0 for share in shares) >= 2
        assert shares[-1] == 1.0
        with pytest.raises(Cancelled):
            maker.map(progress=cancel, certify=True)
        assert np.array_equal(maker.map(certify=True).certified, told.certified)
