"""Checking the tasks of a scene: the object must not be inside another body."""

from __future__ import annotations

from symgrasp.errors import SceneError
from symgrasp.scene.scene import Scene
from symgrasp.world.opening import open_world

__all__ = ["RESTING_DEPTH", "check_tasks"]

RESTING_DEPTH = 1e-3
"""How deep (m) the object may be inside another body and still count as resting on it."""


def check_tasks(scene: Scene) -> None:
    """Check that in every task the object is outside of obstacles and of robots that do not hold it.

    Resting contact is allowed, see `RESTING_DEPTH`.

    Raises:
        SceneError: it is inside one; the text names both bodies and the depth.
    """
    with open_world(scene) as world:
        for i, task in enumerate(scene.tasks.values()):
            world.set_object(task.T_world_object)
            holders = [scene.arm(name).robot.name for name in task.arms]
            contacts = [*world.object_contacts(), *world.object_in_robots(holders)]
            for c in sorted(contacts, key=lambda c: -c.depth)[:1]:
                if c.depth > RESTING_DEPTH:
                    raise SceneError(
                        scene.source,
                        f"tasks[{i}].pose",
                        task.name,
                        f"a pose outside of every other body; {c.a} is {1e3 * c.depth:.1f} mm inside {c.b}",
                    )
