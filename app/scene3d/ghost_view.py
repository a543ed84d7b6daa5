"""The ghost in the 3D view: pale, with the bodies that collide in red."""

from __future__ import annotations

import trimesh
import viser

from symgrasp.scene.scene import Scene
from symgrasp.world import BodyName

from ..render.palette import rgb
from ..state.state import State
from .ghost import Ghost, body_mesh, ghost, link_mesh
from .nodes import set_pose

__all__ = ["GhostView"]

PALE, HIT = rgb("#7d93ad"), rgb("#e5202b")
PALE_OPACITY, HIT_OPACITY = 0.35, 0.75


class GhostView:
    """Shows the collision shapes of the ghost; those that it hits are added when they are first needed.

    Args:
        client: the browser.
        root: path of its node.
        scene: the scene.
    """

    def __init__(self, client: viser.ClientHandle, root: str, scene: Scene) -> None:
        self.client, self.root, self.scene = client, root, scene
        client.scene.add_frame(root, show_axes=False)
        self._robots: dict[str, dict[str, tuple[viser.MeshHandle, viser.MeshHandle]]] = {}
        self._bodies: dict[BodyName, viser.MeshHandle] = {}

    def show(self, state: State) -> None:
        """Update it to a state."""
        shown = ghost(state)
        if shown:
            self._make(shown, state)
        for robot, links in self._robots.items():
            is_shown = shown is not None and shown.robot == robot
            hit = shown.links() if shown and is_shown else frozenset()
            for link, (pale, red) in links.items():
                pale.visible, red.visible = is_shown and link not in hit, is_shown and link in hit
        for body, node in self._bodies.items():
            node.visible = shown is not None and body in shown.others()
            if body.body == self.scene.file.object.name:
                set_pose(node, state.T_world_object)
        if shown:
            self._pose(shown)

    def prepare(self, robot: str) -> None:
        """Add the links of a robot, hidden, unless they are there: later they only have to be shown."""
        if robot in self._robots:
            return
        model = self.scene.robots[robot].model
        meshes = {link: link_mesh(model, link) for link in model.colliding_links()}
        self._robots[robot] = {
            link: (
                self._add(f"{robot}/{link}/pale", mesh, PALE, PALE_OPACITY),
                self._add(f"{robot}/{link}/hit", mesh, HIT, HIT_OPACITY),
            )
            for link, mesh in meshes.items()
        }

    def _make(self, shown: Ghost, state: State) -> None:
        """Add the nodes that it needs and that were not needed before."""
        self.prepare(shown.robot)
        for body in shown.others() - set(self._bodies):
            mesh, pose = body_mesh(self.scene, body, state.T_world_object)
            node = self._bodies[body] = self._add(f"hit{len(self._bodies)}", mesh, HIT, HIT_OPACITY)
            set_pose(node, pose)

    def _pose(self, shown: Ghost) -> None:
        robot = self.scene.robots[shown.robot]
        poses = robot.T_world_base @ robot.model.forward(shown.values)
        for link, nodes in self._robots[shown.robot].items():
            for node in nodes:
                set_pose(node, poses[robot.model.link_index(link)])

    def _add(
        self, name: str, mesh: trimesh.Trimesh, color: tuple[int, int, int], opacity: float
    ) -> viser.MeshHandle:
        return self.client.scene.add_mesh_simple(
            f"{self.root}/{name}", mesh.vertices, mesh.faces, color=color, opacity=opacity,
            flat_shading=True, cast_shadow=False, receive_shadow=False, visible=False,
        )  # fmt: skip
