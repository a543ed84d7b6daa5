"""The convex collision shapes of links, read back from PyBullet as it has them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from symgrasp.poses import Array
from symgrasp.world.client import pose_of, pybullet

__all__ = ["Shape", "link_shapes"]

WALL_GAP = 0.5
"""Distance (m) between a link and the wall that its rounding is measured against."""

LINK_MARGIN = 1e-3
"""Collision margin (m) that Bullet keeps for the parts of a compound: setting it on the compound has no
effect on them."""


class Shape(NamedTuple):
    """A convex collision shape as PyBullet has it: a convex hull, enlarged by a ball (Minkowski sum).

    Attributes:
        vertices: (n, 3) corners of the hull in the link frame.
        rounding: radius (m) of the ball.
        slack: by how much (m) the true shape may be smaller than this one; inf where PyBullet does not
            tell the parts of a link apart and this is the hull of them all.
    """

    vertices: Array
    rounding: float
    slack: float


def link_shapes(client: int, body: int, link: int) -> list[Shape]:
    """Return the convex shapes of a link.

    Args:
        client: PyBullet's id of the physics client.
        body: PyBullet's body id.
        link: PyBullet's link index, -1 for the base.
    """
    data = pybullet.getCollisionShapeData(body, link, physicsClientId=client)
    if not data:
        return []
    info = pybullet.getDynamicsInfo(body, link, physicsClientId=client)
    centre = pose_of(info[3], info[4])  # Bullet's link frames sit at the centres of mass
    shapes = [_primitive(kind, size, centre @ pose_of(at, turn)) for _, _, kind, size, _, at, turn in data]
    if any(shapes):
        hulls = [_mesh(client, body, link, k) for k, shape in enumerate(shapes) if shape is None]
        rounding, slack = LINK_MARGIN, LINK_MARGIN
    else:
        hulls, every = [_mesh(client, body, link, k) for k in range(len(data))], _mesh(client, body, link, -1)
        apart = len(every) == sum(map(len, hulls))
        hulls = hulls if apart else [every]
        rounding, slack = _rounding(client, body, link, every), 0.0 if apart else np.inf
    hulled = [Shape(v @ centre[:3, :3].T + centre[:3, 3], rounding, slack) for v in hulls if len(v)]
    return [shape for shape in shapes if shape] + hulled


def _mesh(client: int, body: int, link: int, index: int) -> Array:
    """Return the vertices (n, 3) of a link's shape, of all for index -1, in Bullet's link frame."""
    _, vertices = pybullet.getMeshData(body, link, collisionShapeIndex=index, physicsClientId=client)
    return np.reshape(np.array(vertices, dtype=float), (-1, 3))


def _rounding(client: int, body: int, link: int, vertices: Array) -> float:
    """Return by how much (m) Bullet enlarges the hull of vertices (n, 3), measured against a wall."""
    if link < 0:
        position, orientation = pybullet.getBasePositionAndOrientation(body, physicsClientId=client)
    else:
        position, orientation = pybullet.getLinkState(
            body, link, computeForwardKinematics=True, physicsClientId=client
        )[:2]
    pose = pose_of(position, orientation)
    top = (vertices @ pose[2, :3]).max() + pose[2, 3]
    half = 2.0
    shape = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[half] * 3, physicsClientId=client)
    above = [pose[0, 3], pose[1, 3], top + WALL_GAP + half]
    wall = pybullet.createMultiBody(0.0, shape, basePosition=above, physicsClientId=client)
    pybullet.changeDynamics(wall, -1, collisionMargin=0.0, physicsClientId=client)
    found = pybullet.getClosestPoints(body, wall, 1.0, link, -1, physicsClientId=client)
    pybullet.removeBody(wall, physicsClientId=client)
    return max(0.0, float(WALL_GAP - min(p[8] for p in found)))


def _primitive(kind: int, size: Sequence[float], pose: Array) -> Shape | None:
    """Return a box, sphere or capsule as a `Shape` in the link frame, and None for any other kind."""
    if kind == pybullet.GEOM_BOX:
        # Bullet rounds boxes inwards: only edges and corners are missing, by less than its margin.
        corners, rounding, slack = np.array(list(np.ndindex(2, 2, 2))) - 0.5, 0.0, LINK_MARGIN
        corners = corners * size
    elif kind == pybullet.GEOM_SPHERE:
        corners, rounding, slack = np.zeros((1, 3)), float(size[0]), 0.0
    elif kind == pybullet.GEOM_CAPSULE:
        corners, rounding, slack = np.array([[0, 0, -0.5 * size[0]], [0, 0, 0.5 * size[0]]]), size[1], 0.0
    else:
        return None
    return Shape(corners @ pose[:3, :3].T + pose[:3, 3], rounding, slack)
