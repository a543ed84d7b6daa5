"""Random free motions to find: between boxes around an arm, and between compartments of a shelf."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import islice, pairwise, product
from typing import Any

import numpy as np

from symgrasp.errors import SceneError
from symgrasp.motion.bodies.motion_scene import MotionScene
from symgrasp.motion.bodies.situation import Situation
from symgrasp.motion.paths.search import FoundPath, NoMotionError, find, prove, shortened
from symgrasp.motion.times.reach import joint_reach
from symgrasp.poses import Array
from symgrasp.robot.robot import Arm
from symgrasp.scene.scene import Scene
from symgrasp.world import BulletWorld, check_homes, open_world

__all__ = ["PROBLEMS", "Problem", "between_boxes", "between_compartments", "touches"]

BOXES = 8
"""Random boxes around the arm."""

EACH_SCENE = 10
"""Problems with the same obstacles, at most."""

DRAWN = 300_000
"""Random configurations of which those with the tool in a compartment are few."""

THICK, DEEP, INTO = 0.02, 0.35, 0.1
"""Thickness (m) of a shelf's boards, its depth, and how far the tool reaches into a compartment at least."""

LOOK = 0.05
"""Distances up to it (m) are asked of PyBullet."""

BODY_STEP = 5e-4
"""Distance (m) that nothing moves further between two states which PyBullet looks at."""

INSIDE = 1e-5
"""How deep (m) bodies may be in each other for PyBullet, which reads URDFs in single precision."""


@dataclass(frozen=True, eq=False)
class Problem:
    """A free motion to find.

    Attributes:
        world: the bodies.
        situation: what moves and stands.
        limits: (2, n) of the joints.
        start: (n,) joint values.
        goal: (n,) joint values.
        number: seed of the random numbers.
    """

    world: BulletWorld
    situation: Situation
    limits: Array
    start: Array
    goal: Array
    number: int

    def solve(self) -> Array | None:
        """Return a path (m, n), as this project finds it, None if it finds none."""
        found = self.search()
        return None if found is None else shortened(found)

    def search(self) -> FoundPath | None:
        """Return a path before it is shortened, None if none is found."""
        try:
            return find(self.situation, self.start[None], self.goal[None], self.number)
        except NoMotionError:
            return None

    def free(self, q: Array) -> bool:
        """Whether the arm is free at joint values (n,), by the checks of this project."""
        return bool(prove(self.situation, q[None], q[None]).free[0])

    def free_in_bullet(self, q: Array) -> bool:
        """Whether the arm is free at joint values (n,), by PyBullet."""
        arm = self.world.scene.arm()
        self.world.set_robot(arm.robot.name, arm.robot_values(q))
        return self.world.first_collision(arm) is None


def between_boxes(seed: int = 0) -> Iterator[Problem]:
    """Yield problems between random boxes, of which no straight line is free.

    The world of a problem is closed when the next boxes are drawn.
    """
    rng = np.random.default_rng(seed)

    def pairs(situation: Situation, arm: Arm) -> tuple[Array, Array]:
        q = rng.uniform(arm.lower, arm.upper, (400, arm.dof))
        free = q[prove(situation, q, q).free]
        return free[: 2 * (len(free) // 2) : 2], free[1::2]

    while True:
        yield from _in_scene([_box(rng, k) for k in range(BOXES)], pairs)


def between_compartments(seed: int = 0) -> Iterator[Problem]:
    """Yield problems of an arm that is to leave a compartment of a random shelf for another one.

    The world of a problem is closed when the next shelf is drawn.
    """
    rng = np.random.default_rng(seed)
    while True:
        width, height = rng.uniform(0.3, 0.4), rng.uniform(0.28, 0.36)
        away, low, yaw = rng.uniform(0.4, 0.55), rng.uniform(0.1, 0.3), rng.uniform(-np.pi, np.pi)
        turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])

        def board(name: str, centre: list[float], size: list[float], turn=turn, yaw=yaw) -> dict[str, Any]:
            place = {"position": (turn @ centre).tolist(), "rpy_deg": [0.0, 0.0, float(np.rad2deg(yaw))]}
            return {"name": name, "box": size, "pose": place}

        middle, up = away + DEEP / 2, low + height
        boards = [board("back", [away + DEEP, 0.0, up], [THICK, 2 * width, 2 * height])]
        for k in (-1, 0, 1):
            boards.append(board(f"wall {k + 2}", [middle, k * width, up], [DEEP, THICK, 2 * height]))
            boards.append(board(f"floor {k + 2}", [middle, 0.0, up + k * height], [DEEP, 2 * width, THICK]))

        def pairs(
            situation: Situation, arm: Arm, turn=turn, away=away, up=up, width=width, height=height
        ) -> tuple[Array, Array]:
            q = rng.uniform(arm.lower, arm.upper, (DRAWN, arm.dof))
            tool = (arm.robot.T_world_base @ arm.tool_pose(q))[:, :3, 3] @ turn  # in the shelf's own frame
            depth, side, rise = tool[:, 0] - away, tool[:, 1], tool[:, 2] - up
            inside = (depth > INTO) & (depth < DEEP) & (np.abs(side) < width) & (np.abs(rise) < height)
            q, which = q[inside], 2 * (side[inside] > 0) + (rise[inside] > 0)
            free = prove(situation, q, q).free
            q, which = q[free], which[free]
            chosen = [(a, b) for a, b in product(range(len(q)), repeat=2) if which[a] != which[b]]
            ends = rng.permutation(np.array(chosen, dtype=int).reshape(-1, 2))[:EACH_SCENE]
            return q[ends[:, 0]], q[ends[:, 1]]

        yield from _in_scene(boards, pairs)


