"""The unwrapped map as a flat rectangle in the 3D view; a click on a cell picks it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
import viser

from ..render.cell_colors import cell_colors
from ..state.state import State
from .cell_mesh import CellMesh, OnCell, flat_quads
from .nodes import set_pose
from .viewpoint import FLAT_SIZE, Box, Viewpoint, flat_map_box, flat_map_pose, flat_map_position

__all__ = ["FlatMap"]

MIN_FACING = float(np.cos(np.deg2rad(65)))
"""Cosine of the angle between its front and the camera beyond which the flat map turns to the camera."""


class FlatMap:
    """The unwrapped map, upright beside or above the object.

    Args:
        client: the browser.
        root: path of its node.
        state: the state to place it for.
        view: the viewpoint to face at first.
        on_cell: called with the cell that was clicked.
    """

    def __init__(
        self, client: viser.ClientHandle, root: str, state: State, view: Viewpoint, on_cell: OnCell
    ) -> None:
        add, grid = client.scene, state.scene.manifold
        width, height = FLAT_SIZE
        self.frame = add.add_frame(root, show_axes=False)
        self._position = flat_map_position(state.scene, state.T_world_object, view)
        self._turn(view)
        add.add_box(
            f"{root}/back", dimensions=(width + 0.012, height + 0.012, 0.004), position=(0, 0, -0.004),
            color=(255, 255, 255), cast_shadow=False, receive_shadow=False,
        )  # fmt: skip
        self.title = add.add_label(
            f"{root}/title", "unrolled map", position=(0, height / 2 + 0.02, 0),
            anchor="bottom-center", font_screen_scale=0.8,
        )  # fmt: skip
        quads = partial(flat_quads, width=width, height=height)
        self.cells = CellMesh(client, f"{root}/cells", quads, grid, on_cell)

    def face(self, camera: Sequence[float]) -> None:
        """Turn to a camera that sees it from behind or at a flat angle.

        Args:
            camera: see `Camera`.
        """
        if (view := self._faced(camera)) is not self._view:
            self._turn(view)

    def box(self, camera: Sequence[float]) -> Box:
        """Return the box that it fills once a camera is there; see `face`."""
        return flat_map_box(self._position, self._faced(camera))

    def _faced(self, camera: Sequence[float]) -> Viewpoint:
        seen = self._view.seen_from((*camera[:3], *self._position))
        return seen if seen.direction @ self._view.direction < MIN_FACING else self._view

    def _turn(self, view: Viewpoint) -> None:
        self._view = view
        set_pose(self.frame, flat_map_pose(self._position, view))

    def show(self, state: State) -> None:
        """Update it to a state."""
        self.frame.visible = state.display.flat_map
        if state.map:
            self.cells.set_colors(cell_colors(state, state.map))
            # A shift by whole cells is in the colours; the rest is in where the grid starts.
            rest = (state.map.manifold.theta_start + np.pi) / (2 * np.pi)
            self.cells.node.position = (rest * FLAT_SIZE[0], 0.0, 0.0)
