"""The map in 3D: one coloured quad for every cell or part of it, on the object's surface or in a plane."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import viser

from symgrasp.object.manifold import Manifold
from symgrasp.poses import Array, from_rotation, quat_wxyz

from ..render.palette import to_linear

__all__ = ["CellMesh", "OnCell", "flat_quads", "surface_quads"]

LIFT = 0.0004
"""Distance (m) of the quads from the object's surface, so that they hide it."""

OnCell = Callable[[int, int], None]
"""Called with the row and column of a cell."""

QUAD = np.array([[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]])
TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]])


def surface_quads(grid: Manifold) -> tuple[Array, Array]:
    """Return poses (H·A, 4, 4) in the object frame and sizes (H·A, 3), in m, of quads on its surface.

    A quad's x runs along the tangent, its y up the surface, its z outwards.
    """
    edges = grid.profile.h_min + np.arange(grid.heights + 1) * grid.dh
    r = grid.profile.radius(np.minimum(edges, grid.profile.h_max))
    dr, middle = np.diff(r), (r[:-1] + r[1:]) / 2
    slant = np.hypot(dr, grid.dh)
    i, j = np.indices((grid.heights, grid.angles)).reshape(2, -1)
    theta = grid.theta[j]
    radial = np.stack([np.cos(theta), np.sin(theta), np.zeros_like(theta)], axis=-1)
    tangent = np.stack([-np.sin(theta), np.cos(theta), np.zeros_like(theta)], axis=-1)
    up = ((dr / slant)[i, None] * radial) + (grid.dh / slant)[i, None] * np.array([0.0, 0.0, 1.0])
    outwards = np.cross(tangent, up)
    centres = middle[i, None] * radial + grid.h[i, None] * np.array([0.0, 0.0, 1.0]) + LIFT * outwards
    width = 2 * (middle + LIFT) * np.tan(grid.dtheta / 2)
    sizes = np.stack([width[i], slant[i], np.ones(len(i))], axis=-1)
    return from_rotation(np.stack([tangent, up, outwards], axis=-1), centres), sizes


def flat_quads(grid: Manifold, width: float, height: float) -> tuple[Array, Array]:
    """Return poses (H·A, 4, 4) and sizes (H·A, 3), in m, of quads in the xy plane.

    Args:
        grid: the grid; θ from -π runs along x, h along y, with the middle at the origin.
        width, height: of all quads together (m).
    """
    i, j = np.indices((grid.heights, grid.angles)).reshape(2, -1)
    x = ((j + 0.5) / grid.angles - 0.5) * width
    y = ((i + 0.5) / grid.heights - 0.5) * height
    centres = np.stack([x, y, np.zeros(len(i))], axis=-1)
    size = np.array([width / grid.angles, height / grid.heights, 1.0])
    return from_rotation(np.eye(3), centres), np.tile(size, (len(i), 1))


class CellMesh:
    """A batch of quads, one for each cell (i, j) of a map, that can be coloured and clicked.

    Where the cells are split, there is one for each part.

    Args:
        client: the browser.
        name: path of the node, to which a number is added.
        quads: returns the poses and sizes for a grid, as `surface_quads` does.
        grid: the cells.
        on_cell: called with (row, column) of the cell when a quad is clicked.

    Attributes:
        node: the quads; another one once they are others.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        name: str,
        quads: Callable[[Manifold], tuple[Array, Array]],
        grid: Manifold,
        on_cell: OnCell,
    ) -> None:
        self._client, self._name, self._quads, self._grid, self._on_cell = client, name, quads, grid, on_cell
        self._builds = 0
        self._shape = grid.heights, grid.angles
        self._shown: bytes = b""
        self.node = self._built()

    def _built(self) -> viser.BatchedMeshHandle:
        """Add the quads of the present grid; browsers keep the pose of a path, so each has its own."""
        heights, angles = self._shape
        poses, sizes = self._quads(replace(self._grid, heights=heights, angles=angles))
        self._builds += 1
        node = self._client.scene.add_batched_meshes_simple(
            f"{self._name}{self._builds}",
            vertices=QUAD,
            faces=TRIANGLES,
            batched_wxyzs=quat_wxyz(poses),
            batched_positions=poses[:, :3, 3],
            batched_scales=sizes.astype(np.float32),
            batched_colors=np.full((len(poses), 3), 200, dtype=np.uint8),
            lod="off",
            side="double",
            cast_shadow=False,
            receive_shadow=False,
        )

        @node.on_click
        def _(event: viser.SceneNodePointerEvent) -> None:
            if event.instance_index is not None:
                row, column = divmod(event.instance_index, angles)
                self._on_cell(row * self._grid.heights // heights, column * self._grid.angles // angles)

        return node

    def set_colors(self, colors: np.ndarray) -> None:
        """Set the colours (H, A, 3), sRGB, of the cells, or of whole numbers of parts of each."""
        if colors.shape[:2] != self._shape:
            self._shape, before = colors.shape[:2], self.node
            self.node, self._shown = self._built(), b""
            self.node.position, self.node.wxyz = before.position, before.wxyz
            before.remove()
        linear = to_linear(colors.reshape(-1, 3))
        if linear.tobytes() != self._shown:
            self._shown = linear.tobytes()
            self.node.batched_colors = linear
