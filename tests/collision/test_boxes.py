from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from symgrasp.collision.boxes import oriented_boxes_gap
from symgrasp.collision.distance import distance_bounds
from symgrasp.collision.pieces import Piece, pack, pose_rows
from symgrasp.poses import from_rotation

SEEDS = st.integers(0, 10_000)
CORNERS = np.array(list(np.ndindex(2, 2, 2))) - 0.5


@given(SEEDS)
def test_the_gap_is_that_of_the_boxes_along_its_direction(seed):
    """By the corners themselves; no face of either box has a larger gap in front of it."""
    rng = np.random.default_rng(seed)
    boxes = [CORNERS * rng.uniform(0.05, 1.0, 3) + rng.normal(scale=0.2, size=3) for _ in range(2)]
    rounding = rng.uniform(0.0, 0.05)
    packed = pack([Piece(boxes[0], rounding), Piece(boxes[1])])
    poses = [from_rotation(Rotation.random(rng=rng).as_matrix()) for _ in range(2)]
    poses[1][:3, 3] = rng.normal(scale=0.7, size=3)
    a, b = (box @ T[:3, :3].T + T[:3, 3] for box, T in zip(boxes, poses, strict=True))

    gap, direction = oriented_boxes_gap(packed.size, pose_rows(np.array(poses)), 0, 1, np.inf)

    def along(n: np.ndarray) -> float:
        return float((a @ n).min() - (b @ n).max() - rounding)

    assert gap == pytest.approx(along(np.array(direction)), abs=1e-12)
    faces = [sign * T[:3, i] for T in poses for i in range(3) for sign in (1.0, -1.0)]
    assert gap == pytest.approx(max(map(along, faces)), abs=1e-12)


@given(SEEDS)
def test_it_stops_at_a_gap_that_is_enough(seed):
    rng = np.random.default_rng(seed)
    packed = pack([Piece(CORNERS * rng.uniform(0.1, 1.0, 3)) for _ in range(2)])
    poses = np.array([from_rotation(Rotation.random(rng=rng).as_matrix()) for _ in range(2)])
    poses[1, :3, 3] = rng.normal(size=3)
    best, _ = oriented_boxes_gap(packed.size, pose_rows(poses), 0, 1, np.inf)
    some, _ = oriented_boxes_gap(packed.size, pose_rows(poses), 0, 1, best - 0.1)
    assert best - 0.1 <= some <= best


@given(SEEDS)
def test_bounds_hold_whether_or_not_boxes_tell(seed):
    """The distance of two balls, one of them inside a longer box, is known."""
    rng = np.random.default_rng(seed)
    radius = rng.uniform(0.05, 0.3, 2)
    ends = np.array([[-0.5, 0.0, 0.0], [0.5, 0.0, 0.0]])
    packed = pack([Piece(ends, radius[0]), Piece(np.zeros((1, 3)), radius[1])])
    poses = np.array([from_rotation(Rotation.random(rng=rng).as_matrix()) for _ in range(2)])
    poses[1, :3, 3] = rng.normal(scale=0.8, size=3)
    x = poses[0, :3, 0]
    at = poses[1, :3, 3]
    distance = np.linalg.norm(at - x * np.clip(at @ x, -0.5, 0.5)) - radius.sum()
    for enough in (0.0, 0.1, np.inf):
        lower, upper = distance_bounds(
            packed, pose_rows(poses), 0, 1, enough, np.inf, -np.inf, np.empty((4, 3))
        )
        assert lower <= distance + 1e-9
        assert upper >= distance - 1e-9
        if distance > 1e-6:
            assert lower >= min(enough, distance) - 1e-6
