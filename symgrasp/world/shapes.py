"""The convex collision shapes of links, read back from PyBullet as it has them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from symgrasp.poses import Array
from symgrasp.world.client import pose_of, pybullet

__all__ = ["Shape", "link_shapes"]

MARGIN = 1e-3
"""Collision margin (m) that Bullet keeps around the hulls of a URDF, and rounds boxes with."""


class Shape(NamedTuple):
    """A convex collision shape as PyBullet has it: a convex hull, enlarged by a ball (Minkowski sum).

    Attributes:
        vertices: (n, 3) corners of the hull in the link frame.
        rounding: radius (m) of the ball.
        slack: by how much (m) the true shape may be smaller than this one.
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
    shapes = []
    for index, (_, _, kind, size, _, at, turn) in enumerate(data):
        shape = _primitive(kind, size, centre @ pose_of(at, turn))
        if shape is None:
            _, points = pybullet.getMeshData(body, link, collisionShapeIndex=index, physicsClientId=client)
            vertices = np.array(points, dtype=float).reshape(-1, 3) @ centre[:3, :3].T + centre[:3, 3]
            shape = Shape(vertices, MARGIN, 0.0)
        shapes.append(shape)
    return shapes


def _primitive(kind: int, size: Sequence[float], pose: Array) -> Shape | None:
    """Return a box, sphere or capsule as a `Shape` in the link frame, and None for any other kind."""
    if kind == pybullet.GEOM_BOX:
        # Bullet rounds boxes inwards: only edges and corners are missing, by less than its margin.
        corners, rounding, slack = np.array(list(np.ndindex(2, 2, 2))) - 0.5, 0.0, MARGIN
        corners = corners * size
    elif kind == pybullet.GEOM_SPHERE:
        corners, rounding, slack = np.zeros((1, 3)), float(size[0]), 0.0
    elif kind == pybullet.GEOM_CAPSULE:
        corners, rounding, slack = np.array([[0, 0, -0.5 * size[0]], [0, 0, 0.5 * size[0]]]), size[1], 0.0
    else:
        return None
    return Shape(corners @ pose[:3, :3].T + pose[:3, 3], rounding, slack)
