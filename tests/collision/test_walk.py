"""The walk through a tree with hulls misses nothing near, and what it says of a solid is true."""

from __future__ import annotations

import math

import numpy as np
import pytest
from trimesh.creation import annulus, icosphere

from symgrasp.collision.distance import distance_bounds
from symgrasp.collision.hulls import with_hulls
from symgrasp.collision.pieces import Piece, joined, pack, pose_rows
from symgrasp.collision.tree import build, grafted
from symgrasp.collision.walk import next_near
from symgrasp.compiling import ENTRY, njit
from symgrasp.engine.kinematics import new_scratch
from symgrasp.meshes.flat_faces import convex_faces, fills_hull
from symgrasp.poses import from_rotation, rotation_about

SURE = 1e-3


@njit(**ENTRY)
def walk(pieces, tree, scratch, k, sure, reach, found, solids):
    """Write the pieces that a walk returns, and the distance (m) it states of a solid; return how many."""
    waiting, count = 1, 0
    scratch.stack[0] = 0
    while True:
        i, waiting, lower = next_near(pieces, tree, scratch, k, sure, reach, waiting)
        if i < 0:
            return count
        found[count], solids[count] = i, lower
        count += 1


@njit(**ENTRY)
def all_distances(pieces, pose, k, first, end, work, found):
    """Write the lower bounds, as sharp as they get, of the distances (m) of piece k from others."""
    for i in range(first, end):
        found[i - first] = distance_bounds(pieces, pose, k, i, math.inf, math.inf, -math.inf, work)[0]


@pytest.mark.parametrize("solid", [True, False])
def test_a_walk_returns_all_faces_that_are_near(solid):
    """Of a ball, and a ring which is none, beside single boxes; from a box that is turned at random."""
    meshes = [icosphere(subdivisions=2, radius=0.1), annulus(0.05, 0.12, 0.1)]
    meshes[0].vertices *= [1.0, 2.0, 0.5]
    meshes[1].apply_translation([0.3, 0.1, 0.0])
    assert [fills_hull(mesh) for mesh in meshes] == [True, False]
    corners = np.array(list(np.ndindex(2, 2, 2))) - 0.5
    probe = Piece(corners * [0.2, 0.05, 0.03], rounding=0.004)
    faces = [[Piece(face) for face in convex_faces(mesh)] for mesh in meshes]
    faces += [[Piece(0.05 * corners + [0.1 * k, -0.3, 0.0])] for k in range(6)]
    pieces, rng = pack([probe, *(piece for some in faces for piece in some)]), np.random.default_rng(0)
    pose, first, hulls, trees = pose_rows(np.tile(np.eye(4), (len(pieces.size), 1, 1))), 1, [], []
    for k, some in enumerate(faces):
        tree = build(pieces.size, pose, np.arange(first, first + len(some)))
        tree, own = with_hulls(tree, pieces, pose, solid and k == 0)
        tree.hull[tree.hull >= 0] += len(pose) + len(hulls)
        trees, hulls, first = [*trees, tree], hulls + own, first + len(some)
    assert len(hulls) > 20
    everything, tree, count = joined(pieces, pack(hulls)), grafted(trees), len(pose)
    pose = np.concatenate([pose, pose_rows(np.tile(np.eye(4), (len(hulls), 1, 1)))])
    scratch, ball = new_scratch(pose, everything.size, 7), len(faces[0])
    found, solids, distance = np.empty(count, dtype=np.int64), np.empty(count), np.empty(count - 1)
    stated = 0
    for _ in range(300):
        axis = rng.normal(size=3)
        R = rotation_about(axis / np.linalg.norm(axis), rng.uniform(0, 3))
        pose[0] = pose_rows(from_rotation(R, rng.uniform(-0.3, 0.4, 3)))
        scratch = new_scratch(pose, everything.size, 7)
        reach = float(rng.choice([0.002, 0.01, 0.05]))
        returned = walk(everything, tree, scratch, 0, SURE, reach, found, solids)
        all_distances(everything, pose, 0, 1, count, scratch.simplex, distance)
        near = set((1 + np.flatnonzero(distance < reach - 1e-9)).tolist())
        of_solid = found[:returned] >= count
        if of_solid.any():
            stated += 1
            lower = solids[:returned][of_solid].min()
            assert SURE <= lower <= distance[:ball].min() + 1e-9
            near -= set(range(1, 1 + ball))
        assert near <= set(found[:returned].tolist())
    assert (stated > 10) == solid
