"""Helpers for nodes of viser's scene tree: setting a pose, adding the links of a robot."""

from __future__ import annotations

import viser

from symgrasp.poses import Array, quat_wxyz
from symgrasp.robot.model import RobotModel

from ..choices.scene_assets import Visuals
from .visual_meshes import link_visuals

__all__ = ["add_links", "set_pose"]


def set_pose(node: viser.SceneNodeHandle, pose: Array) -> None:
    """Set the pose (4, 4) of a node in its parent's frame."""
    node.wxyz = quat_wxyz(pose)
    node.position = pose[:3, 3]


def add_links(
    client: viser.ClientHandle, root: str, model: RobotModel, values: Array, given: Visuals
) -> dict[str, viser.GlbHandle]:
    """Add the visible links of a robot, each where it is: a browser draws them as soon as they arrive.

    Args:
        client: the browser.
        root: path of the node to add them under.
        model: the robot's model.
        values: the joint values (n,) of the whole robot, in rad or m.
        given: what is known of how robots look; what is missing is read.

    Returns:
        Link name → its node.
    """
    visuals = given[model.urdf] if model.urdf in given else link_visuals(model.urdf)
    poses = model.forward(values)
    nodes = {}
    for k, (link, glb) in enumerate(visuals.items()):
        pose = poses[model.link_index(link)]
        nodes[link] = client.scene.add_glb(
            f"{root}/{k}", glb, wxyz=quat_wxyz(pose), position=pose[:3, 3],
            cast_shadow=False, receive_shadow=False,
        )  # fmt: skip
    return nodes
