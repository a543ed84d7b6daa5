"""How far a robot's joints move what hangs on them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from symgrasp.poses import Array
from symgrasp.robot.model import RobotModel

__all__ = ["joint_reach"]


def joint_reach(model: RobotModel, held: Mapping[str, float] | None = None) -> Array:
    """Return how far (n,) (m/rad or m/m) any point may move for each unit that a joint moves, at most.

    When joint values change by Δq, no point of the robot moves further than ``joint_reach · |Δq|``.

    Args:
        model: the robot.
        held: link → distance (m) from its origin of the furthest point that is held at it.
    """
    furthest = np.array([_radius(model, link) for link in model.link_names])  # from each link's origin
    for link, distance in (held or {}).items():
        index = model.link_index(link)
        furthest[index] = max(furthest[index], distance)
    reach = np.zeros(len(model.joint_names))
    for joint in reversed(model.joints):  # children before parents
        away = float(np.linalg.norm(joint.origin[:3, 3]))
        if joint.source >= 0:
            prismatic = joint.kind == "prismatic"
            reach[joint.source] += abs(joint.ratio) * (1.0 if prismatic else furthest[joint.child])
            if prismatic:
                away += max(abs(joint.lower), abs(joint.upper))
        furthest[joint.parent] = max(furthest[joint.parent], away + furthest[joint.child])
    return reach


def _radius(model: RobotModel, link: str) -> float:
    """Return the distance (m) from a link's origin to the furthest point of its collision shapes."""
    return max((float(np.linalg.norm(hull, axis=1).max()) for hull in model.hulls(link)), default=0.0)
