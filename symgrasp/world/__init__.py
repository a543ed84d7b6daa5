"""Collisions in PyBullet: the only part that knows it.

Every question is put as "which links are closer than a distance", which Bullet answers from the
poses alone; its contact cache, which remembers earlier configurations, is not used. Collision
margins are set to zero, so distances are those of the shapes themselves.
"""

from symgrasp.world.bullet import BulletWorld
from symgrasp.world.collision import Body, Collision, NearBodies
from symgrasp.world.opening import open_world
from symgrasp.world.self_pairs import checked_self_pairs
from symgrasp.world.shapes import Shape
from symgrasp.world.tasks import RESTING_DEPTH, check_tasks

__all__ = [
    "RESTING_DEPTH", "Body", "BulletWorld", "Collision", "NearBodies", "Shape", "check_tasks",
    "checked_self_pairs", "open_world",
]  # fmt: skip
