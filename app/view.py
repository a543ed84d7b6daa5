"""The 3D view of one browser: robots, object, its coloured surface, the map laid out flat, the gizmo."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import viser

from app.palette import INK, PICK, REASONS, faded, rgb
from app.readout import postures
from app.stage import FIELD_OF_VIEW, add_floor, add_links, add_obstacle, camera_position, place, viewpoint
from app.state import State
from app.surface import CellQuads, around, flat
from symgrasp.manifold import Manifold
from symgrasp.poses import Array, from_position_quat, from_rotation
from symgrasp.robot import Robot
from symgrasp.scene import Scene

__all__ = ["SceneView"]

BOARD = (0.33, 0.22)
"""Width and height (m) of the map laid out flat in the scene."""

OBJECT = (222, 226, 230)
SEAM_LIFT = 0.0012


class RobotView:
    """The links of one robot."""

    def __init__(self, client: viser.ClientHandle, root: str, robot: Robot) -> None:
        self.model = robot.model
        frame = client.scene.add_frame(root, show_axes=False)
        place(frame, robot.T_world_base)
        nodes = add_links(client, root, robot.model.path)
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


class SceneView:
    """Shows a state in 3D.

    Args:
        client: the browser.
        beside: width (px) of the panels beside the view.
        on_surface: called with the cell (row, column) that was clicked on the object.
        on_board: called with the cell that was clicked on the flat map.
        on_drag: called with the pose (4, 4) that the gizmo was dragged to.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        beside: int,
        on_surface: Callable[[int, int], None],
        on_board: Callable[[int, int], None],
        on_drag: Callable[[Array], None],
    ) -> None:
        self.client, self.on_surface, self.on_board, self.on_drag = client, on_surface, on_board, on_drag
        self._scene: Scene | None = None
        self._beside = beside
        client.scene.configure_default_lights(enabled=True, cast_shadow=False)

    def show(self, state: State, *, move_gizmo: bool) -> None:
        """Bring the view up to the state; the gizmo only moves along if nobody is dragging it."""
        if state.scene is not self._scene:
            self._build(state)
        with self.client.atomic():
            if state.is_current or not state.busy:  # arms wait where they are for a new map
                for name, values in postures(state).items():
                    self.robots[name].show(values)
            place(self.object, state.T_world_object)
            if move_gizmo:
                place(self.gizmo, state.T_world_object)
            self.gizmo.visible = state.gizmo
            self._show_map(state)
            self._show_pick(state)

    def _build(self, state: State) -> None:
        """Replace everything by another scene."""
        self._scene = scene = state.scene
        add = self.client.scene
        add.remove_by_name("/stage") if add.get_handle_by_name("/stage") else None
        look_at, direction = viewpoint(scene, state.T_world_object)
        with self.client.atomic():
            self.client.camera.fov = FIELD_OF_VIEW
            self.client.camera.up_direction = (0.0, 0.0, 1.0)
            self.client.camera.position = camera_position(look_at, direction, self._aspect())
            self.client.camera.look_at = look_at
        add.add_frame("/stage", show_axes=False)
        add_floor(self.client, "/stage/floor", scene)
        for k, obstacle in enumerate(scene.obstacles):
            add_obstacle(self.client, f"/stage/obstacle{k}", obstacle)
        self._build_object(scene)
        self._build_board(state, direction)
        self.robots = {
            name: RobotView(self.client, f"/stage/robot{k}", robot)
            for k, (name, robot) in enumerate(scene.robots.items())
        }

    def _aspect(self) -> float:
        """Return width by height of the 3D view, of which the panels take their part at first."""
        camera = self.client.camera
        width, self._beside = camera.image_width - self._beside, 0
        return width / max(camera.image_height, 1)

    def _build_object(self, scene: Scene) -> None:
        add, grid = self.client.scene, scene.manifold
        self.object = add.add_frame("/stage/object", show_axes=False)
        mesh = scene.profile.mesh()
        add.add_mesh_simple(
            "/stage/object/body", mesh.vertices, mesh.faces, color=OBJECT, side="double",
            cast_shadow=False, receive_shadow=False,
        )  # fmt: skip
        _add_seam(self.client, "/stage/object/seam", grid)
        self.marker = add.add_icosphere("/stage/object/pick", radius=0.007, color=rgb(PICK), visible=False)
        self.surface = CellQuads(self.client, "/stage/surface", *around(grid), grid.angles, self.on_surface)
        self.gizmo = add.add_transform_controls("/stage/gizmo", scale=0.16, line_width=3.0, depth_test=False)

        @self.gizmo.on_update
        def _(event: viser.TransformControlsEvent) -> None:
            self.on_drag(from_position_quat(event.target.position, event.target.wxyz))

    def _build_board(self, state: State, direction: Array) -> None:
        """Lay the map out flat beside the object, facing the camera."""
        add, scene = self.client.scene, state.scene
        up = np.array([0.0, 0.0, 1.0])
        right = np.cross(up, direction)
        width, height = BOARD
        centre = (state.T_world_object @ [0, 0, (scene.profile.h_min + scene.profile.h_max) / 2, 1])[:3]
        bases = np.array([robot.T_world_base[:3, 3] for robot in scene.robots.values()])
        away = 1.0 if (centre - bases.mean(axis=0)) @ right >= 0 else -1.0
        beside = scene.profile.r_max + 0.07 + width / 2
        position = centre + away * beside * right
        position[2] = max(position[2], height / 2 + 0.06)
        pose = from_rotation(np.stack([right, up, direction], axis=-1), position)
        self.board = add.add_frame("/stage/board", show_axes=False)
        place(self.board, pose)
        add.add_box(
            "/stage/board/back", dimensions=(width + 0.012, height + 0.012, 0.004), color=(255, 255, 255),
            position=(0, 0, -0.004), cast_shadow=False, receive_shadow=False,
        )  # fmt: skip
        add.add_label(
            "/stage/board/title", "unrolled map: click a cell", position=(0, height / 2 + 0.02, 0),
            anchor="bottom-center", font_screen_scale=0.8,
        )  # fmt: skip
        grid = scene.manifold
        self.board_map = CellQuads(
            self.client, "/stage/board/map", *flat(grid, width, height), grid.angles, self.on_board
        )

    def _show_map(self, state: State) -> None:
        place(self.surface.node, state.request.T_world_object)
        self.board.visible = state.board
        if state.result is None or state.map is None:
            return
        still, turned = state.result.map, state.map
        self.surface.paint(_colors(state, state.roll.reason(still)))
        self.board_map.paint(_colors(state, state.roll.reason(turned)))
        # What a turn leaves over beside whole cells moves the start of the grid.
        rest = (turned.manifold.theta_start + np.pi) / (2 * np.pi)
        self.board_map.node.position = (rest * BOARD[0], 0.0, 0.0)

    def _show_pick(self, state: State) -> None:
        self.marker.visible = state.pick is not None
        if state.pick is not None:
            self.marker.position = state.scene.manifold.contact(state.pick.h, state.pick.theta)


def _colors(state: State, reason: np.ndarray) -> np.ndarray:
    colors = REASONS[reason]
    return colors if state.is_current else faded(colors)


def _add_seam(client: viser.ClientHandle, name: str, grid: Manifold) -> None:
    """Draw lines along the object at θ = 0 and every quarter turn, which turn with it."""
    h, r = grid.profile.points.T
    r = r + SEAM_LIFT
    for quarter in range(4):
        angle = quarter * np.pi / 2
        line = np.stack([r * np.cos(angle), r * np.sin(angle), h], axis=-1)
        ends = [np.array([0.0, 0.0, h[0] - SEAM_LIFT]), np.array([0.0, 0.0, h[-1] + SEAM_LIFT])]
        line = np.vstack([ends[0], line, ends[1]])  # across both ends as well
        client.scene.add_line_segments(
            f"{name}{quarter}",
            np.stack([line[:-1], line[1:]], axis=1),
            colors=rgb(INK),
            thickness=0.0025 if quarter == 0 else 0.0006,
        )
    client.scene.add_label(
        f"{name}_label",
        "θ = 0",
        position=(float(r[-1]), 0.0, float(h[-1])),
        anchor="bottom-left",
        font_screen_scale=0.7,
    )
