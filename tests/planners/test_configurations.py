"""Whole robots free of each other: against trying every combination with all of their collisions."""

from __future__ import annotations

from itertools import islice, product

import numpy as np
import yaml

from symgrasp.feasibility.candidates import CandidateChecker
from symgrasp.feasibility.create import MapMaker
from symgrasp.files import SCENES_DIR
from symgrasp.ik import solver_for
from symgrasp.planners.configurations import ConfigurationFinder, witnesses
from symgrasp.planners.free import FreePlacements
from symgrasp.planners.gaps import PrintGaps
from symgrasp.planners.holding import HoldingSearch
from symgrasp.poses import inverse
from symgrasp.reason import Reason
from symgrasp.robot.configuration import ArmConfiguration
from symgrasp.scene.balance import support_margins
from symgrasp.scene.scene import Scene
from symgrasp.world import BulletWorld


class Slow(ConfigurationFinder):
    """Tries all combinations of feasible configurations, each with all collisions of all robots."""

    def __init__(self, *args):
        super().__init__(*args)
        self.known = {}

    def find(self, cells, torso=None, *, every=True, trying=lambda: None):
        if self._is_free(found := witnesses(self.arms, self.maps, cells)):
            return found
        combinations = product(*(self._feasible(k, cell) for k, cell in enumerate(cells)))
        return next((list(found) for found in combinations if self._is_free(found)), None)

    def excluding(self, cells, torso):
        return iter(())

    def _is_free(self, configurations):
        T = self.maps[0].T_world_object
        self.world.set_object(T)
        self.world.set_arms(configurations)
        margins = support_margins(self.world.scene, T, configurations)
        return min(margins.values(), default=0.0) >= 0 and not self.world.collisions(self.arms)

    def _feasible(self, k, cell):
        arm, m, settings = self.arms[k], self.maps[k], self.world.scene.settings
        if (k, cell) not in self.known:
            for robot in self.world.scene.robots:
                self.world.park(robot)
            self.world.set_object(m.T_world_object)
            ik = solver_for(arm, settings.samples)
            checker = CandidateChecker(
                self.world, arm, ik, settings.approach, holders=[a.name for a in self.arms]
            )
            tool = arm.hand.tool_poses(m.manifold, m.T_world_object)[cell]
            opening = float(m.opening[cell.row])
            found = checker.candidates(inverse(arm.robot.T_world_base) @ tool, opening)
            self.known[k, cell] = [
                ArmConfiguration(arm, c.q, opening) for c in found if c.reason == Reason.FEASIBLE
            ]
        return self.known[k, cell]


def crowded(name: str):
    """A shipped scene with its robots so close that they are in each other's way, and its task's maps."""
    content = yaml.safe_load((SCENES_DIR / f"{name}.yaml").read_text())
    for robot in content["robots"]:
        robot["base"]["position"][0] *= 0.4
    content["map"] = {"heights": 40, "angles": 8, "redundancy": 3}
    scene = Scene.from_content(content)
    with BulletWorld(scene) as world:
        maker, task = MapMaker(world), scene.task()
        return scene, [maker.map(arm, task) for arm in task.arms]


def test_the_same_placements_as_by_trying_all(monkeypatch):
    # Both begin with the witnesses themselves, however near a limit they stand.
    monkeypatch.setattr("symgrasp.planners.configurations.ease", lambda arm, q: np.ones(np.shape(q)[:-1]))
    scene, maps = crowded("log_four_robots")
    arms = [scene.arm(m.arm) for m in maps]
    gaps = PrintGaps(arms, scene.manifold)
    tried = []
    with BulletWorld(scene) as world:
        for seed in range(1, 5):
            windows = in_a_window(maps, seed)
            finders = ConfigurationFinder(world, arms, windows), Slow(world, arms, windows)
            searches = [
                FreePlacements(HoldingSearch([{m.arm: m for m in windows}], gaps), [finder])
                for finder in finders
            ]
            found, expected = (list(islice(placements, 3)) for placements in searches)
            assert in_numbers(found) == in_numbers(expected)
            tried.append([placements.tried for placements in searches])
    assert any(quick < slow for quick, slow in tried)  # pairs that never go together are left out
    assert max(slow for _, slow in tried) > 3


def in_a_window(maps, seed):
    """Return maps with a random share of their cells at heights close to each other."""
    rng = np.random.default_rng(seed)
    rows = np.arange(maps[0].manifold.heights)
    middle = rng.integers(17, 24)
    windows = []
    for m in maps:
        keep = rng.random(m.feasible.shape) < 0.3
        keep[:, np.abs(rows - middle) > 5] = False
        windows.append(m.masked(keep))
    return windows


def in_numbers(placements):
    """Return all that is decided of some placements."""
    return [
        (p.score, p.grasps, step.turn, [(c.arm.name, *c.q.tolist(), c.opening) for c in step.configurations])
        for p in placements
        for step in p.steps
    ]
