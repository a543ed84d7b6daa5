"""What the object rests on, and in which direction it leaves it."""

from __future__ import annotations

import numpy as np
import pytest

from symgrasp.motion.bodies.motion_scene import MotionScene
from symgrasp.motion.drafting.ways import lifted
from symgrasp.poses import rotation_about
from symgrasp.scene.scene import Scene
from symgrasp.world import BulletWorld, open_world
from tests.conftest import load_small

SLOPE = np.deg2rad(20)


def scene_with(*obstacles) -> Scene:
    content = load_small("pick_pour_place").content
    tasks = [{"name": "pick", "pose": {"position": [0.5, 0.0, 0.0]}}]
    return Scene.from_content({**content, "obstacles": list(obstacles), "tasks": tasks})


TABLE = {"name": "table", "box": [1.0, 1.0, 0.1], "pose": {"position": [0.5, 0, -0.05]}}
WALL = {"name": "wall", "box": [0.1, 1.0, 1.0], "pose": {"position": [0.5 + 0.0325 + 0.0501, 0, 0.5]}}


def distance(world: BulletWorld, T: np.ndarray) -> float:
    world.set_object(T)
    return min((0.1 - c.depth for c in world.object_contacts(0.1)), default=0.1)


@pytest.mark.parametrize(
    ("obstacles", "normal"),
    [((), [0, 0, 1]), ((TABLE,), [0, 0, 1]), ((TABLE, WALL), [-np.sqrt(0.5), 0, np.sqrt(0.5)])],
)
def test_it_leaves_everything_that_it_touches(obstacles, normal):
    scene = scene_with(*obstacles)
    with open_world(scene) as world:
        bodies, T = MotionScene(scene, world), scene.task().T_world_object
        rest = bodies.rest(T)
        assert {bodies.names[piece].body for piece in rest.pieces} == {o["name"] for o in obstacles}
        np.testing.assert_allclose(rest.normal, normal, atol=1e-3)
        if obstacles:
            assert distance(world, lifted(T, rest, 0.02)) > 0.02 * np.sqrt(0.5) - 1e-3
        else:
            np.testing.assert_array_equal(lifted(T, rest), T)


def test_it_leaves_a_slope_along_its_normal():
    turn = rotation_about([0, 1, 0], SLOPE)
    slope = {**TABLE, "pose": {"position": [0.5, 0, 0], "rpy_deg": [0, float(np.rad2deg(SLOPE)), 0]}}
    scene = scene_with(slope)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = turn, [0.5, 0, 0] + turn @ [0, 0, 0.05]
    with open_world(scene) as world:
        rest = MotionScene(scene, world).rest(T)
    np.testing.assert_allclose(rest.normal, turn[:, 2], atol=1e-3)
