"""A motion looked at in PyBullet, in steps in which nothing moves further than a given distance."""

from __future__ import annotations

import numpy as np

from symgrasp.motion.segments import Motion, Segment
from symgrasp.world import RESTING_DEPTH, BulletWorld

REACH = 1.3
"""No point of an arm is further (m) from any of its axes."""


def collisions_of(world: BulletWorld, motion: Motion, step: float) -> tuple[int, list[str]]:
    """How many states were looked at, and what collides in them; no body moves further than ``step`` (m)."""
    looked, found = 0, []
    for k, segment in enumerate(motion.segments):
        count = len(next(iter(segment.joints.values())))
        for row in range(count - 1):
            turn = max(np.abs(path[row + 1] - path[row]).sum() for path in segment.joints.values())
            shares = np.linspace(0.0, 1.0, 2 + int(turn * REACH / step) if turn else 20)
            for share in shares:
                state = motion.state(k, row + share, (row + share) / (count - 1))
                for name, values in state.values.items():
                    world.set_robot(name, values)
                world.set_object(state.T_world_object)
                looked += 1
                found += [f"{segment.kind} {row + share:.3f}: {text}" for text in _collisions(world, segment)]
    return looked, found


def _collisions(world: BulletWorld, segment: Segment) -> list[str]:
    found = [str(c) for c in world.collisions(list(world.scene.arms.values()))]
    if segment.kind in ("reach", "home"):  # here not even the fingers may touch the object
        moving = [world.scene.arm(name).robot.name for name in segment.arms]
        others = [name for name in world.scene.robots if name not in moving]
        holders = {world.scene.arm(name).robot.name for name in segment.held_by}
        if not holders & set(moving):
            found += [str(c) for c in world.object_in_robots(others)]
    return found + [str(c) for c in world.object_contacts() if c.depth > RESTING_DEPTH]
