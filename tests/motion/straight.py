"""Motions made by hand: straight lines in joint space, in a scene with nothing in the way."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symgrasp.motion.segments import Motion, Segment
from symgrasp.poses import Array
from symgrasp.scene.scene import Scene

__all__ = ["CARRIED", "GRASPED", "straight_motion"]

GRASPED = np.array([0.3, 0.2, 0.1, -1.9, 0.0, 2.1, 0.6])
CARRIED = np.array([-0.5, 0.1, 0.2, -1.7, 0.2, 1.9, 0.1])


def straight_motion(scene: Scene, poses: Sequence[Array]) -> Motion:
    """Return an untimed motion of the first arm, from home to a grasp and on with the object."""
    (name, arm), *_ = scene.arms.items()
    first, last = "pick", "place"
    return Motion(
        scene,
        poses,
        (
            Segment("open", (name,), {name: np.stack([arm.home, arm.home])}, None, {name: (None, 0.06)},
                    (), first, first),
            Segment("reach", (name,), {name: np.linspace(arm.home, GRASPED, 4)}, None, {}, (), first, first),
            Segment("close", (name,), {name: np.stack([GRASPED, GRASPED])}, None, {name: (0.06, 0.05)},
                    (), first, first),
            Segment("carry", (name,), {name: np.linspace(GRASPED, CARRIED, 5)}, None, {}, (name,),
                    first, last),
        ),
    )  # fmt: skip
