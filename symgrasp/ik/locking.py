"""Which joint of a 7-joint arm is locked, so that the others have an inverse kinematics that is known."""

from __future__ import annotations

import numpy as np

from symgrasp.errors import UrdfError
from symgrasp.ik.families import COARSE, EXACT, chain_geometries, has_exact_pair
from symgrasp.ik.pair.geometry import MEETING_PAIR
from symgrasp.robot.robot import PITCH, Arm

__all__ = ["joint_to_lock"]

LOCK_PREFERENCE = (6, 2, 0, 4, 1, 5, 3)
"""Which of seven joints to lock, first choice first among those that leave an arm of the same kind. Locking
the last one keeps the arm's whole reach; locking the elbow (index 3) would fix its distance."""

PITCHED_PREFERENCE = (PITCH, 3, 2, 1)
"""The same for a pitched arm: the values that change along the one-parameter families of configurations that
hold an object at a height. Its first joint and its last, which rolls the hand, are constant along those that
matter most: at an upright object they set azimuth and roll."""

GENERIC_ANGLE = 0.3
"""Value (rad) at which locks are tried: the answer is the same at almost any value, but at zero axes may
happen to be parallel."""

CLOSED_FORM, ROUNDED_CLOSED_FORM, FIXED_PAIR, TURNED_PAIR, COARSE_CLOSED_FORM, COARSE_PAIR, UNKNOWN = range(7)
"""What a lock leaves, best first: a closed form; the same once axes are moved by what rounding explains; two
axes that meet at one end of the arm; the same on both sides of the locked joint, so that the point where they
meet depends on φ, and may be far away; a closed form, or two axes that meet, once axes are moved further; an
arm that nothing here solves."""


def joint_to_lock(arm: Arm) -> int | None:
    """Return the index of the joint to lock, or None for a 6-joint arm.

    Raises:
        UrdfError: no inverse kinematics is known, whichever joint is locked.
    """
    choices = [None] if arm.dof == 6 else list(PITCHED_PREFERENCE if arm.pitched else LOCK_PREFERENCE)
    kinds: list[int] = []
    for joint in choices:
        kinds.append(_kind(arm, joint))
        if kinds[-1] == CLOSED_FORM:
            break
    if min(kinds) == UNKNOWN:
        raise UrdfError(
            arm.robot.model.path,
            f"arm {arm.name}",
            list(arm.joint_names),
            "two axes at one end of the arm that meet in a point, or three parallel ones that begin with the "
            "second or the third, with any joint of seven locked",
        )
    return choices[kinds.index(min(kinds))]


def _kind(arm: Arm, joint: int | None) -> int:
    """Return what locking a joint leaves."""
    found = chain_geometries(arm, joint, np.array([GENERIC_ANGLE]))
    if found is None:
        return UNKNOWN
    precision, (geometry,) = found
    if geometry.family != MEETING_PAIR:
        if precision is COARSE:
            return COARSE_CLOSED_FORM
        return CLOSED_FORM if precision is EXACT else ROUNDED_CLOSED_FORM
    if not has_exact_pair(arm, joint, GENERIC_ANGLE):
        return COARSE_PAIR
    between = (1,) if geometry.backwards else (arm.dof - 2,)
    return TURNED_PAIR if joint in between else FIXED_PAIR
