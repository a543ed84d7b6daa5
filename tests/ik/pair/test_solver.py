"""Arms of which two axes meet at one end: against random configurations, and brute force."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

from symgrasp.compiling import ENTRY, njit
from symgrasp.errors import UrdfError
from symgrasp.ik import CompiledIK, solver_for
from symgrasp.ik.branches import branch_count, branches_at, new_memory
from symgrasp.poses import pose_error
from symgrasp.robot.model import RobotModel
from symgrasp.robot.robot import Arm, Robot
from tests.conftest import load_small
from tests.ik.synthetic import distance, samples, synthetic

compiled_branches_at = njit(**ENTRY)(branches_at)

DATA = Path(__file__).parents[2] / "data"

ARMS = ("offset_arm", "offset_wrist", "skewed_shoulder", "five_crossings", "turned_pair", "wrist_on_offsets")


def from_urdf(name: str) -> Arm:
    """Return an arm of tests/data, with a hand that has no links."""
    model = RobotModel(DATA / f"{name}.urdf")
    hand = load_small("soda_can").arm().hand
    bare = replace(hand, links=(), touch_links=(), joints={})
    return Arm(name, Robot(name, model, np.eye(4), model.default_values()), "flange", bare)


@pytest.fixture(scope="module")
def arms() -> dict[str, Arm]:
    x, y, z = np.eye(3)
    return {
        "offset_arm": from_urdf("offset_arm"),
        "offset_wrist": from_urdf("offset_wrist"),
        # A humanoid's: no two axes of the shoulder meet, one of the wrist is off as well.
        "skewed_shoulder": synthetic(
            [y + 0.28 * z, x, z, y, x, y, z],
            [[0, 0.1, 0.25], [0, 0.04, 0], [0, 0.006, -0.1], [0.016, 0, -0.08], [0.1, 0.002, -0.01],
             [0.038, 0, 0], [0.046, 0, 0], [0.05, 0, 0]],
        ),
        # Each axis meets the next, but no three meet in a point.
        "five_crossings": synthetic(
            [-z, y, -z, y, -z, y, -z],
            [[0, 0, 0.16], [0, -0.005, 0.13], [0, -0.006, 0.21], [0, -0.006, 0.21], [0, -0.006, 0.21],
             [0, -0.003, 0.11], [0, -0.003, 0.11], [0, 0, 0.06]],
        ),
        # Axes 1 and 3, and 5 and 7, are in a plane whatever the joint between them does; no others meet.
        "turned_pair": synthetic(
            [y + 0.84 * z, x, z, y, z, x, z],
            [[0, 0.13, 0.24], [0, 0.128, 0.1075], [0, 0.035, 0], [0.015, 0, -0.31], [-0.015, 0, 0],
             [0, -0.013, -0.25], [0, 0.013, -0.03], [0, 0, -0.1]],
        ),
        # A wrist whose three axes meet on an arm whose first axes do not: the third family of six joints.
        "wrist_on_offsets": synthetic(
            [z, y, y, x, y, x],
            [[0, 0, 0.4], [0.15, 0.02, 0], [0, 0, 0.6], [0.1, 0, 0.1], [0.55, 0, 0], [0, 0, 0], [0.1, 0, 0]],
        ),
    }  # fmt: skip


@pytest.mark.parametrize("name", ARMS)
def test_recall(name, arms):
    """The configurations at q's own locked value contain q."""
    arm = arms[name]
    solver = CompiledIK(arm, 16)
    assert not solver.complete
    gaps = []
    for k, q in enumerate(samples(arm, 1500, 0)):
        sample = k % len(solver.phi)
        if solver.locked is not None:
            q[solver.locked] = solver.phi[sample]
        gaps.append(distance(solver.solve_sample(arm.tool_pose(q), sample).q, q).min(initial=np.inf))
    assert np.count_nonzero(np.array(gaps) > 1e-5) <= 1


