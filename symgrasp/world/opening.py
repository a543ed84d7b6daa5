"""The one place where a scene becomes a physics world."""

from __future__ import annotations

from symgrasp.progress import Progress
from symgrasp.scene.scene import Scene
from symgrasp.world.bullet import BulletWorld

__all__ = ["open_world"]


def open_world(scene: Scene, progress: Progress | None = None) -> BulletWorld:
    """Open a physics world with all bodies of a scene; use it in a ``with`` block, or `close` it.

    Args:
        scene: the scene.
        progress: called with 0 after every body and arm, and while pairs of links are sampled; may raise
            `Cancelled`.

    Returns:
        The world: robots at home, the object at the first task, the scene's margin to be kept.

    Raises:
        UrdfError, MeshError, SceneError: PyBullet cannot make a shape of the scene.
    """
    return BulletWorld(scene, progress)
