"""Where PyBullet has a link, asked of PyBullet itself."""

from __future__ import annotations

import numpy as np
import pybullet

from symgrasp.poses import Array
from symgrasp.world import BulletWorld


def link_pose(world: BulletWorld, robot: str, link: str) -> Array:
    """Return the pose (4, 4) of a robot's link in the world, by PyBullet's forward kinematics."""
    bodies, model = world.bodies, world.scene.robots[robot].model
    indices = bodies.link_indices(robot)
    if link == model.root:
        return world.scene.robots[robot].T_world_base
    if link not in indices:  # it has no shape, and is fixed to the link above it
        joint = model.chain(link)[-1]
        assert joint.kind == "fixed"
        return link_pose(world, robot, model.link_names[joint.parent]) @ joint.origin
    index = indices[link]
    state = pybullet.getLinkState(
        bodies.robots[robot], index, computeForwardKinematics=True, physicsClientId=bodies.client
    )
    pose = np.eye(4)
    pose[:3, :3] = np.reshape(pybullet.getMatrixFromQuaternion(state[5]), (3, 3))
    pose[:3, 3] = state[4]
    return pose
