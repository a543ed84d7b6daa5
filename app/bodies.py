"""What moves or changes in a scene: robots, the object with its coloured surface, the flat map."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import viser

from app.coloured import cell_colors
from app.palette import INK, PICK, rgb
from app.prints import on_surface
from app.profile_view import deviation_colors
from app.stage import Viewpoint, add_links, place, stand_around
from app.state import State
from app.surface import CellQuads, around, flat
from symgrasp.poses import Array, from_position_quat, from_rotation, rotation_z
from symgrasp.profile import Profile
from symgrasp.robot import Robot
from symgrasp.scene import Scene

__all__ = ["FLAT_SIZE", "FlatMap", "ObjectView", "RobotView", "board_position"]

OBJECT = (222, 226, 230)
SEAM_LIFT = 0.0012

FLAT_SIZE = (0.33, 0.22)
"""Width and height (m) of the map laid out flat."""

ASIDE = float(np.cos(np.deg2rad(65)))
"""Cosine of the angle from which on it is turned to the camera."""

OnCell = Callable[[int, int], None]


class RobotView:
    """The links of one robot."""

    def __init__(self, client: viser.ClientHandle, root: str, robot: Robot) -> None:
        self.model = robot.model
        place(client.scene.add_frame(root, show_axes=False), robot.T_world_base)
        nodes = add_links(client, root, robot.model)
        self.nodes = {self.model.link_index(link): node for link, node in nodes.items()}
        self._shown: Array | None = None

    def show(self, values: Array) -> None:
        """Take the joint values (n,) of the whole robot."""
        if self._shown is not None and np.array_equal(values, self._shown):
            return
        self._shown = values
        poses = self.model.forward(values)
        for index, node in self.nodes.items():
            place(node, poses[index])


class ObjectView:
    """The object, which turns, under its coloured surface, which does not.

    Turning the object by δ shifts the map by -δ in the object's frame, so in the world the colours
    stay where they are: m((h, θ), T·Rz(δ)) = m((h, θ + δ), T).
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
        self.surface = CellQuads(client, f"{root}/surface", *around(self.grid), self.grid.angles, on_cell)
        self.gizmo = add.add_transform_controls(f"{root}/gizmo", scale=0.16, line_width=3.0, depth_test=False)

        @self.gizmo.on_update
        def _(event: viser.TransformControlsEvent) -> None:
            on_drag(from_position_quat(event.target.position, event.target.wxyz))

    def show(self, state: State, *, move_gizmo: bool) -> None:
        """Bring it up to the state."""
        place(self.body, state.T_world_seen)
        place(self.surface.node, state.T_world_seen @ rotation_z(-state.delta))
        if state.errors and state.thing and state.thing.measurement:
            colors = deviation_colors(state.thing.measurement, self.grid)
            self.surface.paint(on_surface(state, colors))
        elif state.result:
            self.surface.paint(cell_colors(state, state.result.map))
        self.pick.visible = state.pick is not None
        if state.pick:
            self.pick.position = self.grid.contact(state.pick.h, state.pick.theta)
        self.gizmo.visible = state.gizmo
        if move_gizmo:
            place(self.gizmo, state.T_world_object)


class FlatMap:
    """The unwrapped map as a board in the scene, to be clicked."""

    def __init__(
        self, client: viser.ClientHandle, root: str, state: State, view: Viewpoint, on_cell: OnCell
    ) -> None:
        add, grid = client.scene, state.scene.manifold
        width, height = FLAT_SIZE
        self.frame = add.add_frame(root, show_axes=False)
        self._position = board_position(state, view)
        self._turn(view)
        add.add_box(
            f"{root}/back", dimensions=(width + 0.012, height + 0.012, 0.004), position=(0, 0, -0.004),
            color=(255, 255, 255), cast_shadow=False, receive_shadow=False,
        )  # fmt: skip
        self.title = add.add_label(
            f"{root}/title", "unrolled map: click a cell", position=(0, height / 2 + 0.02, 0),
            anchor="bottom-center", font_screen_scale=0.8,
        )  # fmt: skip
        self.cells = CellQuads(client, f"{root}/cells", *flat(grid, width, height), grid.angles, on_cell)

    def face(self, camera: Sequence[float]) -> None:
        """Turn its front to a camera (see `app.values.Camera`) that sees it from behind or far aside."""
        seen = self._view.seen_from((*camera[:3], *self._position))
        if seen.direction @ self._view.direction < ASIDE:
            self._turn(seen)

    def _turn(self, view: Viewpoint) -> None:
        self._view = view
        axes = np.stack([view.right, [0.0, 0.0, 1.0], view.direction], axis=-1)
        place(self.frame, from_rotation(axes, self._position))

    def show(self, state: State) -> None:
        """Bring it up to the state."""
        self.frame.visible = state.board
        if state.map:
            self.cells.paint(cell_colors(state, state.map))
            # What a turn leaves over beside whole cells moves the start of the grid.
            rest = (state.map.manifold.theta_start + np.pi) / (2 * np.pi)
            self.cells.node.position = (rest * FLAT_SIZE[0], 0.0, 0.0)


def board_position(state: State, view: Viewpoint) -> Array:
    """Return where the flat map is in nobody's way: beyond the object, or over it."""
    profile, pose = state.scene.profile, state.T_world_object
    centre = (pose @ [0.0, 0.0, (profile.h_min + profile.h_max) / 2, 1.0])[:3]
    if stand_around(state.scene, pose):
        return centre + np.array([0.0, 0.0, 0.55])
    bases = np.array([robot.T_world_base[:3, 3] for robot in state.scene.robots.values()])
    away = 1.0 if (centre - bases.mean(axis=0)) @ view.right >= 0 else -1.0
    position = centre + away * (profile.r_max + 0.07 + FLAT_SIZE[0] / 2) * view.right
    position[2] = max(position[2], FLAT_SIZE[1] / 2 + 0.06)
    return position


def _add_seam(client: viser.ClientHandle, name: str, profile: Profile) -> None:
    """Draw lines along the object at θ = 0 and every quarter turn, which turn with it."""
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