@pytest.mark.parametrize("name", ARMS)
def test_every_solution_reaches_the_pose(name, arms):
    arm = arms[name]
    solver = CompiledIK(arm, 4)
    poses = arm.tool_pose(samples(arm, 100, 1))
    found = [solver.solve(T) for T in poses]
    q, inside = np.concatenate([s.q for s in found]), np.concatenate([s.inside for s in found])
    assert len(q) > 300
    position, rotation = pose_error(arm.tool_pose(q), np.repeat(poses, [len(s.q) for s in found], axis=0))
    assert position.max() < 2e-9
    assert rotation.max() < 2e-9
    np.testing.assert_array_equal(((q >= arm.lower) & (q <= arm.upper)).all(axis=-1), inside)


@pytest.mark.parametrize("name", ARMS)
def test_an_answer_does_not_depend_on_what_else_is_asked(name, arms):
    arm = arms[name]
    solver = CompiledIK(arm, 3)
    poses = arm.tool_pose(samples(arm, 20, 2))
    every = [solver.solve(T) for T in poses]
    for k in np.random.default_rng(3).permutation(len(poses)):
        for sample in range(len(solver.phi)):
            part, own = solver.solve_sample(poses[k], sample), every[k].sample == sample
            np.testing.assert_array_equal(part.q, every[k].q[own])
            np.testing.assert_array_equal(part.branch, every[k].branch[own])


@pytest.mark.parametrize("name", ARMS)
def test_an_answer_does_not_depend_on_what_is_left_out(name, arms):
    """What is outside the limits is left out early; what remains is the same, bit for bit."""
    arm = arms[name]
    solver = CompiledIK(arm, 1)
    shape = (branch_count(solver.chain), arm.dof)
    some = 0
    for T in arm.tool_pose(samples(arm, 150, 5)):
        answers = []
        for inside_only in (False, True):
            q, exists, inside = (
                np.empty(shape),
                np.empty(shape[0], dtype=bool),
                np.empty(shape[0], dtype=bool),
            )
            compiled_branches_at(solver.chain, 0, T, inside_only, q, exists, inside, new_memory(arm.dof))
            answers.append((q[inside], inside))
        np.testing.assert_array_equal(answers[0][1], answers[1][1])
        np.testing.assert_array_equal(answers[0][0], answers[1][0])
        some += len(answers[0][0])
    assert some > 20


@pytest.mark.parametrize("name", ARMS)
def test_out_of_reach(name, arms):
    """A pose further away than the arm is long is known to be out of reach, and no other is called so."""
    arm = arms[name]
    solver = CompiledIK(arm, 1)
    shape, length = (branch_count(solver.chain), arm.dof), np.linalg.norm(arm.P, axis=1).sum()
    q, exists, inside = np.empty(shape), np.empty(shape[0], dtype=bool), np.empty(shape[0], dtype=bool)
    for row, T in zip(samples(arm, 50, 6), arm.tool_pose(samples(arm, 50, 6)), strict=True):
        at = solver if solver.locked is None else solver.at(row[[solver.locked]])
        assert compiled_branches_at(at.chain, 0, T, True, q, exists, inside, new_memory(arm.dof))
        T[:3, 3] *= 100.0 * length / np.linalg.norm(T[:3, 3])  # the two axes may meet far from the arm
        assert not compiled_branches_at(at.chain, 0, T, True, q, exists, inside, new_memory(arm.dof))


def by_brute_force(arm: Arm, T: np.ndarray, starts: int, seed: int) -> list[np.ndarray]:
    """Return the configurations of a 6-joint arm that many starts of a least-squares solver end at."""

    def error(q: np.ndarray) -> np.ndarray:
        reached = arm.tool_pose(q)
        return np.concatenate([reached[:3, 3] - T[:3, 3], (reached[:3, :3] - T[:3, :3]).ravel()])

    ends: list[np.ndarray] = []
    for start in np.random.default_rng(seed).uniform(-np.pi, np.pi, (starts, 6)):
        end = least_squares(error, start, method="lm", xtol=1e-14, ftol=1e-14, max_nfev=200)
        if end.cost < 1e-18 and distance(np.reshape(ends, (-1, 6)), end.x).min(initial=np.inf) > 1e-4:
            ends.append(end.x)
    return ends


