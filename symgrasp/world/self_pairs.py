"""The pairs of a robot's links that must be checked for self-collision, found by sampling."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from symgrasp.caching import kept
from symgrasp.poses import Array
from symgrasp.progress import Progress, cached
from symgrasp.robot.model import RobotModel
from symgrasp.world.client import link_names, load_urdf, pybullet

__all__ = ["checked_self_pairs"]

SELF_SAMPLES = 2000
"""Number of random configurations that show which pairs of links always or never collide."""

FIRST, PART = 16, 256
"""Number of samples that are looked at first, which decide most pairs, and in each part after them."""

NEVER_GAP = 0.02
"""Pairs that come closer than this (m) in some sample are checked, even if they collide in none."""

BOX_SLACK = 2e-3
"""By how much (m) PyBullet's shapes may stand out of the boxes around the hulls of a link."""


@cached(32)
def checked_self_pairs(model: RobotModel, progress: Progress | None) -> tuple[tuple[str, str], ...]:
    """Return the pairs of links that collide in some configurations, but not in all.

    Left out are adjacent links, pairs that the SRDF lets touch, pairs that overlap in all of
    `SELF_SAMPLES` random configurations (a flange and the hand on it), and pairs that stay further apart
    than `NEVER_GAP` in all of them. They are kept on the disk: for a hand of many links it takes seconds.

    Args:
        model: the robot.
        progress: called with the finished share while they are sampled; may raise `Cancelled`.
    """
    (found,) = kept(("self pairs", model.sha256), lambda: (_sampled_pairs(model, progress),))
    return tuple((model.link_names[a], model.link_names[b]) for a, b in found.tolist())


def _sampled_pairs(model: RobotModel, progress: Progress | None = None) -> np.ndarray:
    """Return the pairs (., 2) of `checked_self_pairs`, by the indices of the links."""
    links = [link for link in model.colliding_links() if model.hulls(link)]
    left_out = model.neighbours() | model.allowed_pairs()
    names = [pair for pair in combinations(links, 2) if frozenset(pair) not in left_out]
    pairs = np.array([[model.link_index(link) for link in pair] for pair in names], dtype=int).reshape(-1, 2)
    lower = np.where(np.isfinite(model.lower), model.lower, -np.pi)
    upper = np.where(np.isfinite(model.upper), model.upper, np.pi)
    samples = np.random.default_rng(0).uniform(lower, upper, (SELF_SAMPLES, len(lower)))
    near, always = np.zeros(len(pairs), dtype=bool), np.ones(len(pairs), dtype=bool)
    client = pybullet.connect(pybullet.DIRECT)
    try:
        body = load_urdf(client, model, np.eye(4))
        index = {link: i - 1 for i, link in enumerate(link_names(client, body))}
        moving = [
            (index[link], j)
            for j in model.joints
            if j.source >= 0 and (link := model.link_names[j.child]) in index
        ]
        begins = [0, FIRST, *range(FIRST + PART, SELF_SAMPLES, PART)]
        for done, part in zip(begins, np.split(samples, begins[1:]), strict=True):
            undecided = np.flatnonzero(~near | always)
            close = _boxes_close(model, pairs[undecided], part)
            always[undecided] &= close.all(axis=0)
            for k, (q, row) in enumerate(zip(part, close, strict=True)):
                if progress:
                    progress((done + k) / SELF_SAMPLES)
                asked = undecided[row]
                asked = asked[~near[asked] | always[asked]]
                if not len(asked):
                    continue
                pybullet.resetJointStatesMultiDof(
                    body,
                    [j for j, _ in moving],
                    [[j.ratio * q[j.source] + j.offset] for _, j in moving],
                    physicsClientId=client,
                )
                for k in asked.tolist():
                    a, b = names[k]
                    points = pybullet.getClosestPoints(
                        body, body, NEVER_GAP, index[a], index[b], physicsClientId=client
                    )
                    near[k] |= bool(points)
                    always[k] &= any(p[8] < 0 for p in points)
    finally:
        pybullet.disconnect(client)
    return pairs[near & ~always]


def _boxes_close(model: RobotModel, pairs: np.ndarray, samples: Array) -> np.ndarray:
    """Return which pairs of links may be within `NEVER_GAP` of each other, by their bounding boxes.

    Args:
        model: the robot.
        pairs: (P, 2) indices of links.
        samples: (S, n) joint values.

    Returns:
        (S, P) bool; false where they are further apart for certain.
    """
    used, index = np.unique(pairs, return_inverse=True)
    a, b = index.reshape(-1, 2).T
    points = [np.concatenate(model.hulls(model.link_names[link])) for link in used]
    low, high = (np.array([end(p, axis=0) for p in points]).reshape(-1, 3) for end in (np.min, np.max))
    middle, half = 0.5 * (low + high), 0.5 * (high - low) + BOX_SLACK
    poses = model.forward(samples)[:, used]
    turn = poses[..., :3, :3]
    centre = (turn @ middle[..., None])[..., 0] + poses[..., :3, 3]
    reach = (np.abs(turn) @ half[..., None])[..., 0] + 0.5 * NEVER_GAP
    close = np.ones((len(samples), len(pairs)), dtype=bool)
    for c, r in zip(np.moveaxis(centre, -1, 0), np.moveaxis(reach, -1, 0), strict=True):
        close &= np.abs(c[:, a] - c[:, b]) <= r[:, a] + r[:, b]
    # Along the axes of each box the other one reaches as far as its half extents, turned.
    for first, second in ((a, b), (b, a)):
        s, k = np.nonzero(close)
        i, j = first[k], second[k]
        into = np.swapaxes(turn[s, i], -1, -2)
        apart = np.abs(into @ (centre[s, j] - centre[s, i])[..., None])[..., 0]
        other = (np.abs(into @ turn[s, j]) @ half[j][..., None])[..., 0]
        close[s, k] = (apart <= half[i] + other + NEVER_GAP).all(axis=-1)
    return close
