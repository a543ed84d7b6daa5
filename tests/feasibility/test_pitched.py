"""Maps of an SO-101, whose five joints leave the pitch of its hand free."""

from __future__ import annotations

import numpy as np
import pytest

from symgrasp.bench.arms import robots
from symgrasp.feasibility.create import MapMaker
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.object.manifold import Manifold
from symgrasp.poses import inverse
from symgrasp.reason import Reason
from symgrasp.robot.robot import AZIMUTH, PITCH
from symgrasp.scene.scene import Scene
from symgrasp.world import BulletWorld, open_world
from tests.engine.identity import assert_same, assert_true

GRID = {"heights": 6, "angles": 24, "redundancy": 8}

JAW = {
    # About as its jaw is; what matters here is that it is 8 mm beside the axis that rolls it.
    "name": "jaw",
    "links": ["gripper_link", "moving_jaw_so101_v1_link"],
    "touch_links": ["gripper_link", "moving_jaw_so101_v1_link"],
    "joints": {"gripper": [[0.0, 0.0], [0.1, 1.5]]},
    "min_opening": 0.0,
    "max_opening": 0.1,
    "finger_depth": 0.05,
    "pad_width": 0.02,
    "tool": {
        "link": "gripper_link",
        "pose": {"position": [-0.0079, 0.0, -0.098], "quat_wxyz": [0.0, np.sqrt(0.5), np.sqrt(0.5), 0.0]},
    },
}

POSES = {
    "upright": {"position": [0.28, 0.05, 0.0]},
    "lying": {"position": [0.25, -0.05, 0.05], "rpy_deg": [90, 0, 0]},
    "leaning": {"position": [0.25, 0.0, 0.05], "rpy_deg": [20, 30, 0]},
}


def so101(pose: str) -> Scene:
    """Return a scene with a can on a table that it stands on."""
    return Scene.from_content({
        "schema_version": 1,
        "name": f"so101_{pose}",
        "robots": [
            {
                "name": "so101",
                "urdf": "package://example-robot-data/robots/so_arm_description/urdf/so101.urdf",
                "joints": ["shoulder_pan", "wrist_roll"],
                "hand": JAW,
            }
        ],
        "object": {"name": "can", "profile": [[0, 0.02], [0.1, 0.02]]},
        "obstacles": [{"name": "table", "box": [1, 1, 0.04], "pose": {"position": [0.2, 0, -0.03]}}],
        "tasks": [{"name": "hold", "pose": POSES[pose]}],
        "map": GRID,
    })  # fmt: skip


@pytest.fixture(params=POSES)
def world(request):
    with open_world(so101(request.param)) as world:
        yield world


def test_both_engines_agree_and_a_numerical_search_finds_no_fault(world: BulletWorld, monkeypatch):
    """It turns the hand as far as the grasp allows, and holds the object anywhere in the cell."""
    monkeypatch.setattr(robots, "CHECKED", 20)
    maker, scene = MapMaker(world), world.scene
    exact = maker.map()
    assert 10 < np.count_nonzero(exact.feasible) < 0.5 * exact.reason.size
    assert_same(exact, maker.map(method="reference"))
    assert_true(world, scene, scene.arm(), exact)
    for reasons in robots.KINDS:
        check = robots.check(scene, [exact], reasons)
        assert check.cells >= 8
        assert check.missed == 0
        assert check.reached < 6  # which are between the samples
    control = robots.check(scene, [exact], [Reason.FEASIBLE])
    assert control.missed == 0
    assert control.reached >= 0.9 * control.cells


def test_an_upright_can_is_held_from_one_side_or_from_above():
    """The arm moves in an upright plane through its pan axis; only a hand that points down may turn in it."""
    scene = so101("upright")
    with open_world(scene) as world:
        m: FeasibilityMap = MapMaker(world).map()
    arm = scene.arm()
    pan = inverse(m.T_world_object) @ [0.0388, 0.0, 0.0, 1.0]
    towards = np.arctan2(pan[1], pan[0])
    sideways = 0
    for cell in np.argwhere(m.feasible):
        q = m.q[tuple(cell)]
        way = 1.0 if cell[0] == 0 else -1.0
        azimuth = float(m.manifold.theta[cell[2]] - way * q[AZIMUTH])
        tool = (
            inverse(m.T_world_object)
            @ arm.robot.T_world_base
            @ arm.robot.model.forward(arm.robot_values(q))[arm.robot.model.link_index(arm.tool)]
        )
        assert tool[:3, 2] == pytest.approx(
            [
                -np.cos(azimuth) * np.cos(q[PITCH]),
                -np.sin(azimuth) * np.cos(q[PITCH]),
                -way * np.sin(q[PITCH]),
            ],
            abs=1e-6,
        )
        if np.cos(q[PITCH]) > 0.1:
            sideways += 1
            assert abs((azimuth - towards + np.pi) % (2 * np.pi) - np.pi) < 0.1
    assert sideways > 5


def test_a_cell_is_its_whole_width():
    """Twice as many angles halve the cells: what is held in a half is held in the whole."""
    scene = so101("upright")
    with open_world(scene) as world:
        maker = MapMaker(world)
        coarse = maker.map()
        fine = maker.map(manifold=Manifold(scene.profile, GRID["heights"], 2 * GRID["angles"]))
    sampled = fine.sample > 0
    halves = (fine.feasible & sampled).reshape(2, GRID["heights"], GRID["angles"], 2)
    assert halves.any()
    assert coarse.feasible[halves.any(axis=3)].all()


def test_explanations_name_the_pitch():
    scene = so101("upright")
    with open_world(scene) as world:
        maker = MapMaker(world)
        m = maker.map()
        for cell in np.argwhere(m.reason == Reason.JOINT_LIMITS):
            found = maker.explain(None, None, tuple(cell.tolist()))
            assert found.reason == Reason.JOINT_LIMITS
            if "pitch" in str(found):
                break
        else:
            raise AssertionError("no explanation names the pitch")
        names = {v.joint for c in found.candidates for v in c.violations}
        assert "azimuth" not in names
        feasible = tuple(np.argwhere(m.feasible)[0].tolist())
        assert maker.explain(None, None, feasible).reason == Reason.FEASIBLE
