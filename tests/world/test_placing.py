"""Where robots that are put into a scene stand."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from symgrasp.errors import SceneError
from symgrasp.feasibility.starter import robot_content
from symgrasp.found_arms import find_arms
from symgrasp.poses import translation
from symgrasp.references import resolve
from symgrasp.robot.catalogue import CATALOGUE
from symgrasp.robot.model import RobotModel
from symgrasp.scene.format import RobotFile
from symgrasp.scene.replacing import with_base, with_robot
from symgrasp.scene.scene import Scene
from symgrasp.world import placed

coal = pytest.importorskip("coal")


def put(scene: Scene, name: str) -> Scene:
    """Put a robot of the catalogue into a scene, in the place of its only one, at its base."""
    robot = next(robot for robot in CATALOGUE if robot.name == name)
    path = resolve(robot.urdf, Path())
    assert path
    arms = find_arms(RobotModel(path))
    entry = RobotFile.model_validate(robot_content(name, robot.urdf, arms))
    return with_robot(scene, next(iter(scene.robots)), entry)


def deepest(scene: Scene, name: str) -> float:
    """Return how deep (m) the links that no arm moves are inside of boxes, by another library."""
    robot = scene.robots[name]
    moved = {k for arm in scene.arms.values() for k in arm.indices.tolist()}
    poses = robot.T_world_base @ robot.model.forward(robot.home)
    depths = [0.0]
    for link, pose in zip(robot.model.link_names, poses, strict=True):
        if any(joint.source in moved for joint in robot.model.chain(link)):
            continue
        for hull in robot.model.hulls(link):
            mesh = trimesh.convex.convex_hull(hull)
            points = coal.StdVec_Vec3s()
            points.extend(list(mesh.vertices))
            shape = coal.Convex.convexHull(points, False, "Qt")
            for obstacle in scene.obstacles:
                if obstacle.kind != "box":
                    continue
                result = coal.DistanceResult()
                box, where = coal.Box(*obstacle.size), obstacle.T_world_obstacle
                places = (
                    coal.Transform3s(pose[:3, :3], pose[:3, 3]),
                    coal.Transform3s(where[:3, :3], where[:3, 3]),
                )
                distance = coal.distance(shape, places[0], box, places[1], coal.DistanceRequest(), result)
                depths.append(-distance)
    return max(depths)


@pytest.fixture(scope="module")
def bottle() -> Scene:
    return Scene.load("bottle_on_table")


def test_a_robot_with_a_large_body_stands_beside_the_table(bottle):
    before = put(bottle, "pr2")
    scene = placed(before, "pr2", bottle.arm())
    sunk = with_base(before, "pr2", translation([0.0, 0.0, -0.47]))
    assert deepest(sunk, "pr2") > 0.02
    assert deepest(scene, "pr2") < 2e-3
    arm = next(iter(scene.arms.values()))
    shoulder = scene.robots["pr2"].T_world_base[:3, 3] + scene.robots["pr2"].T_world_base[:3, :3] @ arm.P[0]
    assert np.linalg.norm(shoulder - [0.55, 0.0, 0.15]) < np.linalg.norm(arm.P[1:], axis=-1).sum()


def test_a_robot_that_finds_no_room_is_refused(bottle):
    wall = bottle.obstacles[0]
    file = bottle.file.obstacles[0].model_copy(update={"box": (9.0, 9.0, 9.0)})
    full = replace(
        put(bottle, "ur3"),
        file=bottle.file.model_copy(update={"obstacles": (file,)}),
        obstacles=(replace(wall, size=(9.0, 9.0, 9.0)),),
    )
    with pytest.raises(SceneError, match="free of obstacles with bottle in reach"):
        placed(full, "ur3", bottle.arm())
