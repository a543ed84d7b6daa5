"""The complete search for several hands, against trying everything."""

from __future__ import annotations

from functools import cache
from itertools import islice, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from symgrasp.errors import NoPlanError
from symgrasp.feasibility import Cell
from symgrasp.planners.bimanual import Climb, hill_climb, print_overlap
from symgrasp.planners.gaps import OVERLAP, PrintGaps
from symgrasp.planners.placement import best_placements
from symgrasp.planners.sequential import surface_margin
from tests.conftest import load_small
from tests.test_planners import map_of


@cache
def small():
    scene = load_small("log_two_robots", 6, 8)
    arms = list(scene.arms.values())
    return arms, scene.manifold, PrintGaps([*arms, arms[0]], scene.manifold)


def gap_by_hand(a: Cell, b: Cell) -> float:
    """Smallest distance over all pairs of covered cells."""
    arms, grid, _ = small()
    covered = []
    for arm, cell in zip(arms, (a, b), strict=True):
        p = arm.handprint(grid, cell.row, cell.roll)
        covered.append([(r + p.first_row, (c + cell.column) % grid.angles) for r, c in np.argwhere(p.cells)])
    best = np.inf
    for (r1, c1), (r2, c2) in product(*covered):
        columns = min((c1 - c2) % grid.angles, (c2 - c1) % grid.angles)
        if r1 == r2 and columns == 0:
            return OVERLAP
        rows = max(abs(r1 - r2) - 1, 0) * grid.dh
        best = min(best, max(rows, max(columns - 1, 0) * grid.dtheta * grid.profile.r_max))
    return best


@given(st.data())
@settings(max_examples=40, deadline=None)
def test_gaps_by_hand(data):
    cells = [
        Cell(data.draw(st.integers(0, 1)), data.draw(st.integers(0, 5)), data.draw(st.integers(0, 7)))
        for _ in range(2)
    ]
    _, grid, gaps = small()
    a, b = cells
    table = gaps.around(0, a.roll, a.row, 1)
    assert table[b.roll, b.row, (b.column - a.column) % grid.angles] == pytest.approx(gap_by_hand(a, b))


def random_maps(seed: int, count: int, density: float):
    _, grid, _ = small()
    rng = np.random.default_rng(seed)
    return [map_of(rng.random((2, 6, 8)) < density, grid=grid) for _ in range(count)]


def score(cells, maps) -> float:
    _, grid, gaps = small()
    worst = min(float(surface_margin(m)[c]) for m, c in zip(maps, cells, strict=True))
    for a, b in ((0, 1), (0, 2), (1, 2))[: 1 if len(cells) == 2 else 3]:
        table = gaps.around(a, cells[a].roll, cells[a].row, b)
        worst = min(
            worst, table[cells[b].roll, cells[b].row, (cells[b].column - cells[a].column) % grid.angles]
        )
    return float(worst)


@given(st.integers(0, 2**32 - 1), st.sampled_from([(2, 0.1), (2, 0.3), (3, 0.06)]))
@settings(max_examples=60, deadline=None)
def test_all_placements_best_first(seed, size):
    """Exactly the placements whose prints share no cell, in falling order of their score."""
    count, density = size
    maps = random_maps(seed, count, density)
    choices = [[Cell(*map(int, c)) for c in np.argwhere(m.feasible)] for m in maps]
    expected = {cells: s for cells in product(*choices) if (s := score(cells, maps)) >= 0}
    found = list(best_placements(maps, small()[2]))
    assert {p.cells for p in found} == set(expected)
    assert len(found) == len(expected)
    scores = [p.score for p in found]
    assert scores == sorted(scores, reverse=True)
    for placement in found:
        assert placement.score == pytest.approx(expected[placement.cells])


def test_whenever_hill_climbing_finds_something_so_does_the_exact_search():
    """Over thousands of random pairs of maps; and never the other way round without proof."""
    arms, _, gaps = small()
    both = only_exact = 0
    for seed in range(2000):
        maps = random_maps(seed, 2, [0.02, 0.05, 0.2][seed % 3])
        best = next(best_placements(maps, gaps), None)
        try:
            climbed = hill_climb(maps, arms, lambda cells: True, seed, Climb(5, 30))
        except NoPlanError:
            only_exact += best is not None
            continue
        assert best is not None
        assert best.score >= score(climbed.cells, maps)
        both += 1
    assert both > 500
    assert only_exact > 0


def test_three_hands_on_one_log():
    """More arms than two: the first answer is apart."""
    scene = load_small("log_two_robots", 10, 8)
    arms = [*scene.arms.values(), scene.arm("left")]
    gaps = PrintGaps(arms, scene.manifold)
    everything = map_of(np.ones((2, 10, 8), dtype=bool), grid=scene.manifold)
    (placement,) = islice(best_placements([everything] * 3, gaps), 1)
    prints = [a.handprint(scene.manifold, c.row, c.roll) for a, c in zip(arms, placement.cells, strict=True)]
    assert print_overlap(prints, [c.column for c in placement.cells]) == 0
    assert placement.score > 0
