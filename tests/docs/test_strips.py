"""Strips show what motions do."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from docs import strips
from tests.motion.recorded import recorded_plan


def test_a_strip_has_a_picture_of_every_part_of_the_motion(monkeypatch):
    monkeypatch.setattr(strips, "SIZE", (80, 60))
    monkeypatch.setattr("docs.figures.render.SAMPLES", 1)
    sheet = np.asarray(strips.strip(recorded_plan())).astype(int)
    assert sheet.shape == (120, 320, 3)
    pictures = [sheet[60 * r : 60 * (r + 1), 80 * c : 80 * (c + 1)][15:] for r in range(2) for c in range(4)]
    for one, two in pairwise(pictures):
        assert (np.abs(one - two).max(axis=2) > 40).any()
    with pytest.raises(SystemExit, match="no motion"):
        strips.strip(recorded_plan().model_copy(update={"motion": None}))
