"""Where hands can hold an object."""

from __future__ import annotations

import numpy as np
import pytest

from app.render.holds import hand_holds
from app.state.state import State
from symgrasp.feasibility.fit import fit
from tests.conftest import load_small


@pytest.mark.parametrize("name", ["bottle_on_table", "log_iiwa_and_panda"])
def test_a_hand_holds_where_it_fits(name):
    state = State.of(load_small(name), "")
    profile = state.scene.profile
    hands = {arm.hand.name: arm.hand for arm in map(state.scene.arm, state.scene.task().arms)}
    found = hand_holds(state)
    assert [holds.hand for holds in found] == list(hands)
    assert len({holds.color for holds in found}) == len(found)
    for holds in found:
        ends = [end for span in holds.spans for end in span]
        for h in np.linspace(profile.h_min, profile.h_max, 63)[1:-1]:
            if min((abs(h - end) for end in ends), default=1.0) > 1e-3:
                held = any(low < h < high for low, high in holds.spans)
                assert held == (fit(hands[holds.hand], profile, float(h)) is None)
