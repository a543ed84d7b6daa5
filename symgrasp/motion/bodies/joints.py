"""Which joints move with some arms and hands, and what they carry."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symgrasp.robot.joint import Joint
from symgrasp.robot.robot import Arm, Robot

__all__ = ["common_joint", "joint_index", "last_joint", "moving_joints"]


def moving_joints(arms: Sequence[Arm], hands: Sequence[Arm]) -> list[tuple[Robot, Joint]]:
    """Return the joints of some arms and hands with their robots, in the order of their chains; each once."""
    found: dict[tuple[str, str], tuple[Robot, Joint]] = {}
    for arm in arms:
        for joint in arm.robot.model.chain(arm.tool):
            if joint.name in arm.joint_names:
                found.setdefault((arm.robot.name, joint.name), (arm.robot, joint))
    for arm in hands:
        model = arm.robot.model
        sources = {model.joint_names.index(name) for name in arm.hand.joints}
        own = [joint for joint in model.joints if joint.source in sources]
        for joint in sorted(own, key=lambda j: len(model.chain(model.link_names[j.child]))):
            found.setdefault((arm.robot.name, joint.name), (arm.robot, joint))
    return list(found.values())


def last_joint(joints: Sequence[tuple[Robot, Joint]], robot: str, chain: Sequence[Joint]) -> int:
    """Return which of the moving joints is the last in a chain of joints of a robot, -1 if none is."""
    names = [joint.name for joint in chain]
    own = [(names.index(j.name), k) for k, (r, j) in enumerate(joints) if r.name == robot and j.name in names]
    return max(own)[1] if own else -1


def joint_index(joints: Sequence[tuple[Robot, Joint]], robot: str, name: str) -> int:
    """Return which of the moving joints a joint of a robot is."""
    return next(k for k, (own, joint) in enumerate(joints) if own.name == robot and joint.name == name)


def common_joint(parent: np.ndarray, a: int, b: int) -> int:
    """Return the last joint that carries what joints a and b carry, -1 if there is none."""
    above = set()
    while a >= 0:
        above.add(a)
        a = int(parent[a])
    while b >= 0 and b not in above:
        b = int(parent[b])
    return b
