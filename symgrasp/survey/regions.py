"""Where things may stand: the places that an arm might reach, and the table that an object stands on."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from symgrasp.poses import Array
from symgrasp.scene.parts import Task
from symgrasp.scene.scene import Scene

__all__ = ["Rectangle", "length_of_arm", "places_of_object", "support_height"]

NEAR = 0.02
"""Largest distance (m) of an object above a table that it stands on."""


class Rectangle(NamedTuple):
    """A rectangle in the plane: intervals of x and y (m)."""

    x: tuple[float, float]
    y: tuple[float, float]

    def grid(self, spacing: float) -> tuple[Array, Array]:
        """Return the multiples of a spacing (m) within, at least one: coordinates x (n,) and y (m,)."""
        found = []
        for low, high in self:
            first, last = math.ceil(low / spacing - 1e-9), math.floor(high / spacing + 1e-9)
            middle = round((low + high) / 2 / spacing)
            found.append(
                np.round(np.arange(first, last + 1) * spacing if first <= last else [middle * spacing], 6)
            )
        return found[0], found[1]


def length_of_arm(scene: Scene, arm: str) -> float:
    """Return the length (m) of an arm's links, stretched out: nothing is reached beyond."""
    return float(np.linalg.norm(scene.arms[arm].P[1:], axis=-1).sum())


def support_height(scene: Scene, task: Task) -> float:
    """Return the height (m) of the object's lowest point in a task."""
    T = task.T_world_object
    return float((scene.profile.mesh().vertices @ T[2, :3] + T[2, 3]).min())


def places_of_object(scene: Scene, arm: str, task: Task) -> Rectangle:
    """Return where the origin of the object is worth trying for an arm, at its height and lean in a task.

    That is the square around the robot's base that the length of the arm gives, and of it, where the object
    stands on a box, what is above that box.
    """
    x, y = scene.arms[arm].robot.T_world_base[:2, 3].tolist()
    length = length_of_arm(scene, arm)
    low, high = np.array([x - length, y - length]), np.array([x + length, y + length])
    place, bottom = task.T_world_object[:2, 3], support_height(scene, task)
    for o in scene.obstacles:
        if o.kind != "box":
            continue
        corners = np.array(o.size) * (np.indices((2, 2, 2)).reshape(3, -1).T - 0.5)
        corners = corners @ o.T_world_obstacle[:3, :3].T + o.T_world_obstacle[:3, 3]
        own_low, own_high = corners[:, :2].min(axis=0), corners[:, :2].max(axis=0)
        stands = abs(bottom - corners[:, 2].max()) < NEAR and (own_low <= place).all()
        if stands and (place <= own_high).all():
            low, high = np.maximum(low, own_low), np.minimum(high, own_high)
    low, high = np.minimum(low, place), np.maximum(high, place)  # where the object is now, in any case
    return Rectangle((float(low[0]), float(high[0])), (float(low[1]), float(high[1])))
