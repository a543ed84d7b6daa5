"""The spans of the redundancy on which branches reach a pose, against the closed form at many values."""

import numpy as np
import pytest

from symgrasp.compiling import ENTRY, njit
from symgrasp.ik import CompiledIK, solver_for
from symgrasp.ik.at_phi import geometry_at, locked_joint
from symgrasp.ik.branches import branches_at, new_memory
from symgrasp.ik.spans import FINEST, find_spans, new_spans, prepare_spans
from symgrasp.scene.scene import Scene

ARMS = {
    "bottle_on_table": "panda",
    "log_iiwa_and_panda": "iiwa",
    "pr2_pour": "left",
    "talos_bottle": "talos_left",
    "tiago_dual_tray": "left",
}
VALUES = 700


@njit(**{**ENTRY, "cache": False})
def spans_of(spans, chain, locked, T):
    prepare_spans(spans, locked)
    find_spans(spans, chain, locked, T)


@njit(**{**ENTRY, "cache": False})
def reaches(chain, locked, T, phi, q, exists, inside, memory, found):
    for k in range(len(phi)):
        geometry_at(locked, phi[k], chain.geometry[0])
        branches_at(chain, 0, T, False, q, exists, inside, memory)
        for half in range(2):
            found[k, half] = exists[4 * half : 4 * half + 4].any()


@pytest.mark.parametrize("name", ARMS)
def test_branches_reach_poses_on_their_spans_and_nowhere_else(name):
    """But for a few short gaps."""
    arm = Scene.load(name).arm(ARMS[name])
    arm = arm.at(0) if arm.robot.torso else arm
    ik = solver_for(arm, 32)
    assert isinstance(ik, CompiledIK)
    locked = locked_joint(ik)
    assert locked is not None
    spans, memory = new_spans(locked), new_memory(arm.dof)
    chain = ik.chain._replace(geometry=ik.chain.geometry[:1].copy())
    q, exists, inside = np.empty((8, arm.dof)), np.empty(8, dtype=bool), np.empty(8, dtype=bool)
    phi, found = np.linspace(locked.lower, locked.upper, VALUES), np.empty((VALUES, 2), dtype=bool)
    rng, ends, gaps = np.random.default_rng(0), 0, 0
    lower, upper = np.maximum(arm.lower, -np.pi), np.minimum(arm.upper, np.pi)
    for k in range(150):
        T = arm.tool_pose(rng.uniform(lower, upper))
        if k % 2:  # most of these are reached on a part of the range only
            T[:3, 3] += rng.normal(0.0, 0.15, 3)
        spans_of(spans, chain, locked, T)
        reaches(chain, locked, T, phi, q, exists, inside, memory, found)
        for half in range(2):
            expected = np.zeros(VALUES, dtype=bool)
            beside = np.zeros(VALUES, dtype=bool)
            for low, high in spans.ends[half, : spans.number[half]]:
                expected |= (low <= phi) & (phi <= high)
                for end in (low, high):
                    beside |= np.abs(phi - end) <= 2 * FINEST
                    ends += locked.lower < end < locked.upper
            assert not (found[:, half] & ~expected)[~beside].any()
            gaps += np.count_nonzero((expected & ~found[:, half])[~beside])
    assert ends > 30
    assert gaps < 0.01 * 150 * 2 * VALUES


@pytest.mark.parametrize("bent", [0.0, 1e-9, 1e-6, 1e-4])
def test_poses_of_a_straight_elbow_are_reached_on_the_narrowest_spans(bent):
    """At a value on the span, also where the pose is rounded like those of maps."""
    arm = Scene.load("log_iiwa_and_panda").arm("iiwa")
    ik = solver_for(arm, 1)
    assert isinstance(ik, CompiledIK)
    locked = locked_joint(ik)
    assert locked is not None and ik.locked is not None
    spans, rng = new_spans(locked), np.random.default_rng(1)
    for _ in range(40):
        q = rng.uniform(arm.lower, arm.upper)
        q[3] = bent * rng.choice([-1.0, 1.0])
        T = arm.tool_pose(q)
        T[:3, 3] += rng.uniform(-3e-10, 3e-10, 3)
        spans_of(spans, ik.chain, locked, T)
        ends = [spans.ends[half, : spans.number[half]] for half in range(2)]
        off = [np.abs(own - q[ik.locked]).max(axis=1) for own in ends]
        half = int(np.argmin([min(own, default=np.inf) for own in off]))
        k = int(np.argmin(off[half]))
        assert off[half][k] < 3 * bent + 1e-3
        there = ik.at(spans.reached[half, k : k + 1]).solve(T)
        assert len(there.q)
        assert np.abs(arm.tool_pose(there.q)[:, :3, 3] - T[:3, 3]).max() < 2e-8


def test_of_arms_with_the_locked_joint_in_the_middle_no_spans_are_known():
    arm = Scene.load("log_two_gr3").arm("west_left")
    ik = solver_for(arm, 32)
    assert isinstance(ik, CompiledIK)
    locked = locked_joint(ik)
    assert locked is not None
    spans = new_spans(locked)
    spans_of(spans, ik.chain, locked, arm.tool_pose(arm.home))
    assert (spans.number == -1).all()
