"""Whether a hand fits an object at a height: the part of feasibility in which the arm has no say."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from symgrasp.feasibility import pictures
from symgrasp.object.profile import Profile
from symgrasp.reason import Reason
from symgrasp.robot.hand import Hand

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["fit", "plot_openings"]

ROWS = 400
"""Heights at which the picture of the openings asks whether a hand fits."""


def fit(hand: Hand, profile: Profile, h: float) -> Reason | None:
    """Return why a hand cannot hold an object at a height, for any arm and any angle.

    Args:
        hand: the hand.
        profile: the object.
        h: the height (m).

    Returns:
        `Reason.HAND_TOO_SMALL` or `Reason.SURFACE_TOO_STEEP`, or None where the hand fits.
    """
    if not (hand.spans(float(profile.radius(h))) and hand.palm_has_room(profile, h)):
        return Reason.HAND_TOO_SMALL
    if not hand.pads_rest(profile, h):
        return Reason.SURFACE_TOO_STEEP
    return None


def plot_openings(profile: Profile, hands: Mapping[str, Hand]) -> Figure:
    """Draw over the height how far each hand opens around an object, and where it fits at all.

    Args:
        profile: the object.
        hands: the hands by the names to show.
    """
    h = np.linspace(profile.h_min, profile.h_max, ROWS)
    radii = profile.radius(h)
    reason = np.array([[_reason(fit(hand, profile, x)) for x in h] for hand in hands.values()])
    openings = np.array([[hand.opening(float(r)) for r in radii] for hand in hands.values()])
    return pictures.draw_openings(h, 2 * radii, list(hands), openings, reason)


def _reason(misfit: Reason | None) -> Reason:
    """Return a reason for every height: FEASIBLE where the hand fits."""
    return Reason.FEASIBLE if misfit is None else misfit
