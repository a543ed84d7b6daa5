"""The pairs of a robot's links that must be checked for self-collision, found by sampling."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from symgrasp.robot.model import RobotModel
from symgrasp.world.client import link_names, load_urdf, pybullet

__all__ = ["checked_self_pairs"]

SELF_SAMPLES = 2000
"""Number of random configurations that show which pairs of links always or never collide."""

NEVER_GAP = 0.02
"""Pairs that come closer than this (m) in some sample are checked, even if they collide in none."""


@lru_cache(maxsize=32)
def checked_self_pairs(model: RobotModel) -> tuple[tuple[str, str], ...]:
    """Return the pairs of links that collide in some configurations, but not in all.

    Left out are adjacent links, pairs that overlap in all of `SELF_SAMPLES` random configurations (a
    flange and the hand on it), and pairs that stay further apart than `NEVER_GAP` in all of them.
    """
    client = pybullet.connect(pybullet.DIRECT)
    try:
        body = load_urdf(client, model, np.eye(4))
        index = {link: i - 1 for i, link in enumerate(link_names(client, body))}
        links = model.colliding_links()
        adjacent = model.neighbours()
        pairs = [
            (a, b) for i, a in enumerate(links) for b in links[i + 1 :] if frozenset((a, b)) not in adjacent
        ]
        moving = [
            (index[link], j)
            for j in model.joints
            if j.source >= 0 and (link := model.link_names[j.child]) in index
        ]
        lower = np.where(np.isfinite(model.lower), model.lower, -np.pi)
        upper = np.where(np.isfinite(model.upper), model.upper, np.pi)
        samples = np.random.default_rng(0).uniform(lower, upper, (SELF_SAMPLES, len(lower)))
        always = dict.fromkeys(pairs, True)
        near = dict.fromkeys(pairs, False)
        for q in samples:
            pybullet.resetJointStatesMultiDof(
                body,
                [j for j, _ in moving],
                [[j.ratio * q[j.source] + j.offset] for _, j in moving],
                physicsClientId=client,
            )
            for a, b in pairs:
                if near[a, b] and not always[a, b]:
                    continue
                points = pybullet.getClosestPoints(
                    body, body, NEVER_GAP, index[a], index[b], physicsClientId=client
                )
                near[a, b] |= bool(points)
                always[a, b] &= any(p[8] < 0 for p in points)
        return tuple(pair for pair in pairs if near[pair] and not always[pair])
    finally:
        pybullet.disconnect(client)
