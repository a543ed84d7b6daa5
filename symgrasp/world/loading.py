"""Loading a scene for scripts and notebooks, with a free home where it gives none."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from symgrasp.scene import scene as scenes
from symgrasp.scene.scene import Scene
from symgrasp.world.home import with_free_homes

__all__ = ["load_scene"]


def load_scene(scene: str | Path | Mapping[str, Any]) -> Scene:
    """Load a scene; where it gives no home for a robot that would collide, a free one is found.

    Args:
        scene: the name of a shipped scene, the path of a .yaml file, or the content of such a file; files
            that a content refers to are found from the current folder.

    Returns:
        The scene; `Scene.notes` says what was found.

    Raises:
        SceneError: no such scene, not YAML, or a field is wrong.
        UrdfError, MeshError, ProfileError: a file that the scene refers to is unusable.
    """
    return with_free_homes(scenes.load_scene(scene))
