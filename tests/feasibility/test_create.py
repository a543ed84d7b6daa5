from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from IPython.core.formatters import DisplayFormatter

from symgrasp.errors import Cancelled, MapError
from symgrasp.feasibility.cell import Cell
from symgrasp.feasibility.create import MapMaker, create_map, explain
from symgrasp.feasibility.exact import engine
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.ik import CompiledIK
from symgrasp.ik.retreat import retreated
from symgrasp.object.manifold import ROLLS, wrap
from symgrasp.poses import from_position_rpy, inverse, pose_error, rotation_z, translation
from symgrasp.reason import Reason
from symgrasp.scene.scene import Scene
from symgrasp.world import BulletWorld
from tests.conftest import PLAIN, load_small, write_scene
from tests.ik.eaik import EaikIK

DATA = Path(__file__).parents[1] / "data"


def turned(scene: Scene, task: str, T: np.ndarray) -> Scene:
    return scene.with_task(replace(scene.task(task), T_world_object=T))


@pytest.fixture(scope="module")
def bottle_map() -> FeasibilityMap:
    return create_map(load_small("bottle_on_table", 12, 24, 8))


@pytest.mark.parametrize("name", PLAIN)
def test_shipped_scenes_have_feasible_and_infeasible_cells(name):
    scene = load_small(name)
    for task in scene.tasks.values():
        for arm in task.arms:
            m = create_map(scene, task=task.name, arm=arm)
            assert m.feasible.any()
            assert not m.feasible.all()


@pytest.mark.parametrize("name", PLAIN)
def test_turning_the_object_shifts_the_map(name):
    """Equation 3 by brute force: recomputed for the turned object equals shifted, witnesses and all."""
    scene = load_small(name)
    rng = np.random.default_rng(PLAIN.index(name))
    task = scene.task(rng.choice(list(scene.tasks)))
    m = create_map(scene, task=task.name)
    for k in rng.integers(1, scene.manifold.angles, 2):
        delta = float(k * m.manifold.dtheta)
        again = create_map(turned(scene, task.name, task.T_world_object @ rotation_z(delta)), task=task.name)
        shifted = m.shift(delta)
        assert np.array_equal(again.reason, np.roll(m.reason, -k, axis=2))
        assert np.array_equal(again.reason, shifted.reason)
        assert np.array_equal(again.q, shifted.q, equal_nan=True)
        np.testing.assert_allclose(again.T_world_object, shifted.T_world_object)


@pytest.mark.parametrize("delta", [0.1, -2.0])
def test_turning_by_a_part_of_a_cell_is_exact_too(delta):
    scene = load_small("pick_pour_place")
    m = create_map(scene, task="pour")
    shifted = m.shift(delta)
    T = scene.task("pour").T_world_object @ rotation_z(delta)
    again = create_map(turned(scene, "pour", T), task="pour", manifold=shifted.manifold)
    assert np.array_equal(again.reason, shifted.reason)


def test_shifting_there_and_back(bottle_map):
    there = bottle_map.shift(1.234)
    back = there.shift(-1.234)
    assert np.array_equal(back.reason, bottle_map.reason)
    assert back.manifold.theta_start == pytest.approx(bottle_map.manifold.theta_start)


