"""Hands with a thumb: which finger it is, and how all of them curl to close on an object.

Such a hand has more joints than a parallel one, and no URDF says how they are driven together. Every finger
is taken to curl: the joints whose axes are parallel to that of its last joint move together, from straight to
curled. The other joints, which spread the fingers or turn the thumb, rest: at zero, and those of the thumb
where it curls about the same axis as the fingers do. That axis is the object's.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from symgrasp.errors import UrdfError
from symgrasp.hands.gripper import FingerMotion, Gripper
from symgrasp.hands.structure import HandStructure, links_with_shapes
from symgrasp.poses import Array, inverse
from symgrasp.robot.model import RobotModel

__all__ = ["find_thumb"]

PARALLEL = np.cos(np.deg2rad(30))
"""Axes whose directions have at least this cosine count as parallel."""

OPPOSED = -0.3
"""Cosine of the directions in which the tips of thumb and fingers move; a larger one is no thumb."""

IDLE = 0.005
"""A finger whose tip moves less than this (m) is none: such are the motors of some hands."""

RESTS = 7
"""Values from limit to limit that are tried for each joint of the thumb that rests."""

MOST_RESTS = 2
"""Most such joints."""

STEPS = 65
"""Number of configurations from closed to open in which the tips are looked at."""


class _Finger(NamedTuple):
    """A finger and its joints.

    Attributes:
        links: the links that it consists of.
        tip: the last of them with a shape.
        axis: unit axis (3,) of its last joint in the base.
        curling: indices of the joints that curl it into the model's joint names.
        resting: those of its other joints.
        curled: (curling,) values of those joints when it is curled.
        straight: (curling,) their values when it is straight.
    """

    links: list[str]
    tip: str
    axis: Array
    curling: list[int]
    resting: list[int]
    curled: Array
    straight: Array


def find_thumb(model: RobotModel, structure: HandStructure) -> Gripper | None:
    """Find the thumb of a hand whose fingers have several joints each.

    Returns:
        Thumb and fingers as two opposing groups, or None for a hand that is none of that kind.

    Raises:
        UrdfError: a joint has no limits, or no finger closes against the others.
    """
    own = [_own_sources(model, links) for links in structure.fingers]
    if not any(len(sources) > 1 for sources in own):
        return None
    fingers = [_finger(model, structure, *pair) for pair in zip(structure.fingers, own, strict=True)]
    rest = model.default_values()
    fingers = [finger for finger in fingers if np.linalg.norm(_travel(model, structure, finger, rest)) > IDLE]
    best, found = 1.0, None
    for thumb in fingers:
        others = [finger for finger in fingers if finger is not thumb]
        if not others or len(thumb.resting) > MOST_RESTS:
            continue
        across = _mean_axis(others)
        q = _turned(model, structure, thumb, across)
        moved = [_travel(model, structure, finger, q) for finger in (thumb, *others)]
        mean = np.mean(moved[1:], axis=0)
        cosine = float(moved[0] @ mean / np.linalg.norm(moved[0]) / max(np.linalg.norm(mean), 1e-9))
        if cosine < best:
            best, found = cosine, (thumb, others, across, q)
    if found is None or best > OPPOSED:
        names = [model.joint_names[k] for sources in own for k in sources]
        raise UrdfError(model.path, "hand: joints", names, "a thumb that closes against the other fingers")
    return _gripper(model, structure, *found)


def _own_sources(model: RobotModel, links: Sequence[str]) -> list[int]:
    """Return the joints that move the links of a finger, without those of the palm, from base to tip."""
    return list(
        dict.fromkeys(j.source for j in model.joints if j.source >= 0 and model.link_names[j.child] in links)
    )


def _finger(model: RobotModel, structure: HandStructure, links: list[str], sources: list[int]) -> _Finger:
    """Tell the joints that curl a finger from the others."""
    names = [model.joint_names[k] for k in sources]
    if not np.isfinite(model.upper[sources] - model.lower[sources]).all():
        raise UrdfError(model.path, "hand: joints", names, "joints with limits")
    axes = _axes(model, structure, sources, model.default_values())
    along = axes @ axes[-1]
    curls = np.abs(along) > PARALLEL
    curling = [k for k, c in zip(sources, curls, strict=True) if c]
    # Straight is zero. The last joint curls from there to its further limit, the others the same way round.
    way = np.sign(along[curls]) * np.sign(model.lower[sources[-1]] + model.upper[sources[-1]])
    lower, upper = model.lower[curling], model.upper[curling]
    curled, straight = np.where(way >= 0, upper, lower), np.where(way >= 0, lower, upper)
    tip = links_with_shapes(model, links)[-1]
    resting = [k for k, c in zip(sources, curls, strict=True) if not c]
    return _Finger(links, tip, axes[-1], curling, resting, curled, straight)


def _axes(model: RobotModel, structure: HandStructure, sources: Sequence[int], q: Array) -> Array:
    """Return the unit axes (k, 3) of joints in the base, at values (N,) of all joints."""
    poses = model.forward(q)
    R = poses[model.link_index(structure.base)][:3, :3]
    joints = [next(j for j in model.joints if j.source == k and j.ratio == 1) for k in sources]
    return np.array([R.T @ poses[j.child][:3, :3] @ j.axis for j in joints])


def _mean_axis(fingers: Sequence[_Finger]) -> Array:
    """Return the mean direction (3,) of the axes of fingers, whichever way round they are."""
    axes = np.array([finger.axis for finger in fingers])
    _, vectors = np.linalg.eigh(axes.T @ axes)
    return vectors[:, -1]


def _turned(model: RobotModel, structure: HandStructure, thumb: _Finger, across: Array) -> Array:
    """Return the joint values (N,) with the thumb turned to curl about an axis as nearly as can be."""
    q = model.default_values()
    grids = [
        [q[k], *np.linspace(model.lower[k], model.upper[k], RESTS)] for k in thumb.resting
    ]  # the default first: it stays where turning does not help
    best, found = -1.0, q
    for values in product(*grids):
        trial = q.copy()
        trial[thumb.resting] = values
        along = abs(float(_axes(model, structure, thumb.curling[-1:], trial)[0] @ across))
        if along > best + 1e-3:
            best, found = along, trial
    return found


def _tip(model: RobotModel, structure: HandStructure, finger: _Finger, q: Array) -> Array:
    """Return the middle (3,) of a finger's tip in the base."""
    poses = model.forward(q)
    pose = inverse(poses[model.link_index(structure.base)]) @ poses[model.link_index(finger.tip)]
    return pose[:3, :3] @ np.concatenate(model.hulls(finger.tip)).mean(axis=0) + pose[:3, 3]


