"""A scene that a person uploaded."""

from __future__ import annotations

from dataclasses import dataclass

from symgrasp.scene.scene import Scene

__all__ = ["UploadedScene"]


@dataclass(frozen=True, eq=False)
class UploadedScene:
    """A scene that was uploaded.

    Attributes:
        option: its name in the menu of the page.
        scene: the scene.
    """

    option: str
    scene: Scene
