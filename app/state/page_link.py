"""The link that was made last, and where the camera stood."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Camera", "PageLink"]


Camera = tuple[float, ...]
"""Where the camera stands and the point it looks at (m): six numbers."""


@dataclass(frozen=True)
class PageLink:
    """A link to the page as it was.

    Attributes:
        address: the whole address.
        values: what it contains, but for the camera; nothing once it was looked at from elsewhere.
        camera: the camera it contains.
    """

    address: str
    values: tuple[object, ...]
    camera: Camera
