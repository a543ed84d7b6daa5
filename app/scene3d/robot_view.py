"""A robot in the 3D view: its links as meshes."""

from __future__ import annotations

import numpy as np
import viser

from symgrasp.poses import Array
from symgrasp.robot.robot import Robot

from ..choices.scene_assets import Visuals
from .nodes import add_links, set_pose

__all__ = ["RobotView"]


class RobotView:
    """The links of one robot.

    Args:
        client: the browser.
        root: path of its node.
        robot: the robot.
        values: the joint values (n,) of the whole robot at first, in rad or m.
        visuals: see `app.scene3d.nodes.add_links`.
    """

    def __init__(
        self, client: viser.ClientHandle, root: str, robot: Robot, values: Array, visuals: Visuals
    ) -> None:
        self.model = robot.model
        self.base = client.scene.add_frame(root, show_axes=False)
        set_pose(self.base, robot.T_world_base)
        nodes = add_links(client, root, robot.model, values, visuals)
        self.nodes = {self.model.link_index(link): node for link, node in nodes.items()}
        self._shown = values

    def show(self, values: Array) -> None:
        """Move the links to joint values (n,) of the whole robot, in rad or m."""
        if np.array_equal(values, self._shown):
            return
        self._shown = values
        poses = self.model.forward(values)
        for index, node in self.nodes.items():
            set_pose(node, poses[index])
