"""Scenes at random, as the content of scene files: what fails can be saved and looked at."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from symgrasp.bench.maps import random_scenes

ARMS = {
    "three_parallel": [0.0, -1.2, -1.5, -0.4, 1.5, 0.0],
    "offset_shoulder": [0.0, 0.0, 0.0, 0.9, 0.0, 0.6, 0.0],
    "offset_arm": [0.0, -0.6, 0.0, 1.2, 0.0, 0.6, 0.0],
    "offset_wrist": [0.0, -0.5, -1.0, 0.0, 1.0, 0.0],
    "five_joints": [0.0, -0.6, -0.9, 0.3, 0.0],
}
"""URDF in tests/data → a home in which the arm is free."""


def random_scene(seed: int, arm: str = "") -> dict[str, Any]:
    """Return a scene as `symgrasp.bench.maps.random_scenes` draws them.

    Args:
        seed: of everything in it.
        arm: one of `ARMS`, to be its only robot; by default the robots are those of a shipped scene.
    """
    if not arm:
        return random_scenes.random_scene(seed)
    urdf = Path(__file__).parent.parent / "data" / f"{arm}.urdf"
    robot = {"urdf": str(urdf), "mount": {"link": "flange"}, "hand": "wsg50", "home": ARMS[arm]}
    return random_scenes.random_scene(seed, [robot])


def random_pitched_scene(seed: int) -> dict[str, Any]:
    """Return a scene like those of `random_scene` with an arm of five joints.

    Args:
        seed: of everything in it. Of three hands, one is on the axis of the last joint, one beside it in the
            direction that the fingers close in, one across.
    """
    content = random_scene(seed, "five_joints")
    rng = np.random.default_rng(seed)
    (robot,) = content["robots"]
    off = [[0.0, 0.0, 0.0], [0.0, 0.008, 0.0], [0.008, 0.0, 0.0]][seed % 3]
    robot["mount"]["pose"] = {"position": off}
    robot["base"]["position"] = rng.normal([0.05, 0.0, 0.0], 0.05).round(4).tolist()
    del content["map"]["approach"]
    if rng.choice([0, 1]):  # lying, or anyhow
        content["tasks"][0]["pose"]["rpy_deg"] = rng.uniform([60, -30, -180], [120, 30, 180]).tolist()
    return content


def random_torso_scene(seed: int, *, falls: bool = False) -> dict[str, Any]:
    """Return a scene like those of `random_scene` with a robot of two arms on a lift and a waist.

    Args:
        seed: of everything in it.
        falls: whether it stands on small feet, and carries a load.
    """
    content = random_scene(seed, next(iter(ARMS)))
    rng = np.random.default_rng(seed)
    home = [1.03, -1.14, -1.37, -1.58, -0.5, 2.1]
    mirrored = [-1.03, -1.14, -1.37, -1.58, 0.5, 2.1]
    arms = [
        {"name": side, "hand": "wsg50", "mount": {"link": f"{side}_flange", "prefix": f"{side}_"}}
        for side in ("left", "right")
    ]
    names = [f"{side}_j{k}" for side in ("left", "right") for k in range(1, 7)]
    content["robots"] = [
        {
            "name": "body",
            "urdf": str(Path(__file__).parent.parent / "data" / "two_arms.urdf"),
            "base": {"position": [-0.1, 0.0, 0.0]},
            "arms": arms,
            "home": dict(zip(names, [*home, *mirrored], strict=True)),
            "torso": {"lift_joint": int(rng.integers(1, 4)), "waist_joint": int(rng.integers(1, 4))},
        }
    ]
    (task, *_) = content["tasks"]
    task["arms"] = ["left", "right"]
    content["tasks"] = [task]
    content["map"]["redundancy"] = 1
    if falls:
        if rng.choice([0, 1]):
            x, y = rng.uniform([0.0, 0.05], [0.1, 0.15])
            content["robots"][0]["support"] = [[x, y], [-x, y], [-x, -y], [x, -y], [0, 0]]
        else:
            content["robots"][0]["support"] = [f"{side}_foot" for side in ("left", "right")]
        content["object"]["mass"] = float(rng.uniform(0, 15))
        task["arms"] = [["left"], ["right", "left"]][rng.integers(2)]
    return content