def _travel(model: RobotModel, structure: HandStructure, finger: _Finger, rest: Array) -> Array:
    """Return how far (3,) the tip of a finger moves in the base as it curls."""
    tips = []
    for values in (finger.straight, finger.curled):
        q = rest.copy()
        q[finger.curling] = values
        tips.append(_tip(model, structure, finger, q))
    return tips[1] - tips[0]


def _gripper(
    model: RobotModel,
    structure: HandStructure,
    thumb: _Finger,
    others: Sequence[_Finger],
    across: Array,
    rest: Array,
) -> Gripper:
    """Return thumb and fingers as two groups that close from straight to where their tips meet."""
    fingers = [thumb, *others]
    curling = [k for finger in fingers for k in finger.curling]
    resting = [k for finger in fingers for k in finger.resting]
    curled = np.concatenate([finger.curled for finger in fingers])
    straight = np.concatenate([finger.straight for finger in fingers])
    tips = []
    for t in np.linspace(0.0, 1.0, STEPS):
        q = rest.copy()
        q[curling] = curled + t * (straight - curled)
        tips.append([_tip(model, structure, finger, q) for finger in fingers])
    apart = (
        np.mean(np.array(tips)[:, 1:], axis=1) - np.array(tips)[:, 0]
    )  # from the thumb's tip to the fingers'
    apart -= np.outer(apart @ across, across)
    meet = int(np.linalg.norm(apart, axis=1).argmin())
    closing = apart[-1] - apart[meet]
    start = curled + meet / (STEPS - 1) * (straight - curled)
    motion = FingerMotion(
        model,
        structure.base,
        np.array(curling + resting),
        np.concatenate([start, rest[resting]]),
        np.concatenate([straight, rest[resting]]),
    )
    sides = ([link for finger in others for link in finger.links], thumb.links)
    return Gripper(motion, sides, closing / np.linalg.norm(closing), across)
