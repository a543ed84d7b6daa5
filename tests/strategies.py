"""Random values for property tests."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from symgrasp.object.profile import Profile
from symgrasp.poses import from_position_quat

angles = st.floats(-10.0, 10.0)
unit = st.floats(-1.0, 1.0)


@st.composite
def poses(draw: st.DrawFn) -> np.ndarray:
    quat = np.array([draw(unit) for _ in range(4)])
    if np.linalg.norm(quat) < 1e-3:
        quat = np.array([1.0, 0.0, 0.0, 0.0])
    return from_position_quat([draw(unit) for _ in range(3)], quat)


@st.composite
def profiles(draw: st.DrawFn) -> Profile:
    steps = draw(st.lists(st.floats(0.005, 0.2), min_size=1, max_size=6))
    radii = draw(st.lists(st.floats(0.001, 0.1), min_size=len(steps) + 1, max_size=len(steps) + 1))
    heights = np.concatenate([[0.0], np.cumsum(steps)])
    return Profile(np.column_stack([heights, radii]))
