from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np
import pybullet
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from symgrasp.object.manifold import ROLLS, Manifold, grasp_to_tool
from symgrasp.object.profile import Profile
from symgrasp.poses import Array
from symgrasp.robot.hand import HANDS
from symgrasp.robot.handprint import Handprint, handprint
from tests.conftest import load_small
from tests.robot.hands import arms_with_hands, random_points_in
from tests.strategies import profiles

HAND = HANDS["franka"]
BOTTLE = Profile([[0, 0.0355], [0.19, 0.0375], [0.235, 0.0155], [0.3, 0.0145]])

hands = st.sampled_from(sorted(HANDS))


@given(hands, st.integers(0, 19), st.integers(0, 1), st.integers(0, 23), st.integers(0, 2**32 - 1))
@settings(max_examples=40, deadline=None)
def test_no_point_of_the_hand_projects_outside_its_print(name, row, roll, column, seed):
    arm = arms_with_hands()[name]
    grid = Manifold(BOTTLE, 20, 24)
    radius = float(BOTTLE.radius(grid.h[row]))
    standoff = arm.hand.standoff(radius)
    bodies = arm.hand_hulls(arm.hand.opening(radius))
    print_ = arm.handprint(grid, row, roll)
    tool = grasp_to_tool(np.eye(4), grid.h[row], grid.theta[column], ROLLS[roll], standoff)
    points = random_points_in(bodies, np.random.default_rng(seed)) @ tool[:3, :3].T + tool[:3, 3]
    h, theta = grid.project(points)
    rows = np.floor((h - BOTTLE.h_min) / grid.dh).astype(int) - print_.first_row
    columns = np.floor((theta - grid.theta_start) / grid.dtheta).astype(int) % grid.angles
    assert (rows >= 0).all()
    assert (rows < len(print_.cells)).all()
    assert np.roll(print_.cells, column, axis=1)[rows, columns].all()


@pytest.mark.parametrize("name", sorted(HANDS))
def test_a_print_is_not_wasteful(name):
    """Nearly every covered cell holds a point of the hand."""
    arm = arms_with_hands()[name]
    grid = Manifold(BOTTLE, 20, 24)
    standoff = 0.01  # no body of any of the hands holds the axis, which would cover a whole row
    bodies = arm.hand_hulls(0.08)
    print_ = handprint(bodies, grid, grasp_to_tool(np.eye(4), grid.h[8], 0.0, 0.0, standoff))
    tool = grasp_to_tool(np.eye(4), grid.h[8], grid.theta[0], 0.0, standoff)
    points = random_points_in(bodies, np.random.default_rng(0), 200_000) @ tool[:3, :3].T + tool[:3, 3]
    h, theta = grid.project(points)
    hit = np.zeros_like(print_.cells)
    rows = np.floor((h - BOTTLE.h_min) / grid.dh).astype(int) - print_.first_row
    hit[rows, np.floor((theta - grid.theta_start) / grid.dtheta).astype(int) % grid.angles] = True
    assert (hit & ~print_.cells).sum() == 0
    assert hit.sum() / print_.cells.sum() > 0.85


def test_a_body_on_the_axis_covers_every_angle():
    grid = Manifold(BOTTLE, 10, 12)
    cube = 0.01 * np.array(list(np.ndindex(2, 2, 2))) - 0.005
    assert handprint([cube], grid, grasp_to_tool(np.eye(4), grid.h[4], 0.0, 0.0, 0.0)).cells.all()
    away = handprint([cube], grid, grasp_to_tool(np.eye(4), grid.h[4], 0.0, 0.0, 0.05))
    assert 0 < away.cells.any(axis=0).sum() <= 2


