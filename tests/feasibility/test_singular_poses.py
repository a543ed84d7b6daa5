"""Maps whose redundancy is searched find what is free at singular poses, and where joints stand at limits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from symgrasp.bench.singular import configuration_sets
from symgrasp.feasibility.candidates import CandidateChecker
from symgrasp.feasibility.create import MapMaker
from symgrasp.feasibility.starter import starter_scene
from symgrasp.found_arms import find_arms
from symgrasp.ik import solver_for
from symgrasp.poses import inverse
from symgrasp.reason import Reason
from symgrasp.references import resolve
from symgrasp.robot.catalogue import CATALOGUE
from symgrasp.robot.model import RobotModel
from symgrasp.scene.parts import Task
from symgrasp.scene.scene import Scene
from symgrasp.world import open_world

POSES = 25
"""Poses of each set."""


def starter(name: str) -> Scene:
    """Return a scene with a robot of the catalogue, whose maps have one cell."""
    robot = next(robot for robot in CATALOGUE if robot.name == name)
    path = resolve(robot.urdf, Path())
    if path is None:
        pytest.skip(f"pip install {robot.package}")
    found = find_arms(RobotModel(path, follow_up_axis=robot.follow_up_axis))[0]
    content = starter_scene(robot.name, robot.urdf, [found], robot.reading)
    content["map"] = {"heights": 1, "angles": 1, "redundancy": "auto"}
    return Scene.from_content(content)


@pytest.mark.parametrize("name", ["panda", "iiwa", "gen3", "alex", "tiago_pro"])
def test_what_is_free_is_feasible(name):
    """The object stands where the tool is at a configuration; PyBullet says whether that one is free."""
    scene = starter(name)
    arm = scene.arm()
    ik = solver_for(arm, 1)
    assert scene.settings.approach == 0.0
    T_tool_object = inverse(arm.hand.tool_poses(scene.manifold, np.eye(4))[0, 0, 0])
    rng, count = np.random.default_rng(0), 0
    with open_world(scene) as world:
        maker = MapMaker(world)
        checker = CandidateChecker(world, arm, ik, 0.0, holders=(arm.name,))
        for kind, rows in configuration_sets(arm, POSES, POSES, 4):
            for q in rows[rng.permutation(len(rows))[:POSES]]:
                T = arm.world_tool_pose(q) @ T_tool_object
                found = maker.map(task=Task("other", (arm.name,), T))
                T_base_tool = inverse(arm.robot.T_world_base) @ arm.world_tool_pose(q)
                world.set_object(T)
                free = checker.check(T_base_tool, q, 0, float(found.opening[0])).reason == Reason.FEASIBLE
                count += free
                why = Reason(found.reason[0, 0, 0]).label
                assert found.feasible[0, 0, 0] or not free, f"{kind}: {q.tolist()} is free, the map: {why}"
    assert count > POSES
