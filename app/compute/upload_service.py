"""Reads the files that a browser uploads, and mounts hands; runs in that session's process.

The server itself parses nothing that comes from a browser: a file that breaks a parser, hangs it or takes
all memory ends this process only.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from symgrasp.progress import Progress
from symgrasp.scene.scene import Scene
from symgrasp.world import prepared

from ..files.scene_files import read_scene
from ..scene3d.visual_meshes import check_visuals
from ..state.object_choice import ObjectChoice, from_mesh
from ..state.uploaded_scene import UploadedScene

__all__ = ["UploadService"]


class UploadService:
    """Reads scenes and meshes, and mounts hands.

    Args:
        folders: where the files of an uploaded scene may lie.
    """

    def __init__(self, folders: tuple[Path, ...]) -> None:
        self._folders = folders

    def read_scene(self, name: str, content: bytes, progress: Progress) -> UploadedScene:
        """Build the scene in a file, and check its tasks and everything that the 3D view shows.

        Raises:
            SceneError: see `app.files.scene_files.read_scene`; or the object collides in a task.
            UrdfError, ProfileError, MeshError: a file that it refers to is unusable.
        """
        progress(0.0)
        uploaded = read_scene(name, content, self._folders)
        progress(0.3)
        uploaded = replace(uploaded, scene=prepared(uploaded.scene))
        progress(0.6)
        check_visuals(uploaded.scene)
        return uploaded

    def measure(
        self, name: str, content: bytes, scale: float, tolerance: float | None, progress: Progress
    ) -> ObjectChoice:
        """Measure the object of revolution in a mesh file; see `app.state.object_choice.from_mesh`."""
        progress(0.0)
        return from_mesh(name, content, scale, tolerance)

    def mount(self, scene: Scene, arm: str, hand: str, progress: Progress) -> Scene:
        """Return a scene with another hand on an arm, of which the 3D view can show everything.

        Raises:
            SymgraspError: see `Scene.with_hand`.
            MeshError: a mesh of the hand cannot be read.
        """
        progress(0.0)
        scene = prepared(scene.with_hand(arm, hand))
        check_visuals(scene)
        return scene
