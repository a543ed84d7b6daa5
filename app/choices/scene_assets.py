"""What goes with a scene that a session's process built: how its robots look, and the files it refers to."""

from __future__ import annotations

import weakref
from collections.abc import Iterable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path

from symgrasp.files import temporary_folder
from symgrasp.scene.content import file_references
from symgrasp.scene.scene import Scene

__all__ = ["NO_ASSETS", "BuiltScene", "SceneAssets", "UploadFolder", "Visuals"]

Visuals = Mapping[bytes, Mapping[str, bytes]]
"""URDF of a robot → link → GLB; see `app.scene3d.visual_meshes.link_visuals`."""


class UploadFolder:
    """The folder of an uploaded archive; it is removed once no state refers to this any more.

    Attributes:
        path: of the folder.
    """

    def __init__(self) -> None:
        stack = ExitStack()
        self.path: Path = stack.enter_context(temporary_folder())
        weakref.finalize(self, stack.close)


@dataclass(frozen=True, eq=False)
class BuiltScene:
    """A scene from the process, which alone reads files that were uploaded.

    Attributes:
        scene: the scene.
        visuals: of its robots and obstacles.
    """

    scene: Scene
    visuals: Visuals


@dataclass(frozen=True, eq=False)
class SceneAssets:
    """What belongs to a scene besides its content.

    Attributes:
        visuals: of its robots; those that are missing may be read by the server itself.
        folders: those that the scene refers to files in.
    """

    visuals: Visuals = field(default_factory=dict)
    folders: tuple[UploadFolder, ...] = ()

    def of(self, built: BuiltScene, folders: Iterable[UploadFolder] = ()) -> SceneAssets:
        """Return the assets of a scene that was built from the one of these; what is in both is shared.

        Args:
            built: the scene.
            folders: further ones that it may refer to.
        """
        visuals = {urdf: self.visuals.get(urdf, links) for urdf, links in built.visuals.items()}
        used = [holder[key] for _, holder, key in file_references(built.scene.content)]
        kept = [
            folder
            for folder in dict.fromkeys((*self.folders, *folders))
            if any(path.startswith(f"{folder.path.resolve()}/") for path in used)
        ]
        return replace(self, visuals=visuals, folders=tuple(kept))


NO_ASSETS = SceneAssets()
"""Those of a scene that the server reads itself."""
