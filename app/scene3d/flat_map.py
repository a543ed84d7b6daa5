"""The unwrapped map as a flat rectangle in the 3D view; a click on a cell picks it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import viser

from symgrasp.poses import Array, from_rotation

from ..render.cell_colors import cell_colors
from ..state.state import State
from .cell_mesh import CellMesh, OnCell, flat_quads
from .nodes import set_pose
from .viewpoint import Box, Viewpoint, stand_around

__all__ = ["FLAT_SIZE", "FlatMap", "close_up", "flat_map_position"]


FLAT_SIZE = (0.33, 0.22)
"""Width and height (m) of the flat map."""


MIN_FACING = float(np.cos(np.deg2rad(65)))
"""Cosine of the angle between its front and the camera beyond which the flat map turns to the camera."""

CLOSE_WIDTH = 0.5
"""Least width (m) of a view that is close to the object."""

ABOVE = 0.12
"""How far (m) the middle of such a view is above that of the object: hands and arms come from above."""

TOWARDS_MAP = 0.45
"""Share of the way from the object to the flat map at which the middle of such a view is."""


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
        self._position = flat_map_position(state, view)
        self._turn(view)
        add.add_box(
            f"{root}/back", dimensions=(width + 0.012, height + 0.012, 0.004), position=(0, 0, -0.004),
            color=(255, 255, 255), cast_shadow=False, receive_shadow=False,
        )  # fmt: skip
        self.title = add.add_label(
            f"{root}/title", "unrolled map: click a cell", position=(0, height / 2 + 0.02, 0),
            anchor="bottom-center", font_screen_scale=0.8,
        )  # fmt: skip
        self.cells = CellMesh(client, f"{root}/cells", *flat_quads(grid, width, height), grid.angles, on_cell)

    def face(self, camera: Sequence[float]) -> None:
        """Turn to a camera that sees it from behind or at a flat angle.

        Args:
            camera: see `Camera`.
        """
        if (view := self._faced(camera)) is not self._view:
            self._turn(view)

    def box(self, camera: Sequence[float]) -> Box:
        """Return the box that it fills once a camera is there; see `face`."""
        width, height = FLAT_SIZE
        return np.array([width, height, 0.01]) / 2, self._pose(self._faced(camera))

    def _faced(self, camera: Sequence[float]) -> Viewpoint:
        seen = self._view.seen_from((*camera[:3], *self._position))
        return seen if seen.direction @ self._view.direction < MIN_FACING else self._view

    def _turn(self, view: Viewpoint) -> None:
        self._view = view
        set_pose(self.frame, self._pose(view))

    def _pose(self, view: Viewpoint) -> Array:
        axes = np.stack([view.right, [0.0, 0.0, 1.0], view.direction], axis=-1)
        return from_rotation(axes, self._position)

    def show(self, state: State) -> None:
        """Update it to a state."""
        self.frame.visible = state.display.flat_map
        if state.map:
            self.cells.set_colors(cell_colors(state, state.map))
            # A shift by whole cells is in the colours; the rest is in where the grid starts.
            rest = (state.map.manifold.theta_start + np.pi) / (2 * np.pi)
            self.cells.node.position = (rest * FLAT_SIZE[0], 0.0, 0.0)


def flat_map_position(state: State, view: Viewpoint) -> Array:
    """Return the centre (3,) of the flat map: beside the object away from the robots, or above it."""
    profile, pose = state.scene.profile, state.T_world_object
    centre = (pose @ [0.0, 0.0, (profile.h_min + profile.h_max) / 2, 1.0])[:3]
    if stand_around(state.scene, pose):
        return centre + np.array([0.0, 0.0, 0.55])
    bases = np.array([robot.T_world_base[:3, 3] for robot in state.scene.robots.values()])
    away = 1.0 if (centre - bases.mean(axis=0)) @ view.right >= 0 else -1.0
    position = centre + away * (profile.r_max + 0.07 + FLAT_SIZE[0] / 2) * view.right
    position[2] = max(position[2], FLAT_SIZE[1] / 2 + 0.06)
    return position


def close_up(state: State, view: Viewpoint) -> Viewpoint:
    """Return a viewpoint in the direction of another, in which the object and the flat map fill the view."""
    profile, pose, flat = state.scene.profile, state.T_world_object, flat_map_position(state, view)
    axis = np.array([[0.0, 0.0, h, 1.0] for h in (profile.h_min, profile.h_max)])
    ends = (axis @ pose.T)[:, :3]
    look_at = (1 - TOWARDS_MAP) * ends.mean(axis=0) + TOWARDS_MAP * flat + [0.0, 0.0, ABOVE]
    edges = flat + np.array([[-0.5], [0.5]]) * FLAT_SIZE[0] * view.right
    return replace(view, look_at=look_at, width=CLOSE_WIDTH, points=np.concatenate([ends, edges]))