def test_the_map_by_brute_force():
    """Every cell of a small map, decided here from scratch: tool pose, all branches, PyBullet."""
    scene = load_small("pick_pour_place", 6, 8, 4)
    arm = scene.arm()
    for task in scene.tasks.values():
        m = create_map(scene, task=task.name, method="reference")
        ik = EaikIK(arm, 4)
        with BulletWorld(scene) as world:
            world.set_object(task.T_world_object)
            for roll, i, j in np.ndindex(m.reason.shape):
                h, theta = float(m.manifold.h[i]), float(m.manifold.theta[j])
                radius = float(scene.profile.radius(h))
                free, reached, depths = False, Reason.UNREACHABLE, {}
                if not arm.hand.pads_rest(scene.profile, h):
                    reached = Reason.SURFACE_TOO_STEEP
                else:
                    side = 1.0 if roll == 0 else -1.0
                    hand = np.eye(4)
                    hand[:3, :3] = np.array([[0, 0, -1], [0, side, 0], [side, 0, 0]])
                    offset = translation([max(0.0, radius - arm.hand.finger_depth), 0, h])
                    T = task.T_world_object @ rotation_z(theta) @ offset @ hand
                    solutions = ik.solve(inverse(arm.robot.T_world_base) @ T)
                    for q, inside in zip(solutions.q, solutions.inside, strict=True):
                        stage = Reason.JOINT_LIMITS
                        if inside:
                            world.set_arm(arm, q, arm.hand.opening(radius))
                            hit = world.first_collision(arm)
                            free |= hit is None
                            stage = hit.reason if hit else Reason.FEASIBLE
                            if hit:
                                depths.setdefault(stage, []).append(hit.depth)
                        reached = max(reached, stage)
                assert bool(m.feasible[roll, i, j]) == free
                assert m.reason[roll, i, j] == reached
                if reached in depths:  # the candidate that came closest to being free
                    assert m.depth[roll, i, j] == pytest.approx(min(depths[reached]), abs=1e-9)


def test_witnesses_prove_their_cells(shipped):
    task = shipped.task()
    arm = shipped.arm(task.arms[0])
    m = create_map(shipped)
    tools = m.manifold.tool_poses(task.T_world_object, arm.hand.finger_depth)
    checked = 0
    with BulletWorld(shipped) as world:
        world.set_object(task.T_world_object)
        for index in np.ndindex(m.reason.shape):
            cell = Cell(*index)
            witness = m.witness(cell)
            assert (witness is not None) == m.feasible[cell]
            if witness is None:
                assert np.isnan(m.q[cell]).all()
                continue
            position, rotation = pose_error(arm.world_tool_pose(witness.q), tools[cell])
            assert position < 1e-6
            assert rotation < 1e-6
            assert ((witness.q >= arm.lower) & (witness.q <= arm.upper)).all()
            world.set_arm(arm, witness.q, witness.opening)
            assert not world.collisions([arm])
            checked += 1
    assert checked == m.feasible.sum() > 0


def test_collision_reasons_name_a_pair(bottle_map):
    collisions = (bottle_map.reason >= Reason.SELF_COLLISION) & ~bottle_map.feasible
    assert collisions.any()
    assert (bottle_map.pair[collisions] >= 0).all()
    assert (bottle_map.depth[collisions] > 0).all()
    assert (bottle_map.pair[~collisions] == -1).all()
    cell = Cell(*map(int, np.argwhere(collisions)[0]))
    assert "too close" in bottle_map.why(cell)
    assert "panda/" in bottle_map.why(cell)


def test_a_hand_that_is_too_small(content, tmp_path):
    content["object"]["profile"] = [[0, 0.06], [0.2, 0.03]]
    content["map"] = {"heights": 10, "angles": 4, "redundancy": 2}
    scene = Scene.load(write_scene(tmp_path, content))
    m = create_map(scene)
    too_wide = 2 * scene.profile.radius(m.manifold.h) > 0.08
    assert np.array_equal((m.reason == Reason.HAND_TOO_SMALL).all(axis=(0, 2)), too_wide)


def test_an_approach_can_only_block(bottle_map):
    scene = load_small("bottle_on_table", 12, 24, 8)
    with_approach = create_map(scene.with_settings(approach=0.12))
    assert not (with_approach.feasible & ~bottle_map.feasible).any()
    blocked = bottle_map.feasible & ~with_approach.feasible
    assert blocked.any()
    assert (with_approach.reason[blocked] == Reason.APPROACH_BLOCKED).all()