@pytest.mark.parametrize("name", ["offset_wrist", "wrist_on_offsets"])
def test_all_that_brute_force_finds(name, arms):
    arm, total = arms[name], 0
    solver = CompiledIK(arm, 1)
    for k, T in enumerate(arm.tool_pose(samples(arm, 2, 4))):
        found, expected = solver.solve(T).q, by_brute_force(arm, T, 120, k)
        assert all(distance(found, q).min(initial=np.inf) < 1e-5 for q in expected)
        total += len(expected)
    assert total > 8


unit = st.floats(-1.0, 1.0)
vector = st.tuples(unit, unit, unit).map(np.array).filter(lambda v: np.linalg.norm(v) > 0.3)


@st.composite
def pair_arms(draw: st.DrawFn) -> Arm:
    """Any six joints of which the last two meet, some before them too or parallel, either way round."""
    H = [draw(vector) for _ in range(6)]
    P = [0.4 * draw(vector) for _ in range(7)]
    P[5] = draw(unit) * H[4] + draw(unit) * H[5]
    for j in (0, 1, 2):
        how = draw(st.sampled_from(("skew", "meet", "parallel")))
        if how == "parallel":
            H[j + 1] = H[j]
        elif how == "meet":
            P[j + 1] = 0.3 * (draw(unit) * H[j] + draw(unit) * H[j + 1])
    if draw(st.booleans()):
        H, P = [-h for h in H[::-1]], [-p for p in P[::-1]]
    return synthetic(H, P)


@settings(max_examples=300, deadline=None)
@given(pair_arms(), st.integers(0, 1000))
def test_any_arm(arm, seed):
    """Whatever else its axes do: a random configuration is found, where it is not near a singular one."""
    q = samples(arm, 1, seed)[0]
    assume(least_singular_value(arm, q) > 1e-3)
    try:
        solver = solver_for(arm, 1)
    except UrdfError:  # two joints in a row have one axis, or the like
        assume(False)
    assert distance(solver.solve(arm.tool_pose(q)).q, q).min(initial=np.inf) < 1e-5


def along_axes(rng: np.random.Generator) -> Arm:
    """Return six joints of which the last two meet, along the axes of the base or half way between them, with
    offsets of a few lengths, as in drawings; either way round."""
    ways = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 0], [0, 1, 1], [1, 1, 1]], float)
    lengths = np.array([0.0, 0.0, 0.0, 0.0, 0.1, 0.25, -0.3, 0.4, -0.4])
    H = [ways[rng.integers(7)] * rng.choice([1.0, 1.0, -1.0]) for _ in range(6)]
    P = [rng.choice(lengths, 3) for _ in range(7)]
    P[5] = rng.choice([0.0, 0.3]) * H[4] + rng.choice([0.0, 0.3]) * H[5]
    if rng.random() < 0.3:
        H, P = [-h for h in H[::-1]], [-p for p in P[::-1]]
    return synthetic(H, P)


def test_any_arm_along_axes():
    """In such arms equations often vanish that in others do not, whatever the pose."""
    rng, tried = np.random.default_rng(0), 0
    while tried < 4000:
        arm = along_axes(rng)
        try:
            solver = solver_for(arm, 1)
        except UrdfError:
            continue
        for q in samples(arm, 10, int(rng.integers(1000))):
            if least_singular_value(arm, q) > 3e-3:
                assert distance(solver.solve(arm.tool_pose(q)).q, q).min(initial=np.inf) < 1e-5
                tried += 1


@pytest.mark.parametrize(
    ("H", "P"),
    [
        (
            ["z", "x", "z", "z", "xyz", "-y"],
            [(0, -4, 1), (0, -4, 2.5), (0, -4, 1), (1, 0, 0), (2.5, 0, 1), (0, 0, 0), (0, -3, 0)],
        ),
        (
            ["x", "z", "-y", "y", "xyz", "-z"],
            [(0, 0, 0), (0, 4, -4), (4, -3, 4), (-4, 0, 4), (1, -4, 0), (0, 0, 0), (0, 0, 0)],
        ),
        (  # and here neither the first nor the fourth
            ["z", "y", "z", "x", "y", "xyz"],
            [(0, 4, 1), (-4, 0, 0), (4, 0, 0), (1, 1, 0), (1, 0, 0), (0, 0, 0), (0, 0, -4)],
        ),
        (
            ["z", "x", "y", "-y", "x", "z"],
            [(4, -4, 4), (0, -4, -3), (0, 0, 4), (0, -3, 1), (-4, 1, 4), (3, 0, 3), (0, 0, -4)],
        ),
    ],
)
def test_an_inner_joint_that_moves_the_point_along_no_coordinate(H, P):
    """The first joint changes both coordinates of the point, but not what is computed from both of them."""
    ways = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1), "xyz": (-0.55, 0.65, -0.52)}
    axes = [(-1.0 if "-" in name else 1.0) * np.array(ways[name.strip("-")], float) for name in H]
    arm = synthetic(axes, [0.1 * np.array(p, float) for p in P])
    solver = solver_for(arm, 1)
    for q in samples(arm, 200, seed=3):
        if least_singular_value(arm, q) > 3e-3:
            assert distance(solver.solve(arm.tool_pose(q)).q, q).min(initial=np.inf) < 1e-5


