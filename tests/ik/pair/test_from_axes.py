import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from symgrasp.bench.arms.ik import bare_arm
from symgrasp.ik import CompiledIK
from symgrasp.ik.families import free_joints
from symgrasp.ik.pair.from_axes import pair_geometry
from symgrasp.ik.pair.geometry import MEETING_PAIR, SPECIAL, WRIST_POINT
from symgrasp.robot.catalogue import CATALOGUE
from tests.ik.pair.reference import reference_row


@given(
    seed=st.integers(0, 2**32 - 1),
    kind=st.sampled_from(["general", "meeting", "parallel", "parallel, almost", "nearly parallel", "same"]),
    first=st.sampled_from(["anywhere", "along the second"]),
)
def test_the_geometry_of_random_axes_is_that_of_the_reference(seed, kind, first):
    random = np.random.default_rng(seed)
    h, o = random.normal(size=(6, 3)), random.uniform(-0.5, 0.5, (6, 3))
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    if kind == "meeting":
        o[2] = o[1] + 0.3 * h[1] - 0.2 * h[2]
    elif kind != "general":
        angle = {"parallel, almost": 0.1 * SPECIAL, "nearly parallel": 10.0 ** random.uniform(-5.0, -2.0)}
        h[2] = h[1] + angle.get(kind, 0.0) * np.cross(h[1], h[0])
        h[2] /= np.linalg.norm(h[2])
        if kind == "same":
            o[2] = o[1] + 0.3 * h[1]
    if first != "anywhere":  # then joint 1 tells little, and joint 4 is the outer one
        h[0], o[0] = h[1], o[1] + 0.2 * h[1]
    W, R0, p0 = o[4] + 0.1 * h[4], np.linalg.qr(random.normal(size=(3, 3)))[0], random.normal(size=3)
    ways = (1.0, -1.0) if kind == "meeting" else (1.0,)
    rows = [reference_row(h, o, R0, p0, W, 0.5, way) for way in ways]
    found = pair_geometry(False, h, o, R0, p0, W, 0.5)
    assert (found is None) == (rows[0] is None) == (kind == "same")
    if found is not None:
        near = [row is not None and np.allclose(found.row, row, rtol=1e-7, atol=1e-10) for row in rows]
        assert any(near)


@pytest.mark.parametrize("name", ["baxter", "alex", "tiago_pro", "gen3", "vega"])
def test_the_geometry_of_arms_is_that_of_the_reference(name):
    robot = next(robot for robot in CATALOGUE if robot.name == name)
    arm = bare_arm(robot, robot.arms[0])
    ik = CompiledIK(arm, 8)
    assert ik.chain.joint[8] == MEETING_PAIR
    for phi, row in zip(ik.phi, ik.chain.geometry, strict=True):
        joints = free_joints(arm, ik.locked, float(phi), bool(ik.chain.joint[7]))
        expected = reference_row(*joints[1:5], row[WRIST_POINT : WRIST_POINT + 3], phi)
        assert expected is not None
        assert np.allclose(row, expected, rtol=1e-9, atol=1e-12)
