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

__all__ = ["fit", "fits_all", "fits_none", "plot_openings"]

ROUNDING = 1e-12
"""What holds for a range of heights has to hold by that much (m): heights and radii are rounded."""

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


def fits_all(hand: Hand, profile: Profile, low: float, high: float, halvings: int = 4) -> bool:
    """Whether a hand is known to fit at every height from ``low`` to ``high`` (m), by halving them."""
    least, most = profile.radius_span(low, high)
    _, palm = profile.radius_span(low - hand.palm_width / 2, high + hand.palm_width / 2)
    bottom, top = low - hand.pad_width / 2, high + hand.pad_width / 2
    smallest, largest = profile.radius_span(bottom, top)
    if (
        hand.min_opening <= 2 * least - ROUNDING
        and 2 * most + ROUNDING <= hand.max_opening
        and (not hand.palm_width or palm + ROUNDING <= hand.standoff(least) + hand.palm_depth)
        and bottom >= profile.h_min - 1e-9 + ROUNDING
        and top <= profile.h_max + 1e-9 - ROUNDING
        and largest - smallest + ROUNDING <= hand.radius_tolerance
        and hand.fingers_have_room(profile, low - ROUNDING, high + ROUNDING)
    ):
        return True
    middle = 0.5 * (low + high)
    if not halvings or fit(hand, profile, middle) is not None:
        return False
    return fits_all(hand, profile, low, middle, halvings - 1) and fits_all(
        hand, profile, middle, high, halvings - 1
    )


def fits_none(hand: Hand, profile: Profile, low: float, high: float, halvings: int = 4) -> bool:
    """Whether a hand is known to fit at no height from ``low`` to ``high`` (m), by halving them."""
    least, most = profile.radius_span(low, high)
    if 2 * least > hand.max_opening + ROUNDING or 2 * most < hand.min_opening - ROUNDING:
        return True
    bottom, top = high - hand.pad_width / 2, low + hand.pad_width / 2  # what is under the pads at all heights
    if bottom < profile.h_min - 1e-9 - ROUNDING or top > profile.h_max + 1e-9 + ROUNDING:
        return True
    smallest, largest = profile.radius_span(bottom, top) if bottom <= top else (0.0, 0.0)
    if largest - smallest > hand.radius_tolerance + ROUNDING:
        return True
    bottom, top = high - hand.palm_width / 2, low + hand.palm_width / 2
    if hand.palm_width and bottom <= top:
        _, largest = profile.radius_span(bottom, top)
        if largest > hand.standoff(most) + hand.palm_depth + ROUNDING:
            return True
    middle = 0.5 * (low + high)
    if not halvings or fit(hand, profile, middle) is None:
        return False
    return fits_none(hand, profile, low, middle, halvings - 1) and fits_none(
        hand, profile, middle, high, halvings - 1
    )


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