def test_an_approach_follows_one_branch(bottle_map, monkeypatch):
    """No step of the retreat may jump: with no room for the joints to move, everything is blocked."""
    scene = load_small("bottle_on_table", 12, 24, 8).with_settings(approach=0.05)
    assert create_map(scene, method="reference").feasible.any()
    monkeypatch.setattr("symgrasp.ik.retreat.RETREAT_TURN", 1e-6)
    blocked = create_map(scene, method="reference")
    assert not blocked.feasible.any()
    assert (blocked.reason[bottle_map.feasible] == Reason.APPROACH_BLOCKED).all()


@pytest.mark.parametrize("method", ["exact", "reference"])
def test_a_retreat_turns_no_joint_faster_than_it_can(method):
    """With the hand at 0.1 m/s: slower joints leave fewer cells, and slow ones none."""
    content = (
        Scene.load("bottle_on_table").with_settings(heights=8, angles=12, redundancy=4, approach=0.05).content
    )
    found = []
    for velocity in (None, 0.4, 0.3, 0.2):
        content["robots"][0]["velocity"] = velocity
        found.append(create_map(Scene.from_content(content), method=method))
    for fast, slow in pairwise(found):
        assert not (slow.feasible & ~fast.feasible).any()
        assert slow.feasible.sum() < fast.feasible.sum()
    assert not found[-1].feasible.any()
    assert (found[-1].reason[found[0].feasible] == Reason.APPROACH_BLOCKED).all()


def test_joints_of_witnesses_are_fast_enough_for_the_hand_on_the_retreat():
    """Followed millimetre by millimetre by another solver, at 0.1 m/s; without the limit some are not."""
    content = Scene.load("bottle_on_table").content
    content["map"] = {"heights": 6, "angles": 12, "redundancy": 4, "approach": 0.05}
    limit, fastest = 0.4, {}
    for velocity in (None, limit):
        content["robots"][0]["velocity"] = velocity
        scene = Scene.from_content(content)
        m, arm = create_map(scene), scene.arm()
        tools = inverse(arm.robot.T_world_base) @ arm.hand.tool_poses(m.manifold, m.T_world_object)
        speeds = []
        for index in np.argwhere(m.feasible).tolist():
            witness = m.witness(Cell(*index))
            assert witness is not None
            ik, way = EaikIK(arm, 1).at(np.array([witness.phi])), [witness.q]
            for distance in np.linspace(0.001, 0.05, 50):
                q = ik.solve(retreated(tools[tuple(index)], distance)).q
                away = np.abs(wrap(q - way[-1]))
                near = away.max(axis=1).argmin()
                assert away[near].max() < 0.2
                way.append(way[-1] + wrap(q[near] - way[-1]))
            steps = np.diff(np.array(way)[::10], axis=0)  # one for each pose that is checked
            speeds.append(np.abs(steps).max() / (0.01 / 0.1))
        fastest[velocity] = max(speeds)
        assert len(speeds) > 5
    assert fastest[limit] <= limit + 1e-6 < fastest[None]


def test_a_margin_can_only_block(bottle_map):
    scene = load_small("bottle_on_table", 12, 24, 8)
    careful = create_map(scene.with_settings(margin=0.01))
    assert not (careful.feasible & ~bottle_map.feasible).any()
    assert (bottle_map.feasible & ~careful.feasible).any()


def test_the_other_robot_is_an_obstacle():
    """Parked in the way, the right robot takes cells from the left one."""
    scene = load_small("log_two_robots")
    right = scene.robots["right"]
    model = right.model
    home = right.home.copy()
    home[[model.joint_names.index(n) for n in scene.arm("right").joint_names]] = [
        0,
        0.6,
        0,
        -1.2,
        0,
        1.8,
        0.785,
    ]
    stretched = replace(right, home=home)
    arm = scene.arm("right")
    moved = type(arm)(arm.name, stretched, arm.tool, arm.hand)
    blocked = replace(scene, robots={**scene.robots, "right": stretched}, arms={**scene.arms, "right": moved})
    before, after = create_map(scene, arm="left"), create_map(blocked, arm="left")
    assert (after.reason == Reason.ROBOT_COLLISION).any()
    assert not (after.feasible & ~before.feasible).any()


