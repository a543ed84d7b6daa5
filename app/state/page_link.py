"""The link that was made last, and where the camera stood."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Camera", "MadeLink"]


Camera = tuple[float, ...]
"""Where the camera stands and the point it looks at (m): six numbers."""


@dataclass(frozen=True)
class MadeLink:
    """A link that was made.

    Attributes:
        address: the whole address.
        told: what was shown then; nothing once it was looked at from elsewhere.
        camera: where it was looked at from.
    """

    address: str
    told: tuple[object, ...]
    camera: Camera
