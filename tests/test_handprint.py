from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from symgrasp.hand import HANDS
from symgrasp.handprint import handprint
from symgrasp.manifold import ROLLS, Manifold, grasp_to_tool
from symgrasp.profile import Profile
from tests.conftest import load_small

HAND = HANDS["franka"]
BOTTLE = Profile([[0, 0.0355], [0.19, 0.0375], [0.235, 0.0155], [0.3, 0.0145]])


def random_points_in(bodies, rng, count=4000):
    """Random points of the convex bodies: between three corners, out to the corners themselves."""
    points = []
    for vertices in bodies:
        corners = vertices[rng.integers(len(vertices), size=(count, 3))]
        points.append(np.einsum("nk,nkd->nd", rng.dirichlet([0.4, 0.4, 0.4], count), corners))
    return np.concatenate(points)


@given(st.integers(0, 19), st.integers(0, 1), st.integers(0, 23), st.integers(0, 2**32 - 1))
@settings(max_examples=25, deadline=None)
def test_no_point_of_the_hand_projects_outside_its_print(row, roll, column, seed):
    arm = load_small("bottle_on_table").arm()
    grid = Manifold(BOTTLE, 20, 24)
    radius = float(BOTTLE.radius(grid.h[row]))
    standoff = HAND.standoff(radius)
    bodies = arm.hand_bodies(HAND.opening(radius))
    print_ = handprint(bodies, grid, row, roll, standoff)
    tool = grasp_to_tool(np.eye(4), grid.h[row], grid.theta[column], ROLLS[roll], standoff)
    points = random_points_in(bodies, np.random.default_rng(seed)) @ tool[:3, :3].T + tool[:3, 3]
    h, theta = grid.project(points)
    rows = np.floor((h - BOTTLE.h_min) / grid.dh).astype(int) - print_.first_row
    columns = np.floor((theta - grid.theta_start) / grid.dtheta).astype(int) % grid.angles
    assert (rows >= 0).all()
    assert (rows < len(print_.cells)).all()
    assert np.roll(print_.cells, column, axis=1)[rows, columns].all()


def test_a_print_is_not_wasteful():
    """Nearly every covered cell holds a point of the hand."""
    arm = load_small("bottle_on_table").arm()
    grid = Manifold(BOTTLE, 20, 24)
    bodies = arm.hand_bodies(0.08)
    print_ = handprint(bodies, grid, 8, 0, 0.0)
    tool = grasp_to_tool(np.eye(4), grid.h[8], grid.theta[0], 0.0, 0.0)
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
    assert handprint([cube], grid, 4, 0, 0.0).cells.all()
    away = handprint([cube], grid, 4, 0, 0.05)
    assert 0 < away.cells.any(axis=0).sum() <= 2


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