@pytest.mark.parametrize("method", ["exact", "reference"])
def test_progress_and_cancel(method, monkeypatch):
    monkeypatch.setattr(engine, "TELL", 0.0)
    shares = []
    scene = load_small("soda_can")
    create_map(scene, method=method, progress=shares.append)
    assert len(shares) > 2
    assert shares == sorted(shares)
    assert shares[-1] == 1.0

    def stop(share):
        raise Cancelled

    with pytest.raises(Cancelled):
        create_map(scene, method=method, progress=stop)


@pytest.mark.parametrize("method", ["exact", "reference"])
def test_a_cancelled_map_leaves_no_trace(method, monkeypatch):
    """In the world of a map that was stopped half-way, the next map is what it is in a new world."""
    monkeypatch.setattr(engine, "TELL", 0.0)
    scene = load_small("log_two_robots")

    def stop(share):
        if share > 0.4:
            raise Cancelled

    with BulletWorld(scene) as world:
        with pytest.raises(Cancelled):
            MapMaker(world).map("left", method=method, progress=stop)
        again = MapMaker(world).map("right", method=method)
    assert np.array_equal(again.reason, create_map(scene, arm="right", method=method).reason)


def test_a_world_can_be_used_again():
    scene = load_small("pick_pour_place")
    with BulletWorld(scene) as world:
        for task in scene.tasks:
            shared = MapMaker(world).map(task=task)
            assert np.array_equal(shared.reason, create_map(scene, task=task).reason)


def test_margin_of_a_cell_by_hand(bottle_map):
    feasible = np.zeros((2, 5, 8), dtype=np.uint8)
    feasible[0, 1:4, [7, 0, 1]] = Reason.FEASIBLE
    grid = type(bottle_map.manifold)(bottle_map.manifold.profile, 5, 8)
    m = replace(
        bottle_map, reason=feasible, manifold=grid, **{
            name: np.zeros((2, 5, 8)) for name in ("sample", "branch", "depth")
        }
    )  # fmt: skip
    assert m.margin((0, 2, 0)) == pytest.approx((2 * grid.dh, 2 * grid.dtheta))
    assert m.margin((0, 1, 7)) == pytest.approx((grid.dh, grid.dtheta))
    assert m.margin((1, 2, 0)) == (0, 0)


def test_npz_round_trip(bottle_map, tmp_path):
    path = tmp_path / "map.npz"
    bottle_map.shift(0.3).save(path)
    back = FeasibilityMap.load(path)
    again = bottle_map.shift(0.3)
    for name in ("reason", "q", "sample", "branch", "phi", "opening", "pair", "depth", "T_world_object"):
        np.testing.assert_array_equal(getattr(back, name), getattr(again, name))
    assert (back.scene, back.arm, back.task) == ("bottle_on_table", "panda", "pick")
    assert back.manifold.theta_start == again.manifold.theta_start
    cell = Cell(*map(int, np.argwhere(~back.feasible)[0]))
    assert back.why(cell) == again.why(cell)
    assert list(tmp_path.iterdir()) == [path]


OLD_COUNTS = {
    Reason.JOINT_LIMITS: 202, Reason.SURFACE_TOO_STEEP: 144, Reason.UNREACHABLE: 134, Reason.FEASIBLE: 50,
    Reason.SCENE_COLLISION: 46,
}  # fmt: skip
"""What the program that wrote ``map_version_2.npz`` said of it; its reasons had other numbers."""


def test_reasons_of_older_files_keep_their_meaning():
    old = FeasibilityMap.load(DATA / "map_version_2.npz")
    assert old.counts() == OLD_COUNTS
    assert old.feasible.sum() == np.isfinite(old.clearance).sum()
    for cell in np.argwhere(old.pair[..., 0] >= 0):
        assert old.why(Cell(*cell)).startswith("hits an obstacle: ")


