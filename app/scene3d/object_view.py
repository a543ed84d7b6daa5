"""The object in the 3D view, with its map on the surface."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import viser

from symgrasp.object.profile import Profile
from symgrasp.poses import Array, from_position_quat, rotation_z
from symgrasp.scene.scene import Scene

from ..render.cell_colors import cell_colors
from ..render.deviation import deviation_colors
from ..render.drawn_poses import drawn_object_pose
from ..render.palette import INK, PICK, rgb
from ..render.prints import on_surface
from ..state.state import State
from .cell_mesh import CellMesh, OnCell, surface_quads
from .nodes import set_pose

__all__ = ["ObjectView"]


OBJECT = (222, 226, 230)
"""Colour (sRGB) of the object where no map is shown."""

SEAM_LIFT = 0.0012
"""Distance (m) of the lines from the object's surface."""


class ObjectView:
    """The object, which turns by δ, and the coloured cells on its surface, which do not.

    Turning the object by δ shifts the map by -δ in the object's frame, so in the world the colours
    stay where they are: m((h, θ), T·Rz(δ)) = m((h, θ + δ), T).

    Args:
        client: the browser.
        root: path of the node to add it under.
        scene: the scene.
        on_cell: called with the cell of the surface that was clicked.
        on_drag: called with the pose (4, 4) that the gizmo was dragged to.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        root: str,
        scene: Scene,
        on_cell: OnCell,
        on_drag: Callable[[Array], None],
    ) -> None:
        add, self.grid = client.scene, scene.manifold
        self.body = add.add_frame(f"{root}/object", show_axes=False)
        mesh = scene.profile.mesh()
        add.add_mesh_simple(
            f"{root}/object/body", mesh.vertices, mesh.faces, color=OBJECT, side="double",
            cast_shadow=False, receive_shadow=False,
        )  # fmt: skip
        _add_seam(client, f"{root}/object/seam", scene.profile)
        self.pick = add.add_icosphere(f"{root}/object/pick", radius=0.007, color=rgb(PICK), visible=False)
        self.surface = CellMesh(client, f"{root}/surface", surface_quads, self.grid, on_cell)
        self.gizmo = add.add_transform_controls(f"{root}/gizmo", scale=0.16, line_width=3.0, depth_test=False)

        @self.gizmo.on_update
        async def _(event: viser.TransformControlsEvent) -> None:  # at once, while the pose is this event's
            on_drag(from_position_quat(event.target.position, event.target.wxyz))

    def show(self, state: State, *, move_gizmo: bool) -> None:
        """Update it to a state; the gizmo only if asked, as a person may be dragging it."""
        set_pose(self.body, drawn_object_pose(state))
        set_pose(self.surface.node, drawn_object_pose(state) @ rotation_z(-state.delta))
        if state.display.symmetry_error and state.object_choice and state.object_choice.measurement:
            colors = deviation_colors(state.object_choice.measurement, self.grid)
            self.surface.set_colors(on_surface(state, colors))
        elif state.base_map:
            self.surface.set_colors(cell_colors(state, state.base_map))
        self.pick.visible = state.pick is not None
        if state.pick:
            self.pick.position = self.grid.contact(state.pick.h, state.pick.theta)
        self.gizmo.visible = state.display.drag_handles
        if move_gizmo:
            set_pose(self.gizmo, state.T_world_object)


def _add_seam(client: viser.ClientHandle, name: str, profile: Profile) -> None:
    """Add lines along the object at every quarter turn from θ = 0; they turn with it."""
    h, r = profile.points.T
    r = r + SEAM_LIFT
    low, high = [0.0, 0.0, h[0] - SEAM_LIFT], [0.0, 0.0, h[-1] + SEAM_LIFT]
    for quarter in range(4):
        angle = quarter * np.pi / 2
        line = np.stack([r * np.cos(angle), r * np.sin(angle), h], axis=-1)
        line = np.vstack([low, line, high])  # across both ends as well
        client.scene.add_line_segments(
            f"{name}{quarter}",
            np.stack([line[:-1], line[1:]], axis=1),
            colors=rgb(INK),
            thickness=0.0025 if quarter == 0 else 0.0006,
        )
    client.scene.add_label(
        f"{name}_label", "θ = 0", position=(float(r[-1]), 0.0, float(h[-1])), anchor="bottom-left",
        font_screen_scale=0.7,
    )  # fmt: skip
