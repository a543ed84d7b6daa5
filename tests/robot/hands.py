"""The shipped hands on arms, and random points of convex hulls, for several tests."""

from __future__ import annotations

from functools import cache

import numpy as np

from symgrasp.poses import Array
from symgrasp.robot.robot import Arm
from symgrasp.scene.scene import Scene

IIWA = "package://pybullet_data/kuka_iiwa/model.urdf"
FLANGE = {"link": "lbr_iiwa_link_7", "pose": {"position": [0, 0, 0.045]}}


@cache
def arms_with_hands() -> dict[str, Arm]:
    """One arm with each of the shipped hands: a Panda with its own, iiwas with the others."""
    panda = {"urdf": "package://pybullet_data/franka_panda/panda.urdf"}
    upright = {"link": "lbr_iiwa_link_7", "pose": {"position": [0, 0, 0.045], "rpy_deg": [0, -90, 0]}}
    robots = [
        {"name": "franka", "hand": "franka", **panda},
        {"name": "wsg50", "hand": "wsg50", "urdf": IIWA, "mount": FLANGE},
        {"name": "pr2", "hand": "pr2", "urdf": IIWA, "mount": upright},
    ]
    scene = {
        "schema_version": 1,
        "name": "hands",
        "robots": robots,
        "object": {"name": "bar", "profile": [[0, 0.02], [0.5, 0.02]]},
        "tasks": [{"name": "hold", "pose": {}}],
    }
    return dict(Scene.from_content(scene).arms)


def random_points_in(hulls: list[Array], rng: np.random.Generator, count: int = 4000) -> Array:
    """Random points of the convex hulls: between three corners, out to the corners themselves."""
    points = []
    for vertices in hulls:
        corners = vertices[rng.integers(len(vertices), size=(count, 3))]
        points.append(np.einsum("nk,nkd->nd", rng.dirichlet([0.4, 0.4, 0.4], count), corners))
    return np.concatenate(points)
