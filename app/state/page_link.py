"""The link to the page that was made last."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Camera", "PageLink"]


Camera = tuple[float, ...]
"""Position of the camera and the point it looks at: six numbers (m)."""


@dataclass(frozen=True)
class PageLink:
    """A link that opens the page as it was.

    Attributes:
        address: the whole address.
        values: `State.link_values` when it was made; empty once the camera has moved.
        camera: the camera it contains.
    """

    address: str
    values: tuple[object, ...]
    camera: Camera
