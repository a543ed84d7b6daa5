"""Collision checks and distances of a scene in PyBullet, which no other room uses.

All checks ask PyBullet for closest points within a distance, which depend on the present poses alone; its
contact cache, which depends on earlier configurations, is not used. Distances are those of the shapes
themselves, but for a millimetre that PyBullet keeps around the hulls of links.
"""

from symgrasp.world.bullet import BulletWorld
from symgrasp.world.collision import BodyName, Collision, NearBodies
from symgrasp.world.hand_pairs import own_pairs
from symgrasp.world.home import check_homes, with_free_homes
from symgrasp.world.near_links import near_links
from symgrasp.world.opening import open_world
from symgrasp.world.placing import placed, stands_free
from symgrasp.world.self_pairs import checked_self_pairs
from symgrasp.world.shapes import Shape
from symgrasp.world.tasks import RESTING_DEPTH, check_task, check_tasks, object_contact, prepared

__all__ = [
    "RESTING_DEPTH", "BodyName", "BulletWorld", "Collision", "NearBodies", "Shape", "check_homes",
    "check_task", "check_tasks", "checked_self_pairs", "near_links", "object_contact", "open_world",
    "own_pairs", "placed", "prepared", "stands_free", "with_free_homes",
]  # fmt: skip
