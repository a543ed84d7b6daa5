import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from symgrasp.collision.inner_pieces import inner_pieces
from symgrasp.collision.pieces import Piece, pack

SEEDS = st.integers(0, 10_000)


def pieces_at_random(rng: np.random.Generator) -> list[Piece]:
    box = (np.array(list(np.ndindex(2, 2, 2))) - rng.uniform(0, 1, 3)) * rng.uniform(0.01, 1, 3)
    cylinder = np.array([[0.1, 0.0, -0.3], [0.1, 0.0, 0.5]]) * rng.uniform(0.2, 2, 3)
    cone = np.array([[0.0, 0.0, 0.1], [0.2, 0.0, 0.4], [0.1, 0.0, 0.9]]) * rng.uniform(0.2, 2, 3)
    return [
        Piece(rng.normal(size=(rng.integers(4, 40), 3)), rounding=0.01),
        Piece(box),
        Piece(cylinder, revolved=True),
        Piece(cone, rounding=0.002, revolved=True),
        Piece(rng.normal(size=(6, 3)) * [1.0, 1.0, 0.0]),
    ]


def support(vertices: np.ndarray, size: np.ndarray, direction: np.ndarray) -> float:
    """How far a piece reaches in a direction."""
    if size[2]:
        across = np.hypot(*direction[:2])
        return float((vertices[:, 0] * across + vertices[:, 2] * direction[2]).max() + size[0])
    return float((vertices @ direction).max() + size[0])


@given(SEEDS)
def test_inner_bodies_are_inside_the_pieces(seed):
    rng = np.random.default_rng(seed)
    packed = pack(pieces_at_random(rng))
    for inner in inner_pieces(packed):
        for k, (first, end, _) in enumerate(packed.ranges.tolist()):
            for direction in rng.normal(size=(20, 3)):
                n = direction / np.linalg.norm(direction)
                here = support(inner.vertices[first:end], inner.size[k], n)
                assert here <= support(packed.vertices[first:end], packed.size[k], n) + 1e-12


@given(SEEDS)
def test_the_ball_inside_a_box_and_a_cylinder_touches_their_sides(seed):
    packed = pack(pieces_at_random(np.random.default_rng(seed))[1:3])
    half = packed.size[:, 6:9].min(axis=1)
    largest = inner_pieces(packed)[0]
    assert largest.size[:, 0] == pytest.approx(packed.size[:, 0] + 0.5 * half)
