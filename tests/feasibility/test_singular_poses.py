"""Maps whose redundancy is searched find what is free at singular poses, and where joints stand at limits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from symgrasp.bench.arms.singular import configuration_sets
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
from symgrasp.world import BulletWorld, open_world
from tests.conftest import some

POSES = 25
"""Poses of each set."""

MISSED = {
    "ur5": [  # joints 2, 3, 4 and 6 share a turn, and of all their configurations most hit the robot itself
        (3.056229498575579, -1.2086257568000627, 1.837573042928109, -2.3439965985692055,
         -2.0755360461586126e-10, -2.913299223524992),
    ],
    "z1": [  # joint 3 at a limit, beyond which the rounding of the map's tool pose puts it
        (-1.0909908835655984, 0.6160495575568704, 0.0, -0.29386848769861196, -1.0233648391999794,
         0.39675392192230463),
        (-2.289963707498506, 2.6298938451624037, -2.8797932657906435, -0.11640554826453053,
         -0.9430303426419302, 0.6866464787255739),
    ],
    "tiago_dual": [  # the wrist aligned, or nearly: inside the limits on about 1e-3 or 1e-8 rad of φ
        (-0.26217508989492133, 0.9633511917332749, -0.47300811615322425, 2.1097023156006034,
         1.2962377731546235, 0.0007732078678624812, 1.889506603059727),
        (-0.9821201824020125, -0.06961706505004472, -0.7127347208158461, 1.5334097749162479,
         1.8845199848521959, -6.054637028732751e-09, 2.0808456088939535),
    ],
}  # fmt: skip
"""Configurations that are free, to whose poses few others lead."""


SOUGHT = {
    "tiago_pro": [
        (0.758988782982596, -1.6428245799321703, 0.11564727314550893, -0.14939949608704994,
         1.283845076367042, 0.959310173424254, -1.215621525781324),
    ],
}  # fmt: skip
"""Configurations to whose poses only Newton's method leads, all joints free."""


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


class Comparison:
    """A map of one cell, and what PyBullet says of a configuration that reaches it."""

    def __init__(self, scene: Scene, world: BulletWorld) -> None:
        assert scene.settings.approach == 0.0
        self.arm, self._world, self._maker = scene.arm(), world, MapMaker(world)
        self._checker = CandidateChecker(
            world, self.arm, solver_for(self.arm, 1), 0.0, holders=(self.arm.name,)
        )
        self._T_tool_object = inverse(self.arm.hand.tool_poses(scene.manifold, np.eye(4))[0, 0, 0])

    def is_free(self, q: np.ndarray, kind: str) -> bool:
        """Whether a configuration (n,) is free with the object where the tool is; then the map says so."""
        arm = self.arm
        T = arm.world_tool_pose(q) @ self._T_tool_object
        found = self._maker.map(task=Task("other", (arm.name,), T))
        T_base_tool = inverse(arm.robot.T_world_base) @ arm.world_tool_pose(q)
        self._world.set_object(T)
        opening = float(found.opening[0])
        free = self._checker.check(T_base_tool, q, 0, opening).reason == Reason.FEASIBLE
        why = Reason(found.reason[0, 0, 0]).label
        assert found.feasible[0, 0, 0] or not free, f"{kind}: {q.tolist()} is free, the map: {why}"
        return free

    def holds_its_witness(self, q: np.ndarray) -> bool:
        """Whether one of the windows of the cell that a configuration (n,) reaches holds its witness."""
        task = Task("other", (self.arm.name,), self.arm.world_tool_pose(q) @ self._T_tool_object)
        found = self._maker.map(task=task)
        witness = found.witness((0, 0, 0))
        assert witness
        (windows,) = self._maker.windows(found, np.zeros((1, 3)))
        return any(w.branch == witness.branch and w.low <= witness.phi <= w.high for w in windows)


@pytest.mark.parametrize("name", some(2, ["iiwa", "z1", "panda", "gen3", "alex", "tiago_pro", "ur5"]))
def test_what_is_free_is_feasible(name):
    """Of random poses, singular ones, and those with a joint at a limit."""
    scene = starter(name)
    rng, count = np.random.default_rng(0), 0
    with open_world(scene) as world:
        comparison = Comparison(scene, world)
        for kind, rows in configuration_sets(comparison.arm, POSES, POSES, 4):
            for q in rows[rng.permutation(len(rows))[:POSES]]:
                count += comparison.is_free(q, kind)
    assert count > POSES


@pytest.mark.parametrize("name", MISSED)
def test_single_poses(name):
    scene = starter(name)
    with open_world(scene) as world:
        comparison = Comparison(scene, world)
        for q in MISSED[name]:
            assert comparison.is_free(np.array(q), "single"), q


@pytest.mark.parametrize("name", ["tiago_dual", "tiago_pro"])
def test_windows_hold_the_witness(name):
    """Also where the arm is free at single values of its redundancy, or only Newton's method finds any."""
    scene = starter(name)
    with open_world(scene) as world:
        comparison = Comparison(scene, world)
        for q in [*MISSED.get(name, ()), *SOUGHT.get(name, ())]:
            assert comparison.holds_its_witness(np.array(q)), q