def test_a_body_that_only_touches_the_axis_covers_every_angle_there():
    """Four points with one on the axis: another body may touch that one from any direction."""
    grid = Manifold(BOTTLE, 10, 12)
    tip = np.array([[0, 0, 0], [0.001, 0, -0.01], [-0.001, 0, -0.01], [0, 0.001, -0.01]])
    tool = grasp_to_tool(np.eye(4), grid.h[4], 0.0, 0.0, 0.0)
    assert np.allclose((tip @ tool[:3, :3].T)[0, :2], 0.0)
    assert handprint([tip], grid, grasp_to_tool(np.eye(4), grid.h[4], 0.0, 0.0, 0.0)).cells.all()


def test_a_body_beyond_the_axis_covers_the_far_side():
    """Where it is, as seen from the axis: opposite of the column that the hand grasps at."""
    grid = Manifold(BOTTLE, 10, 12)
    cube = 0.01 * np.array(list(np.ndindex(2, 2, 2))) - 0.005
    print_ = handprint(
        [cube + np.array([0, 0, 0.05])], grid, grasp_to_tool(np.eye(4), grid.h[4], 0.0, 0.0, 0.0)
    )
    assert np.unique(np.argwhere(print_.cells)[:, 1]).tolist() == [6]


coordinates = st.floats(-0.1, 0.1)
triples = st.tuples(coordinates, coordinates, coordinates)
clouds = st.lists(triples, min_size=4, max_size=8).map(np.array)


@given(
    clouds,
    clouds,
    st.one_of(st.tuples(coordinates, st.just(0.0), st.just(0.0)), triples),
    st.lists(st.floats(0.05, 1.0), min_size=16, max_size=16),
    profiles(),
    st.integers(1, 40),
    st.integers(1, 72),
)
@settings(max_examples=200, deadline=None)
def test_bodies_that_share_a_point_have_prints_that_share_a_cell(a, b, point, weights, profile, rows, angles):
    """The theorem's other reading, with a common point on the axis in half of the cases."""

    def around(cloud: Array, share: list[float]) -> Array:
        """Move a body, so that a point well inside it comes to lie on the common one."""
        w = np.array(share[: len(cloud)])
        return cloud - (w / w.sum()) @ cloud + point

    first, second = around(a, weights[:8]), around(b, weights[8:])
    if min(np.linalg.matrix_rank(c - c.mean(axis=0), tol=1e-4) for c in (first, second)) < 3:
        return
    grid = Manifold(profile, rows, angles)
    row = rows // 2
    one, other = (
        handprint([body], grid, grasp_to_tool(np.eye(4), grid.h[row], 0.0, 0.0, 0.0))
        for body in (first, second)
    )
    assert one.overlap(other, 0) > 0


def test_overlap_counts_shared_cells_like_a_plain_loop():
    arm = load_small("log_two_robots").arm()
    grid = load_small("log_two_robots").manifold
    a, b = arm.handprint(grid, 2, 0), arm.handprint(grid, 3, 1)
    for columns in range(-5, 6):
        cells_a = {(r + a.first_row, c) for r, c in np.argwhere(a.cells)}
        cells_b = {(r + b.first_row, (c + columns) % grid.angles) for r, c in np.argwhere(b.cells)}
        assert a.overlap(b, columns) == len(cells_a & cells_b)
        assert b.overlap(a, -columns) == len(cells_a & cells_b)


def test_print_on_the_object_is_the_print_without_what_reaches_past_it():
    arm = load_small("bottle_on_table").arm()
    grid = Manifold(BOTTLE, 20, 24)
    print_ = arm.handprint(grid, 0, 0)
    assert print_.first_row < 0
    on = print_.on(grid, 5)
    assert on.shape == (20, 24)
    assert on.sum() == print_.cells[-print_.first_row :].sum()
    assert on[0, 5]


# -- brute force --------------------------------------------------------------------------------


class Placed(NamedTuple):
    """A hand on an object at column 0: its print, and its bodies in PyBullet."""

    print: Handprint
    bodies: list[int]


