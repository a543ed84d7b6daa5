"""A survey in the 3D view: a heat map on its plane, and ghosts of the robot at the best bases."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import viser

from symgrasp.meshes import joined

from ..render.palette import rgb, to_linear
from ..render.survey_colors import place_colors
from ..state.state import State
from ..state.surveys.survey import Places, Stand
from .cell_mesh import QUAD, TRIANGLES
from .ghost import link_mesh
from .nodes import set_pose

__all__ = ["SurveyView"]

LIFT = 0.003
"""Height (m) of the heat map over its plane, so that it hides it; smaller squares lie higher."""

GAP = 0.92
"""Side of a square, of what it stands for."""

GHOST, OPACITY = rgb("#7d93ad"), 0.3


class SurveyView:
    """The heat map, where a click on a place chooses it, and the ghosts, where a click chooses a base.

    Args:
        client: the browser.
        root: path of the node to add them under.
        on_place: called with the index of a place.
        on_stand: called with the index of a base.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        root: str,
        on_place: Callable[[int], None],
        on_stand: Callable[[int], None],
    ) -> None:
        self._client, self._root = client, root
        self._on_place, self._on_stand = on_place, on_stand
        self._places: Places | None = None
        self._stands: tuple[Stand, ...] = ()
        self._colors = b""
        self._squares: viser.BatchedMeshHandle | None = None
        self._ghosts: list[viser.SceneNodeHandle] = []
        self._builds = 0
        client.scene.add_frame(root, show_axes=False)

    def show(self, state: State) -> None:
        """Show what is known of the survey, if it is about what is shown now."""
        survey = state.survey
        places = state.shown_places if survey.shown else None
        if places is not self._places:
            self._place_squares(places)
        if places is not None and self._squares is not None:
            colors = to_linear(place_colors(survey.value, survey.values)[0])
            if colors.tobytes() != self._colors:
                self._colors = colors.tobytes()
                self._squares.batched_colors = colors
        stands = survey.stands if places else ()
        if stands is not self._stands:
            self._place_ghosts(state, stands)

    def _place_squares(self, places: Places | None) -> None:
        if self._squares:
            self._squares.remove()
        self._places, self._squares, self._colors = places, None, b""
        if places is None:
            return
        self._builds += 1
        n = len(places.xy)
        heights = places.z + LIFT * (2.0 - places.size / places.size.max())
        self._squares = self._client.scene.add_batched_meshes_simple(
            f"{self._root}/places{self._builds}",
            vertices=QUAD,
            faces=TRIANGLES,
            batched_wxyzs=np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)),
            batched_positions=np.column_stack([places.xy, heights]),
            batched_scales=np.column_stack([places.size * GAP] * 3).astype(np.float32),
            batched_colors=np.full((n, 3), 200, dtype=np.uint8),
            lod="off",
            side="double",
            cast_shadow=False,
            receive_shadow=False,
        )

        @self._squares.on_click
        def _(event: viser.SceneNodePointerEvent) -> None:
            # The place as it was drawn: meanwhile there may be more of them, after these.
            if event.instance_index is not None:
                self._on_place(event.instance_index)

    def _place_ghosts(self, state: State, stands: tuple[Stand, ...]) -> None:
        for node in self._ghosts:
            node.remove()
        self._stands, self._ghosts = stands, []
        if not stands:
            return
        robot = state.robot
        links = robot.model.forward(robot.home)
        meshes = []
        for link in robot.model.colliding_links():
            mesh = link_mesh(robot.model, link)
            mesh.apply_transform(links[robot.model.link_index(link)])
            meshes.append(mesh)
        mesh, add = joined(meshes), self._client.scene
        self._builds += 1
        for k, stand in enumerate(stands):
            pose = stand.base.moved(robot.T_world_base)
            name = f"{self._root}/stand{self._builds}_{k}"
            ghost = add.add_mesh_simple(
                name, mesh.vertices, mesh.faces, color=GHOST, opacity=OPACITY, flat_shading=True,
                cast_shadow=False, receive_shadow=False,
            )  # fmt: skip
            set_pose(ghost, pose)
            top = float(mesh.bounds[1, 2]) + 0.05
            label = add.add_label(f"{name}/label", str(k + 1), position=(0.0, 0.0, top))
            ghost.on_click(lambda _, k=k: self._on_stand(k))
            self._ghosts += [label, ghost]
