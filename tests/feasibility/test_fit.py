from __future__ import annotations

import io
from dataclasses import replace

import matplotlib.image
import numpy as np
import pytest

from symgrasp.feasibility.fit import fit, plot_openings
from symgrasp.feasibility.pictures import to_png
from symgrasp.object.profile import Profile
from symgrasp.reason import Reason
from symgrasp.robot.hand import HANDS

JAR = Profile([[0, 0.045], [0.1, 0.045], [0.12, 0.015], [0.2, 0.015]])


@pytest.mark.parametrize(
    ("name", "h", "reason"),
    [
        ("franka", 0.05, Reason.HAND_TOO_SMALL),  # 90 mm across
        ("pr2", 0.05, None),
        ("wsg50", 0.05, None),
        ("franka", 0.115, Reason.HAND_TOO_SMALL),  # the palm meets the shoulder
        ("franka", 0.119, Reason.SURFACE_TOO_STEEP),
        ("wsg50", 0.17, None),
        ("wsg50", 0.195, Reason.SURFACE_TOO_STEEP),  # over the end
        ("franka", 0.17, None),
    ],
)
def test_which_hand_fits_where(name, h, reason):
    assert fit(HANDS[name], JAR, h) == reason


def test_a_palm_without_room_is_a_hand_too_small():
    """At the neck the fingers reach around, but the wide body is in the way of a wider palm."""
    assert fit(HANDS["franka"], JAR, 0.135) is None
    wide = replace(HANDS["franka"], palm_width=0.09)
    assert fit(wide, JAR, 0.135) == Reason.HAND_TOO_SMALL
    assert fit(wide, JAR, 0.17) is None


def test_the_picture_shows_the_reasons_of_every_hand():
    figure = plot_openings(JAR, HANDS)
    wide, strips = figure.axes
    assert [label.get_text() for label in strips.get_xticklabels()] == list(HANDS)
    shown = np.asarray(strips.images[0].get_array())
    heights = np.linspace(0, 0.2, len(shown))
    for column, hand in enumerate(HANDS.values()):
        for row in range(0, len(shown), 7):
            reason = fit(hand, JAR, heights[row])
            assert shown[row, column] == (Reason.FEASIBLE if reason is None else reason)
    held = {line.get_label(): np.asarray(line.get_xdata()) for line in wide.lines}
    assert np.nanmax(held["wsg50 holds"]) == pytest.approx(100)
    assert np.nanmax(held["franka holds"]) == pytest.approx(40)
    assert matplotlib.image.imread(io.BytesIO(to_png(figure))).std() > 0.05
