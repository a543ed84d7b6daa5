"""Reading triangle meshes from files, and asking whether a point lies inside one."""

from symgrasp.meshes.inside import depth_inside
from symgrasp.meshes.reading import (
    MESH_ENDINGS,
    check_size,
    joined,
    read_groups,
    read_mesh,
    read_parts,
    read_up,
)

__all__ = [
    "MESH_ENDINGS",
    "check_size",
    "depth_inside",
    "joined",
    "read_groups",
    "read_mesh",
    "read_parts",
    "read_up",
]
