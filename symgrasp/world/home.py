"""Where robots are parked: checking that they are free there, and finding a free place where none is given.

A pair of bodies that collides while a robot is at home collides in every cell of the map of an arm that does
not move them against each other. A scene gives values of some joints, or of none. Where a robot collides,
the others are set as a state of the SRDF has them; else they are moved as far as need be: hands that no arm
uses are opened, then joints that collide go to the middle of their ranges, then to random values, with a
fixed seed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from symgrasp.errors import SceneError
from symgrasp.poses import Array
from symgrasp.progress import Progress
from symgrasp.reason import Reason
from symgrasp.robot.arm_joints import BRANCH, joints_outwards
from symgrasp.robot.robot import Arm, Robot
from symgrasp.scene.scene import Scene
from symgrasp.world.bullet import BulletWorld
from symgrasp.world.collision import Collision
from symgrasp.world.hand_pairs import always_in_hands
from symgrasp.world.opening import open_world

__all__ = ["check_homes", "free_homes", "home_notes", "with_free_homes"]

MOST_MOVES = 1000
"""Most random moves that are tried for a robot."""

LIMIT_SLACK = 1e-3
"""By how much (rad or m) a value of an SRDF may be outside of a joint's limits, which are rounded too."""

DECIMALS = 4
"""Of the values (rad or m) of a home that is found, which a scene states."""


def with_free_homes(scene: Scene, progress: Progress | None = None) -> Scene:
    """Return a scene in which no robot collides at home, as far as its file leaves that open.

    The file of the returned scene states the values that were found, and its notes say so. A robot whose
    values are given, or for which none were found, stays as it is: see `check_homes`.

    Args:
        scene: the scene.
        progress: called with 0 while its world is opened and homes are tried; may raise `Cancelled`.

    Raises:
        UrdfError, MeshError, SceneError: PyBullet cannot make a shape of the scene.
    """
    if not any(_open_joints(scene, robot) for robot in scene.robots.values()):
        return scene
    with open_world(scene, progress) as world:
        return free_homes(world, progress)


def free_homes(world: BulletWorld, progress: Progress | None = None) -> Scene:
    """Return what `with_free_homes` does for the scene of a world: the same one if it has free homes.

    Where others were found, the world has the robots there.

    Args:
        world: the world.
        progress: called with 0 before every try; may raise `Cancelled`.
    """
    scene, found = world.scene, dict[str, _Home]()
    for entry in scene.file.robots:
        robot = scene.robots[entry.name]
        home = _Search(world, robot, progress).run() if _open_joints(scene, robot) else None
        if home:
            found[entry.name] = home
            world.set_robot(entry.name, home.values)
    if not found:
        return scene
    content = scene.file.model_dump(mode="json", exclude_none=True)
    notes = []
    for robot in content["robots"]:
        if home := found.get(robot["name"]):
            changed = _differences(scene.robots[robot["name"]], home.values)
            robot["home"] = _given(scene, robot["name"]) | changed
            values = ", ".join(f"{name}: {value:g}" for name, value in changed.items())
            notes.append(f"{robot['name']}: home: {{{values}}}, {home.origin}")
    return replace(Scene.from_content(content, scene.source), notes=(*scene.notes, *notes))


def check_homes(scene: Scene, progress: Progress | None = None) -> tuple[str, ...]:
    """Check that no arm of a scene is barred from every grasp by what collides at home.

    Args:
        scene: the scene.
        progress: called with 0 while its world is opened; may raise `Cancelled`.

    Returns:
        In words, the collisions at home that bar no arm, because each moves away from them, and the links of
        hands that may touch, because they overlap at every opening.

    Raises:
        SceneError: a pair of bodies collides whatever an arm does; the text names both, and what helps.
        UrdfError, MeshError: PyBullet cannot make a shape of the scene.
    """
    with open_world(scene, progress) as world:
        return home_notes(world)


