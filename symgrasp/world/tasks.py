"""Checking a scene before maps are computed: the object must not be inside another body in any task."""

from __future__ import annotations

from dataclasses import replace

from symgrasp.errors import SceneError
from symgrasp.progress import Progress
from symgrasp.scene.parts import Task
from symgrasp.scene.scene import Scene
from symgrasp.world.bullet import BulletWorld
from symgrasp.world.collision import Collision
from symgrasp.world.home import free_homes, home_notes
from symgrasp.world.opening import open_world

__all__ = ["RESTING_DEPTH", "check_task", "check_tasks", "object_contact", "prepared"]

RESTING_DEPTH = 1e-3
"""How deep (m) the object may be inside another body and still count as resting on it."""


def prepared(scene: Scene, progress: Progress | None = None) -> Scene:
    """Return a scene of which maps can be computed: homes are found where none are given, and all is checked.

    Args:
        scene: the scene.
        progress: called with 0 while its world is opened and homes are tried; may raise `Cancelled`.

    Raises:
        SceneError: see `check_tasks` and `symgrasp.world.home.check_homes`.
        UrdfError, MeshError: PyBullet cannot make a shape of the scene.
    """
    with open_world(scene, progress) as world:
        found = free_homes(world, progress)
        if found is scene:
            return _checked(world)
    with open_world(found, progress) as world:
        return _checked(world)


def _checked(world: BulletWorld) -> Scene:
    _check_tasks(world)
    return replace(world.scene, notes=(*world.scene.notes, *home_notes(world)))


def check_tasks(scene: Scene) -> None:
    """Check that in every task the object is outside of obstacles and of robots that do not hold it.

    Resting contact is allowed, see `RESTING_DEPTH`.

    Raises:
        SceneError: it is inside one; the text names both bodies and the depth.
    """
    with open_world(scene) as world:
        _check_tasks(world)


def object_contact(world: BulletWorld, task: Task) -> Collision | None:
    """Return where the object is deepest inside an obstacle, or a robot that does not hold it, in a task.

    Contacts of at most `RESTING_DEPTH` do not count. The object stays at the pose of the task.
    """
    world.set_object(task.T_world_object)
    holders = [world.scene.arm(name).robot.name for name in task.arms]
    contacts = [*world.object_contacts(), *world.object_in_robots(holders)]
    deepest = max(contacts, key=lambda c: c.depth, default=None)
    return deepest if deepest and deepest.depth > RESTING_DEPTH else None


def check_task(world: BulletWorld, task: Task) -> None:
    """Check one task as `check_tasks` does all; the object stays at its pose.

    Raises:
        SceneError: see `check_tasks`.
    """
    if c := object_contact(world, task):
        raise SceneError(
            world.scene.source,
            f"tasks[{list(world.scene.tasks).index(task.name)}].pose",
            task.name,
            f"a pose outside of every other body; {c.a} is {1e3 * c.depth:.1f} mm inside {c.b}",
        )


def _check_tasks(world: BulletWorld) -> None:
    for task in world.scene.tasks.values():
        check_task(world, task)
    world.set_object(world.scene.task().T_world_object)
