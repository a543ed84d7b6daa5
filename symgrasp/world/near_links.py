"""Which links of robots can be near each other in many states at once: those whose balls around them are."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

import numpy as np

from symgrasp.poses import Array
from symgrasp.world.bullet import BulletWorld
from symgrasp.world.collision import BodyName

__all__ = ["near_links"]

SLACK = 1e-3
"""By how much (m) balls are larger than needed: PyBullet places links in single precision."""

Pair = tuple[BodyName, BodyName]


def near_links(
    world: BulletWorld,
    values: Mapping[str, Array],
    pairs: Iterable[Pair],
    distance: float,
    trying: Callable[[], None] = lambda: None,
) -> list[list[Pair]]:
    """Return, for each of some states (m,), the pairs of links that can be within a distance.

    All others are further apart, because the smallest balls around the middles of their shapes' boxes are.

    Args:
        world: the world that the links are in; its state does not count.
        values: robot → values (m, N) of its joints.
        pairs: pairs of links of robots.
        distance: the distance (m).
        trying: called before every robot and link; may raise `Cancelled`.
    """
    balls: dict[BodyName, tuple[Array, float]] = {}  # link → centre (m, 3) in the world, radius (m)
    for name, rows in values.items():
        robot = world.scene.robots[name]
        poses = robot.T_world_base @ robot.model.forward_rows(rows, trying)
        for link, shapes in world.shapes(name).items():
            trying()
            corners = np.concatenate([shape.vertices for shape in shapes])
            middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
            radius = max(
                float(np.linalg.norm(shape.vertices - middle, axis=1).max()) + shape.rounding
                for shape in shapes
            )
            T = poses[:, robot.model.link_index(link)]
            balls[BodyName(name, link)] = T[:, :3, :3] @ middle + T[:, :3, 3], radius
    found: list[list[Pair]] = [[] for _ in range(len(next(iter(values.values()))))]
    for a, b in pairs:
        trying()
        if a in balls and b in balls:  # links without a shape meet nothing
            (here, own), (there, other) = balls[a], balls[b]
            near = np.linalg.norm(here - there, axis=1) <= own + other + distance + SLACK
            for k in np.flatnonzero(near):
                found[k].append((a, b))
    return found
