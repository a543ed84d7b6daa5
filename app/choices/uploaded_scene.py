"""An uploaded scene."""

from __future__ import annotations

from dataclasses import dataclass, replace

from symgrasp.scene.scene import Scene

from .scene_assets import NO_ASSETS, SceneAssets, UploadFolder

__all__ = ["UploadedScene"]


@dataclass(frozen=True, eq=False)
class UploadedScene:
    """An uploaded scene and its option in the menu.

    Attributes:
        option: its name in the menu of the page.
        scene: the scene.
        assets: what belongs to it.
    """

    option: str
    scene: Scene
    assets: SceneAssets = NO_ASSETS

    def with_folder(self, folder: UploadFolder) -> UploadedScene:
        """Return the scene that was read from an archive, which was unpacked into this folder."""
        return replace(self, assets=replace(self.assets, folders=(folder,)))