PROBLEMS: Mapping[str, Callable[[int], Iterator[Problem]]] = {
    "between random boxes": between_boxes,
    "between compartments of a shelf": between_compartments,
}
"""What free motions are measured on."""


def _in_scene(
    obstacles: list[dict[str, Any]], pairs: Callable[[Situation, Arm], tuple[Array, Array]]
) -> Iterator[Problem]:
    """Yield the problems of an arm among obstacles, unless one is where the arm stands.

    Args:
        obstacles: as scenes have them.
        pairs: returns starts (m, n) and goals (m, n), all of them free.
    """
    content = Scene.load("pick_pour_place").content
    tasks = [{**content["tasks"][0], "supported": False}]
    scene = Scene.from_content({**content, "obstacles": obstacles, "tasks": tasks})
    try:
        check_homes(scene)
    except SceneError:
        return
    with open_world(scene) as world:
        bodies, arm = MotionScene(scene, world), scene.arm()
        situation = bodies.situation(bodies.home(), [arm])
        limits = np.stack([arm.lower, arm.upper])
        starts, goals = pairs(situation, arm)
        wanted = ~prove(situation, starts, goals).free
        ends = zip(starts[wanted], goals[wanted], strict=True)
        for number, (start, goal) in enumerate(islice(ends, EACH_SCENE)):
            yield Problem(world, situation, limits, start, goal, number)


def touches(problem: Problem, path: Array) -> bool:
    """Whether PyBullet finds the arm inside of something along a path (m, n).

    Nothing moves further between two states than `BODY_STEP`, or than it is away from everything else.
    """
    world, arm = problem.world, problem.world.scene.arm()
    reach = joint_reach(arm.robot.model)[arm.indices]
    for a, b in pairwise(path):
        moved, at = float(np.abs(b - a) @ reach), 0.0
        while True:
            share = min(at / moved, 1.0) if moved else 1.0
            world.set_robot(arm.robot.name, arm.robot_values(a + share * (b - a)))
            gap = world.clearance(arm, LOOK)
            if gap < -INSIDE:
                return True
            if share == 1.0:
                break
            at += max(BODY_STEP, gap)
    return False


def _box(rng: np.random.Generator, number: int) -> dict[str, Any]:
    """Return a random box around an arm at the origin, as scenes have it."""
    angle, distance = rng.uniform(-np.pi, np.pi), rng.uniform(0.35, 0.8)
    position = [distance * np.cos(angle), distance * np.sin(angle), rng.uniform(0.0, 0.9)]
    turn = [float(part) for part in rng.uniform(-180, 180, 3)]
    size = [float(part) for part in rng.uniform(0.05, 0.3, 3)]
    place = {"position": [float(part) for part in position], "rpy_deg": turn}
    return {"name": f"box {number}", "box": size, "pose": place}