@pytest.mark.parametrize("angle", [1e-6, 4e-6, 2e-5, 1e-4, 1e-3, 1e-2, 3e-2])
@pytest.mark.parametrize("skew", [True, False], ids=["skew", "in a plane"])
def test_axes_that_are_nearly_parallel(angle, skew):
    """As where a URDF has 1.5708 for a right angle: the feet of their common normal are kilometres away."""
    rng = np.random.default_rng(5)
    for k in range(12):
        H, P = list(rng.normal(size=(6, 3))), list(0.3 * rng.normal(size=(7, 3)))
        P[5] = 0.1 * H[4] - 0.2 * H[5]
        h = H[1] / np.linalg.norm(H[1])
        side = np.cross(h, P[2])
        H[2] = h + angle * (side if skew else np.cross(side, h)) / np.linalg.norm(side)
        if k % 2:
            H, P = [-h for h in H[::-1]], [-p for p in P[::-1]]
        arm = synthetic(H, P)
        solver = solver_for(arm, 1)
        for q in samples(arm, 10, k):
            if least_singular_value(arm, q) > 3e-3:
                assert distance(solver.solve(arm.tool_pose(q)).q, q).min(initial=np.inf) < 1e-5


def test_double_zeros_that_are_close_to_each_other():
    """Joints 3 and 4 also do half a turn the other way: all zeros are double, and N is faint between them."""
    z, y = [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]
    P = [[0, 0, 0.4], [0, 0, 0.4], [0, 0.4, 0], [0, 0, 0.4], [0, 0, 0.4], [0, 0, 0], [0, 0, 0.4]]
    arm = synthetic([z, y, z, y, y, z], P)
    solver = solver_for(arm, 1)
    for q in samples(arm, 200, seed=0):
        found = solver.solve(arm.tool_pose(q)).q
        assert distance(found, q).min() < 1e-5
        twice = q + np.array([0.0, 0.0, np.pi, 0.0, 0.0, np.pi])
        twice[[3, 4]] *= -1.0
        assert distance(found, twice).min() < 1e-5


def test_a_point_on_an_axis_at_one_of_the_values_of_the_outer_joint():
    """There N cannot be computed, and from a wrong value no zero can be found."""
    z, y = [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]
    P = [[0, 0, 0.4], [0, 0.4, 0], [0, 0, 0.4], [0, 0, 0], [0.4, 0, 0.4], [0, 0, 0], [0, 0, 0.4]]
    arm = synthetic([z, z, [1.0, 0.0, 1.0], z, y, z], P)
    for q in samples(arm, 20, seed=1):
        found = solver_for(arm, 1).solve(arm.tool_pose(q)).q
        assert distance(found, q).min(initial=np.inf) < 1e-5


def least_singular_value(arm: Arm, q: np.ndarray) -> float:
    """Return that of the Jacobian, by differences."""
    step = 1e-6
    T = arm.tool_pose(q)
    moved = arm.tool_pose(q + step * np.eye(len(q)))
    turn = moved[:, :3, :3] @ T[:3, :3].T / step
    twist = np.stack([turn[:, 2, 1], turn[:, 0, 2], turn[:, 1, 0]], axis=1)
    J = np.hstack([(moved[:, :3, 3] - T[:3, 3]) / step, twist])
    return float(np.linalg.svd(J, compute_uv=False)[-1])