class Bodies:
    """Hands as rigid bodies in a PyBullet client, in the object frame."""

    def __init__(self) -> None:
        self.client = pybullet.connect(pybullet.DIRECT)

    def place(self, name: str, grid: Manifold, row: int, roll: int) -> Placed:
        arm = arms_with_hands()[name]
        radius = float(grid.profile.radius(grid.h[row]))
        tool = grasp_to_tool(np.eye(4), grid.h[row], 0.0, ROLLS[roll], arm.hand.standoff(radius))
        hulls = arm.hand_hulls(arm.hand.opening(radius))
        bodies = [self._body(points @ tool[:3, :3].T + tool[:3, 3]) for points in hulls]
        return Placed(arm.handprint(grid, row, roll), bodies)

    def _body(self, points: Array) -> int:
        shape = pybullet.createCollisionShape(
            pybullet.GEOM_MESH, vertices=points.tolist(), physicsClientId=self.client
        )
        body = pybullet.createMultiBody(0.0, shape, physicsClientId=self.client)
        pybullet.changeDynamics(body, -1, collisionMargin=0.0, physicsClientId=self.client)
        return body

    def touch(self, a: Placed, b: Placed, angle: float) -> bool:
        """Whether two hands touch when the second is turned about the axis."""
        turned = [0.0, 0.0, np.sin(angle / 2), np.cos(angle / 2)]
        for body in b.bodies:
            pybullet.resetBasePositionAndOrientation(body, [0, 0, 0], turned, physicsClientId=self.client)
        points = (
            point
            for x, y in product(a.bodies, b.bodies)
            for point in pybullet.getClosestPoints(x, y, 0.0, physicsClientId=self.client) or ()
        )
        return any(point[8] < -1e-7 for point in points)


def random_object(rng: np.random.Generator) -> Profile:
    count = int(rng.integers(2, 7))
    heights = np.cumsum(rng.uniform(0.02, 0.25, count))
    return Profile(np.column_stack([heights - heights[0], rng.uniform(0.002, 0.05, count)]))


def random_hands(rng: np.random.Generator, bodies: Bodies, grid: Manifold, count: int) -> list[Placed]:
    """Hands near each other along the axis, so that many pairs nearly touch."""
    middle = int(rng.integers(grid.heights))
    reach = max(1, round(0.15 / grid.dh))
    rows = np.clip(rng.integers(middle - reach, middle + reach + 1, count), 0, grid.heights - 1)
    names = rng.choice(sorted(HANDS), count)
    return [
        bodies.place(str(n), grid, int(r), int(rng.integers(2))) for n, r in zip(names, rows, strict=True)
    ]


def test_hands_with_disjoint_prints_never_touch():
    """Thousands of pairs on random objects, among them the closest that the prints allow.

    Run with ``-s`` to see what share of the pairs is free although the prints overlap.
    """
    rng = np.random.default_rng(7)
    bodies = Bodies()
    disjoint = overlapping = free = 0
    for _ in range(100):
        angles = int(rng.integers(16, 73))
        profile = random_object(rng)
        length = profile.h_max - profile.h_min
        grid = Manifold(profile, max(1, round(length / rng.uniform(0.005, 0.03))), angles)
        placed = random_hands(rng, bodies, grid, 5)
        for a, b in ((a, b) for k, a in enumerate(placed) for b in placed[:k]):
            apart = np.array([a.print.overlap(b.print, c) == 0 for c in range(angles)])
            tight = apart & ~(np.roll(apart, 1) & np.roll(apart, -1))
            columns = rng.integers(angles, size=12).tolist()
            for column in {*columns, *np.flatnonzero(tight).tolist()}:
                touching = bodies.touch(a, b, column * grid.dtheta)
                assert not (apart[column] and touching)
                disjoint += bool(apart[column])
                if column in columns and not apart[column]:
                    overlapping += 1
                    free += not touching
    pybullet.disconnect(bodies.client)
    print(
        f"\n{disjoint} disjoint pairs, none touches; "
        f"of {overlapping} random pairs whose prints overlap, {100 * free / overlapping:.1f} % are free in 3D"
    )
    assert disjoint > 5000
    assert overlapping > 4000
    assert overlapping - free > 3000
