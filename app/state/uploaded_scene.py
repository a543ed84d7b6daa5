"""A scene that a person uploaded."""

from __future__ import annotations

from dataclasses import dataclass

from symgrasp.scene.scene import Scene

__all__ = ["UploadedScene"]


@dataclass(frozen=True, eq=False)
class UploadedScene:
    """A scene that was uploaded.

    Attributes:
        choice: what the page offers it as.
        scene: the scene.
    """

    choice: str
    scene: Scene