def home_notes(world: BulletWorld) -> tuple[str, ...]:
    """Check and return what `check_homes` does, in a world with robots at home."""
    scene, notes = world.scene, list[str]()
    for i, robot in enumerate(scene.robots.values()):
        arms = [arm for arm in scene.arms.values() if arm.robot is robot]
        for (a, b), hand in always_in_hands(scene, robot.name):
            text = f"{a} and {b} overlap at every opening of hand {hand}, and may touch"
            notes.append(f"{robot.name}: {text}")
        for c in _at_home(world.arm_collisions(arms[0])):
            text = f"{c.a} and {c.b} are too close by {1e3 * c.depth:.1f} mm"
            for arm in arms:
                if not _moves_apart(arm, c):
                    expected = f"values at which {arm.name} is not barred from every grasp"
                    if c.reason == Reason.SELF_COLLISION:
                        expected += "; where it is no collision, disable_collisions in the SRDF"
                    raise SceneError(scene.source, f"robots[{i}].home", text, expected)
            notes.append(f"{robot.name}: at home, {text}")
    return tuple(notes)


class _Home(NamedTuple):
    """A home that was found, and where it comes from, in words."""

    values: Array
    origin: str


class _Search:
    """Looks for values of a robot's open joints at which it is free.

    Joints of the scene's arms are moved rather than others, and then what hangs higher: the legs last.

    Args:
        world: the world, with all other robots where they are parked.
        robot: the robot.
        progress: called with 0 before every try; may raise `Cancelled`.
    """

    def __init__(self, world: BulletWorld, robot: Robot, progress: Progress | None) -> None:
        self._world, self._robot, self._progress = world, robot, progress
        scene, model = world.scene, robot.model
        arms = [arm for arm in scene.arms.values() if arm.robot is robot]
        self._arm = arms[0]
        self._open = set(_open_joints(scene, robot))
        self._in_arms = {k for arm in arms for k in arm.indices.tolist()} & self._open
        self._lower = np.where(np.isfinite(model.lower), model.lower, -np.pi)
        self._upper = np.where(np.isfinite(model.upper), model.upper, np.pi)
        outwards = joints_outwards(model)
        self._fingers = {
            joint.source for joint in model.joints if joint.source >= 0 and outwards[joint.child] < BRANCH - 1
        } - {k for arm in arms for k in arm.indices.tolist()}
        self._lowest = (robot.T_world_base @ model.forward(robot.home))[:, 2, 3]  # of what hangs on a link
        for joint in reversed(model.joints):  # children before their parents
            self._lowest[joint.parent] = min(self._lowest[joint.parent], self._lowest[joint.child])

    def run(self) -> _Home | None:
        """Return a free home that differs from the robot's own; None if that is free, or none was found."""
        home = self._robot.home
        if not self._pairs(home):
            return None
        for values, origin in (
            *self._states(home),
            (self._opened(home), "with hands opened"),
            (self._middle(home), "joints that collided at the middle of their ranges"),
        ):
            if not self._pairs(values):
                return _Home(values, origin)
        values = self._sampled(self._opened(home))
        return None if values is None else _Home(values, "joints that collided moved at random")

    def _states(self, home: Array) -> list[tuple[Array, str]]:
        """Return the home with the open joints as in each state of the SRDF that is within their limits."""
        model, found = self._robot.model, []
        for name, state in model.srdf.states.items() if model.srdf else ():
            values = home.copy()
            for k in self._open:
                values[k] = np.round(state.get(model.joint_names[k], home[k]), DECIMALS)
            inside = np.all((values >= model.lower - LIMIT_SLACK) & (values <= model.upper + LIMIT_SLACK))
            if inside:
                found.append((np.clip(values, model.lower, model.upper), f"state {name!r} of the SRDF"))
        return found

    def _opened(self, values: Array) -> Array:
        """Return values with fingers that collide at the better end of their range, where that helps."""
        for pair in self._pairs(values):
            fingers = sorted(self._joints_between(pair) & self._fingers)
            for end in (self._upper, self._lower):
                moved = self._set(values, fingers, end)
                if fingers and _total(self._pairs(moved)) < _total(self._pairs(values)):
                    values = moved
        return values

    def _middle(self, values: Array) -> Array:
        """Return values with the joints that collide at the middle of their ranges."""
        for _ in range(len(self._open)):
            joints = {k for pair in self._pairs(values) for k in self._joints_between(pair)}
            moved = self._set(values, sorted(joints), 0.5 * (self._lower + self._upper))
            if np.array_equal(moved, values):
                break
            values = moved
        return values

    def _sampled(self, values: Array) -> Array | None:
        """Return free values, reached by random moves that each bring fewer or less deep collisions."""
        rng, pairs = np.random.default_rng(0), self._pairs(values)
        for k in range(MOST_MOVES):
            if not pairs:
                return values
            every = k > MOST_MOVES // 2
            movable = [found for pair in pairs if (found := self._joints_between(pair, every))]
            if not movable:
                return None
            joints = sorted(movable[rng.integers(len(movable))])
            some = rng.permutation(joints)[: rng.integers(1, len(joints) + 1)]
            moved = self._set(values, some, rng.uniform(self._lower, self._upper))
            left = self._pairs(moved)
            if _total(left) < _total(pairs):
                values, pairs = moved, left
        return None

    def _set(self, values: Array, joints: ArrayLike, to: Array) -> Array:
        """Return values (n,) in which some joints have those of ``to`` (n,), as a file states them."""
        moved, joints = values.copy(), np.asarray(joints, dtype=int)
        moved[joints] = np.round(to[joints], DECIMALS)
        return np.clip(moved, self._robot.model.lower, self._robot.model.upper)

    def _pairs(self, values: Array) -> list[Collision]:
        """Return the pairs that collide at joint values, with the object in any task."""
        if self._progress:
            self._progress(0.0)
        world, scene = self._world, self._world.scene
        world.set_robot(self._robot.name, values)
        pairs = world.arm_collisions(self._arm)
        for task in list(scene.tasks.values())[1:]:
            world.set_object(task.T_world_object)
            pairs += world.arm_collisions(self._arm, {scene.file.object.name})
        world.set_object(scene.task().T_world_object)
        return pairs

    def _joints_between(self, pair: Collision, every: bool = False) -> set[int]:
        """Return the open joints that are moved to part two bodies, or every one that parts them."""
        sides = [side & self._open for side in _sides(self._robot, pair)]
        if every or any(side & self._in_arms for side in sides):
            joints = set().union(*sides)
            return joints if every else joints & self._in_arms
        sides = [side for side in sides if side]
        return max(sides, key=self._height, default=set())

    def _height(self, joints: set[int]) -> float:
        """Return the lowest height (m) of the links that hang on some joints."""
        return min(float(self._lowest[j.child]) for j in self._robot.model.joints if j.source in joints)


