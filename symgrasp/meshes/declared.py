"""What a mesh file says of itself."""

from __future__ import annotations

from typing import NamedTuple

from symgrasp.poses import Array

__all__ = ["BOM", "Declared"]

BOM = b"\xef\xbb\xbf"
"""Text files may begin with it."""


class Declared(NamedTuple):
    """What a mesh file says of itself.

    Attributes:
        content: the file, put in a form that the parser reads right.
        triangles: their number, with polygons of n corners as n − 2, and once for each time they are placed.
        instances: how many times a mesh is placed.
        unit: length (m) of one unit of the file.
        upright: (4, 4) turns coordinates of the file so that z is up.
    """

    content: bytes
    triangles: int
    instances: int = 1
    unit: float = 1.0
    upright: Array | None = None
