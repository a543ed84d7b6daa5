"""The tree of boxes: a walk finds the pieces whose boxes are near, as trying all of them does."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from symgrasp.collision.boxes import box_of, boxes_of
from symgrasp.collision.pieces import pose_rows
from symgrasp.collision.tree import Tree, build


def pieces(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return sizes and poses; some boxes have the same middle."""
    size, pose = np.zeros((count, 9)), np.tile(np.eye(4), (count, 1, 1))
    size[:, 0], size[:, 6:] = rng.uniform(0, 0.1, count), rng.uniform(0, 0.3, (count, 3))
    size[:, 3:6] = rng.normal(0, 0.1, (count, 3))
    pose[:, :3, :3] = Rotation.random(count, rng).as_matrix()
    pose[:, :3, 3] = rng.integers(-3, 3, (count, 3))
    return size, pose_rows(pose)


def walk(tree: Tree, box: np.ndarray) -> list[int]:
    """Return the pieces whose boxes meet a box, in the order in which compiled code meets them."""
    node, found = 0, []
    while node < len(tree.skip):
        if (tree.box[node, :3] > box[3:]).any() or (box[:3] > tree.box[node, 3:]).any():
            node = tree.skip[node]
            continue
        if tree.piece[node] >= 0:
            found.append(int(tree.piece[node]))
        node += 1
    return found


@given(seed=st.integers(0, 2**32 - 1), count=st.integers(0, 40))
def test_a_walk_finds_what_trying_all_does(seed, count):
    rng = np.random.default_rng(seed)
    size, pose = pieces(rng, count + 3)
    indices = rng.permutation(count + 3)[:count]
    tree, boxes = build(size, pose, indices), boxes_of(size, pose)
    assert sorted(tree.piece[tree.piece >= 0]) == sorted(indices)
    for corner in rng.uniform(-3, 3, (10, 3)):
        box = np.concatenate([corner, corner + rng.uniform(0, 2, 3)])
        near = [k for k in indices if (boxes[k, :3] <= box[3:]).all() and (box[:3] <= boxes[k, 3:]).all()]
        assert sorted(walk(tree, box)) == sorted(near)


def test_a_walk_past_the_root_ends_soon():
    """Halves are halves: of 1024 pieces in a row, a box that meets one is found through few others."""
    size, pose = np.zeros((1024, 9)), np.tile(np.eye(4), (1024, 1, 1))
    pose[:, 0, 3] = np.random.default_rng(0).permutation(1024)
    tree = build(size, pose_rows(pose), np.arange(1024))
    visited, node = 0, 0
    while node < len(tree.skip):
        visited += 1
        apart = tree.box[node, 0] > 500.1 or tree.box[node, 3] < 499.9
        node = tree.skip[node] if apart else node + 1
    assert visited == 2 * 10 + 1


@given(seed=st.integers(0, 2**32 - 1))
def test_boxes_are_those_of_compiled_code(seed):
    size, pose = pieces(np.random.default_rng(seed), 5)
    boxes = np.empty((5, 6))
    for k in range(5):
        box_of(size, pose, k, boxes[k])
    np.testing.assert_allclose(boxes_of(size, pose), boxes, atol=1e-12)