def _open_joints(scene: Scene, robot: Robot) -> list[int]:
    """Return the indices of the joints for which the file gives no value, listed hands left out."""
    hands = {name for arm in scene.arms.values() if arm.robot is robot for name in arm.hand.joints}
    fixed = {*hands, *_given(scene, robot.name)}
    return [k for k, name in enumerate(robot.model.joint_names) if name not in fixed]


def _given(scene: Scene, robot: str) -> dict[str, float]:
    """Return the joints of a robot for which the file gives a value at home, and the values."""
    home = next(entry.home for entry in scene.file.robots if entry.name == robot)
    if home is None or isinstance(home, dict):
        return dict(home or {})
    names = [n for arm in scene.arms.values() if arm.robot.name == robot for n in arm.joint_names]
    return dict(zip(names, home, strict=True))


def _differences(robot: Robot, values: Array) -> dict[str, float]:
    """Return the joints whose values differ from the robot's home, and the values."""
    changed = np.flatnonzero(values != robot.home)
    return {robot.model.joint_names[k]: float(values[k]) for k in changed}


def _sides(robot: Robot, pair: Collision) -> list[set[int]]:
    """Return the indices of the joints that move one body of a pair and not the other, for each of them."""
    links = [pair.a.link, pair.b.link] if pair.reason == Reason.SELF_COLLISION else [pair.a.link]
    chains = [{joint.name: joint.source for joint in robot.model.chain(link)} for link in links]
    shared = set(chains[0]).intersection(*chains[1:]) if len(chains) > 1 else set()
    return [
        {source for name, source in chain.items() if source >= 0 and name not in shared} for chain in chains
    ]


def _moves_apart(arm: Arm, pair: Collision) -> bool:
    """Whether an arm moves the bodies of a pair against each other."""
    return not set().union(*_sides(arm.robot, pair)).isdisjoint(arm.indices.tolist())


def _at_home(collisions: Sequence[Collision]) -> list[Collision]:
    """Return those that do not depend on a task."""
    return [c for c in collisions if c.reason != Reason.OBJECT_COLLISION]


def _total(pairs: Sequence[Collision]) -> float:
    return sum(pair.depth for pair in pairs)
