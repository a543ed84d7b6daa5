"""Boxes spare PyBullet questions and change no answer."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from symgrasp.references import resolve
from symgrasp.robot.model import RobotModel
from symgrasp.world import self_pairs

ROBOTS = ("package://pybullet_data/franka_panda/panda.urdf", "../data/two_arms.urdf")


@pytest.mark.parametrize("reference", ROBOTS)
def test_the_pairs_are_those_without_boxes(reference, monkeypatch):
    path = resolve(reference, Path(__file__).parent)
    assert path
    model = RobotModel(path)
    monkeypatch.setattr(self_pairs, "SELF_SAMPLES", 300)
    found = self_pairs._sampled_pairs(model).tolist()
    shares = []

    def everything(model, pairs, samples):
        shares.append(boxes(model, pairs, samples).mean())
        return np.ones((len(samples), len(pairs)), dtype=bool)

    boxes = self_pairs._boxes_close
    monkeypatch.setattr(self_pairs, "_boxes_close", everything)
    assert self_pairs._sampled_pairs(model).tolist() == found
    assert len(found) > 10
    assert shares[0] < 0.5
