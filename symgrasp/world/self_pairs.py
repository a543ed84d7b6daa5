"""The pairs of a robot's links that must be checked for self-collision, found by sampling."""

from __future__ import annotations

from functools import lru_cache
from itertools import combinations

import numpy as np

from symgrasp.poses import Array
from symgrasp.robot.model import RobotModel
from symgrasp.world.client import link_names, load_urdf, pybullet

__all__ = ["checked_self_pairs"]

SELF_SAMPLES = 2000
"""Number of random configurations that show which pairs of links always or never collide."""

NEVER_GAP = 0.02
"""Pairs that come closer than this (m) in some sample are checked, even if they collide in none."""

BOX_SLACK = 2e-3
"""By how much (m) PyBullet's shapes may stand out of the boxes around the hulls of a link."""


@lru_cache(maxsize=32)
def checked_self_pairs(model: RobotModel) -> tuple[tuple[str, str], ...]:
    """Return the pairs of links that collide in some configurations, but not in all.

    Left out are adjacent links, pairs that the SRDF lets touch, pairs that overlap in all of
    `SELF_SAMPLES` random configurations (a flange and the hand on it), and pairs that stay further apart
    than `NEVER_GAP` in all of them.
    """
    links = tuple(link for link in model.colliding_links() if model.hulls(link))
    adjacent = model.neighbours() | model.allowed_pairs()
    pairs = [
        (a, b)
        for a, b in combinations(range(len(links)), 2)
        if frozenset((links[a], links[b])) not in adjacent
    ]
    lower = np.where(np.isfinite(model.lower), model.lower, -np.pi)
    upper = np.where(np.isfinite(model.upper), model.upper, np.pi)
    samples = np.random.default_rng(0).uniform(lower, upper, (SELF_SAMPLES, len(lower)))
    close = _boxes_close(model, links, np.array(pairs, dtype=int).reshape(-1, 2), samples)
    near, always = np.zeros(len(pairs), dtype=bool), np.asarray(close.all(axis=0))
    client = pybullet.connect(pybullet.DIRECT)
    try:
        body = load_urdf(client, model, np.eye(4))
        index = {link: i - 1 for i, link in enumerate(link_names(client, body))}
        moving = [
            (index[link], j)
            for j in model.joints
            if j.source >= 0 and (link := model.link_names[j.child]) in index
        ]
        for q, asked in zip(samples, close, strict=True):
            open_pairs = np.flatnonzero(asked & ~(near & ~always))
            if not len(open_pairs):
                continue
            pybullet.resetJointStatesMultiDof(
                body,
                [j for j, _ in moving],
                [[j.ratio * q[j.source] + j.offset] for _, j in moving],
                physicsClientId=client,
            )
            for k in open_pairs:
                a, b = pairs[k]
                points = pybullet.getClosestPoints(
                    body, body, NEVER_GAP, index[links[a]], index[links[b]], physicsClientId=client
                )
                near[k] |= bool(points)
                always[k] &= any(p[8] < 0 for p in points)
    finally:
        pybullet.disconnect(client)
    return tuple(
        (links[a], links[b]) for (a, b), checked in zip(pairs, near & ~always, strict=True) if checked
    )


def _boxes_close(model: RobotModel, links: tuple[str, ...], pairs: np.ndarray, samples: Array) -> np.ndarray:
    """Return which pairs of links may be within `NEVER_GAP` of each other, by their bounding boxes.

    Args:
        model: the robot.
        links: its links with shapes.
        pairs: (P, 2) indices of links.
        samples: (S, n) joint values.

    Returns:
        (S, P) bool; false where they are further apart for certain.
    """
    low = np.array([np.min([hull.min(axis=0) for hull in model.hulls(link)], axis=0) for link in links])
    high = np.array([np.max([hull.max(axis=0) for hull in model.hulls(link)], axis=0) for link in links])
    middle, half = 0.5 * (low + high), 0.5 * (high - low) + BOX_SLACK
    poses = model.forward(samples)[:, [model.link_index(link) for link in links]]
    turn = poses[..., :3, :3]
    centre = np.einsum("slij,lj->sli", turn, middle) + poses[..., :3, 3]
    reach = np.einsum("slij,lj->sli", np.abs(turn), half)
    a, b = pairs.T
    close = np.zeros((len(samples), len(pairs)), dtype=bool)
    for row, R, c, r in zip(close, turn, centre, reach, strict=True):
        k = np.flatnonzero((np.abs(c[a] - c[b]) - r[a] - r[b] <= NEVER_GAP).all(axis=1))
        # Along the axes of each box the other one reaches as far as its half extents, turned.
        for first, second in ((a, b), (b, a)):
            i, j = first[k], second[k]
            apart = np.einsum("kji,kj->ki", R[i], c[j] - c[i])
            other = np.einsum("kil,kl->ki", np.abs(np.einsum("kji,kjl->kil", R[i], R[j])), half[j])
            k = k[(np.abs(apart) - half[i] - other <= NEVER_GAP).all(axis=1)]
        row[k] = True
    return close
