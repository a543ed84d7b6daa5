"""The pairs of a robot's links that are checked in a scene: without those that overlap in its hands.

Some URDFs put a coarse shape around a hand, in which its fingers are. Two links that only the opening of one
hand moves against each other, and that overlap at every opening, would bar every grasp and tell none from
another.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from functools import lru_cache, partial

import numpy as np

from symgrasp.caching import kept
from symgrasp.poses import Array, inverse
from symgrasp.robot.hand import Hand
from symgrasp.robot.model import RobotModel
from symgrasp.scene.scene import Scene
from symgrasp.world.client import link_names, load_urdf, pybullet
from symgrasp.world.self_pairs import checked_self_pairs

__all__ = ["always_in_hands", "own_pairs"]

OPENINGS = 65
"""Number of openings, from closed to open, at which pairs of links are looked at."""


def own_pairs(scene: Scene, robot: str) -> tuple[tuple[str, str], ...]:
    """Return the pairs of links of a robot, given by name, that must not collide.

    They are those of `checked_self_pairs` without those of `always_in_hands`.
    """
    held = {pair for pair, _ in always_in_hands(scene, robot)}
    return tuple(pair for pair in checked_self_pairs(scene.robots[robot].model) if pair not in held)


def always_in_hands(scene: Scene, robot: str) -> tuple[tuple[tuple[str, str], str], ...]:
    """Return the pairs of links of a robot that overlap at every opening of a hand, with the hand's name.

    All other joints that part the two links rest at home. Between the openings that are looked at, the links
    move less than they overlap by.
    """
    arms = [arm for arm in scene.arms.values() if arm.robot.name == robot]
    moved = frozenset(k for arm in arms for k in arm.indices.tolist())
    hands = tuple(dict.fromkeys(arm.hand for arm in arms))  # two that were measured may have one name
    model, home = scene.robots[robot].model, scene.robots[robot].home
    return _always(model, hands, moved, home.tobytes())


@lru_cache(maxsize=32)
def _always(
    model: RobotModel, hands: tuple[Hand, ...], moved: frozenset[int], home: bytes
) -> tuple[tuple[tuple[str, str], str], ...]:
    sources = {
        hand: frozenset(model.joint_names.index(n) for n in hand.joints if n in model.joint_names)
        for hand in hands
    }
    of_hands = frozenset().union(*sources.values())
    between_pairs = _between(model, checked_self_pairs(model))
    found: list[tuple[tuple[str, str], str]] = []
    for hand in hands:
        pairs = [
            pair
            for pair, between in between_pairs.items()
            if between and not between & moved and between & of_hands and between & of_hands <= sources[hand]
        ]
        if pairs:
            values = _values(model, hand, np.frombuffer(home))
            key = ("overlapping", model.sha256, tuple(pairs), hashlib.sha256(values.tobytes()).hexdigest())
            (overlap,) = kept(key, partial(_overlapping, model, pairs, values))
            found += [(pairs[k], hand.name) for k in overlap.tolist()]
    return tuple(found)


def _between(model: RobotModel, pairs: Sequence[tuple[str, str]]) -> dict[tuple[str, str], frozenset[int]]:
    """Return the joints that move one link of a pair and not the other, as indices of joint names."""
    links = dict.fromkeys(link for pair in pairs for link in pair)
    chains = {link: {j.name: j.source for j in model.chain(link) if j.source >= 0} for link in links}
    return {
        (a, b): frozenset((chains[a] | chains[b])[name] for name in chains[a].keys() ^ chains[b].keys())
        for a, b in pairs
    }


def _values(model: RobotModel, hand: Hand, home: Array) -> Array:
    """Return the joint values (OPENINGS, N) at openings of a hand, everything else at home."""
    values = np.tile(home, (OPENINGS, 1))
    for row, opening in zip(values, np.linspace(hand.min_opening, hand.max_opening, OPENINGS), strict=True):
        for name, value in hand.joint_values(float(opening)).items():
            row[model.joint_names.index(name)] = value
    return values


def _overlapping(model: RobotModel, pairs: list[tuple[str, str]], values: Array) -> tuple[np.ndarray]:
    """Return which pairs (.,) overlap at all joint values (S, N), by more than they move in between."""
    least = dict.fromkeys(pairs, np.inf)
    client = pybullet.connect(pybullet.DIRECT)
    try:
        body = load_urdf(client, model, np.eye(4))
        index = {link: i - 1 for i, link in enumerate(link_names(client, body))}
        moving = [j for j in model.joints if j.source >= 0 and model.link_names[j.child] in index]
        for q in values:
            pybullet.resetJointStatesMultiDof(
                body,
                [index[model.link_names[j.child]] for j in moving],
                [[j.ratio * q[j.source] + j.offset] for j in moving],
                physicsClientId=client,
            )
            for a, b in list(least):
                points = pybullet.getClosestPoints(
                    body, body, 0.0, index[a], index[b], physicsClientId=client
                )
                least[a, b] = min(least[a, b], max((-p[8] for p in points), default=-np.inf))
                if least[a, b] <= 0:
                    del least[a, b]
            if not least:
                return (np.empty(0, dtype=int),)
    finally:
        pybullet.disconnect(client)
    poses = model.forward(values)
    found = [pairs.index(pair) for pair, depth in least.items() if depth > _step(model, pair, poses)]
    return (np.array(found, dtype=int),)


def _step(model: RobotModel, pair: tuple[str, str], poses: Array) -> float:
    """Return how far (m) corners of a link of a pair move against the other at most, from pose to pose."""
    a, b = (poses[:, model.link_index(link)] for link in pair)
    relative = inverse(a) @ b
    corners = np.concatenate(model.hulls(pair[1]))
    at = np.einsum("sij,kj->ski", relative[:, :3, :3], corners) + relative[:, None, :3, 3]
    return float(np.linalg.norm(np.diff(at, axis=0), axis=-1).max())
