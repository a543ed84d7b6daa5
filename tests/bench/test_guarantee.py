"""What maps miss is counted, and apart where they say that it is proven: on maps that are made wrong."""

from dataclasses import replace

import numpy as np
import pytest

from symgrasp.bench.guarantee import REFUTED, _measured, _refuted, summary
from symgrasp.feasibility.create import create_map
from symgrasp.reason import Reason
from symgrasp.scene.scene import Scene


def small() -> Scene:
    return Scene.load("log_iiwa_and_panda").with_settings(heights=4, angles=8)


def test_a_map_of_all_of_the_redundancy_misses_nothing():
    scene = small()
    found = _measured(scene, next(iter(scene.tasks.values())), "panda")
    assert found.feasible > 0 and found.proven > 0
    assert (found.missed, found.missed_proven, found.refuted, found.refuted_proven) == (0, 0, 0, 0)
    assert "of the proven 0 of" in found.line()
    missed = replace(found, missed=3, random=True, ratio=2.5)
    shipped, random, *others = summary([found, missed, replace(missed, ratio=4.5)])
    assert "auto misses 0;" in shipped
    assert f"2 maps with {2 * found.feasible} feasible cells" in random
    assert "auto misses 6;" in random
    assert "median time × 3.50" in random
    assert not others


def test_cells_that_are_falsely_infeasible_are_refuted():
    pytest.importorskip("coal")
    scene = small()
    task = next(iter(scene.tasks.values()))
    m = create_map(scene.with_settings(redundancy="auto"), arm="panda")
    assert _refuted(scene, task, "panda", m)[::2] == (0, 0)
    reason = np.where(m.feasible, Reason.SCENE_COLLISION, Reason.HAND_TOO_SMALL).astype(np.uint8)
    wrong = replace(m, reason=reason, proven=np.zeros_like(m.proven))
    assert _refuted(scene, task, "panda", wrong) == (REFUTED, REFUTED, 0, 0)
    assert _refuted(scene, task, "panda", replace(wrong, proven=m.feasible)) == (0, 0, REFUTED, REFUTED)