@pytest.mark.parametrize("reasons", [["FEASIBLE"], ["NO_SUCH_REASON"] * 20, None, 5])
def test_reasons_that_a_file_does_not_name(bottle_map, tmp_path, monkeypatch, reasons):
    path = tmp_path / "map.npz"
    meta = {**bottle_map._meta(), "reasons": reasons}
    monkeypatch.setattr(FeasibilityMap, "_meta", lambda self: meta)
    bottle_map.save(path)
    with pytest.raises(MapError, match="written by symgrasp"):
        FeasibilityMap.load(path)


@pytest.mark.parametrize("method", ["exact", "reference"])
def test_what_a_search_does_not_reach_is_not_found(monkeypatch, method):
    """The same map but for the word: a search may have missed a configuration."""
    scene = load_small("soda_can", 6, 12, 2)
    proven = create_map(scene, method=method)
    monkeypatch.setattr(CompiledIK, "complete", False)
    searched = create_map(scene, method=method)
    renamed = np.where(proven.reason == Reason.UNREACHABLE, Reason.NOT_FOUND, proven.reason)
    assert (renamed == Reason.NOT_FOUND).any()
    np.testing.assert_array_equal(searched.reason, renamed)
    cell = Cell(*map(int, np.argwhere(renamed == Reason.NOT_FOUND)[0]))
    assert "no proof" in searched.why(cell)
    h, theta = scene.manifold.h[cell.row], scene.manifold.theta[cell.column]
    found = explain(scene, h, theta, ROLLS[cell.roll])
    assert found.reason == Reason.NOT_FOUND and "no proof" in str(found)


def test_files_that_are_no_maps(bottle_map, tmp_path):
    with pytest.raises(MapError, match="existing map file"):
        FeasibilityMap.load(tmp_path / "none.npz")
    text = tmp_path / "text.npz"
    text.write_text("hello")
    with pytest.raises(MapError, match="written by symgrasp"):
        FeasibilityMap.load(text)
    pickled = tmp_path / "pickled.npz"
    np.savez(pickled, meta=np.array({"version": 1}, dtype=object))
    with pytest.raises(MapError):
        FeasibilityMap.load(pickled)
    whole = bottle_map.to_npz()
    text.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(MapError):
        FeasibilityMap.load(text)


def test_the_picture_is_a_png(bottle_map):
    png, _ = DisplayFormatter().format(bottle_map, include={"image/png"})
    assert png["image/png"].startswith(b"\x89PNG")
    figure = bottle_map.plot()
    assert len(figure.axes) == len(ROLLS)
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert f"feasible ({bottle_map.feasible.sum()})" in labels


def test_maps_do_not_change(bottle_map):
    with pytest.raises(ValueError, match="read-only"):
        bottle_map.reason[0, 0, 0] = 0


def test_tilted_objects_have_maps_too():
    scene = load_small("bottle_on_table")
    T = from_position_rpy([0.5, 0.0, 0.2], [0.9, 0.3, 0.0])
    m = create_map(turned(scene, "pick", T))
    assert m.feasible.any()


def test_margins_by_walking(bottle_map):
    """For every cell: walk up, down, left and right until a cell is infeasible or the object ends."""
    rng = np.random.default_rng(0)
    feasible = rng.random((2, 12, 24)) < 0.8
    feasible[0, 3] = True  # a whole turn
    m = replace(bottle_map, reason=np.where(feasible, Reason.FEASIBLE, Reason.UNREACHABLE))
    for roll, i, j in np.ndindex(feasible.shape):
        down = next(k for k in range(13) if i - k < 0 or not feasible[roll, i - k, j])
        up = next(k for k in range(13) if i + k > 11 or not feasible[roll, i + k, j])
        around = next((k for k in range(12) for s in (-k, k) if not feasible[roll, i, (j + s) % 24]), 12)
        expected = (min(up, down) * m.manifold.dh, around * m.manifold.dtheta)
        assert m.margin((roll, i, j)) == pytest.approx(expected)
