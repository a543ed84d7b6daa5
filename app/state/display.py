"""Display options of the page."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Display"]


@dataclass(frozen=True)
class Display:
    """Display options of the page, each on or off.

    Attributes:
        drag_handles: whether the gizmo that moves the object is visible.
        base_handles: whether the gizmo that moves the robot is visible.
        symmetry_error: whether the object's surface shows the symmetry error of its mesh instead of the map.
        flat_map: whether the flat map is visible in the 3D view.
        dark: whether the page has its dark theme.
    """

    drag_handles: bool = False
    base_handles: bool = False
    symmetry_error: bool = False
    flat_map: bool = True
    dark: bool = False
