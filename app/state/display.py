"""What the page shows beside the map: switches that change nothing else."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Display"]


@dataclass(frozen=True)
class Display:
    """Switches of the page.

    Attributes:
        drag_handles: whether the handles that move the object are seen.
        symmetry_error: whether the object's surface shows the symmetry error of its mesh and not the map.
        flat_map: whether the unwrapped map is laid out in the 3D view as well.
        dark: whether the page is dark.
    """

    drag_handles: bool = False
    symmetry_error: bool = False
    flat_map: bool = True
    dark: bool = False
