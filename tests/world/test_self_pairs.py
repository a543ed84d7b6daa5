"""Boxes spare PyBullet questions and change no answer."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from symgrasp.references import resolve
from symgrasp.robot.model import RobotModel
from symgrasp.world import checked_self_pairs, self_pairs

ROBOTS = ("package://pybullet_data/franka_panda/panda.urdf", "../data/two_arms.urdf")


@pytest.mark.parametrize("reference", ROBOTS)
def test_the_pairs_are_those_without_boxes(reference, monkeypatch):
    path = resolve(reference, Path(__file__).parent)
    assert path
    model = RobotModel(path)
    monkeypatch.setattr(self_pairs, "SELF_SAMPLES", 300)
    found = checked_self_pairs.__wrapped__(model)
    shares = []

    def everything(model, links, pairs, samples):
        shares.append(boxes(model, links, pairs, samples).mean())
        return np.ones((len(samples), len(pairs)), dtype=bool)

    boxes = self_pairs._boxes_close
    monkeypatch.setattr(self_pairs, "_boxes_close", everything)
    assert checked_self_pairs.__wrapped__(model) == found
    assert len(found) > 10
    assert shares[0] < 0.5
