"""The complete search for several hands, against trying everything."""

from __future__ import annotations

from functools import cache
from itertools import combinations, islice, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from symgrasp.errors import NoPlanError
from symgrasp.feasibility import Cell
from symgrasp.planners.bimanual import Climb, hill_climb, print_overlap
from symgrasp.planners.gaps import OVERLAP, PrintGaps
from symgrasp.planners.holding import HoldingSearch, hold_runs
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


def together(maps) -> HoldingSearch:
    """The search for several hands in one task."""
    names = [f"arm {k}" for k in range(len(maps))]
    keyed = {(0, name): m for name, m in zip(names, maps, strict=True)}
    return HoldingSearch(keyed, [names], small()[2])


def apart(cells) -> float:
    """The smallest gap between the prints of all pairs."""
    _, grid, gaps = small()
    worst = np.inf
    for a, b in combinations(range(len(cells)), 2):
        table = gaps.around(a, cells[a].roll, cells[a].row, b)
        columns = (cells[b].column - cells[a].column) % grid.angles
        worst = min(worst, float(table[cells[b].roll, cells[b].row, columns]))
    return worst


def score(cells, maps) -> float:
    """What a placement reaches without a turn."""
    return min(apart(cells), *(float(surface_margin(m)[c]) for m, c in zip(maps, cells, strict=True)))


def difference(cells):
    """What stays of cells when all are turned together."""
    columns = tuple((c.column - cells[0].column) % 8 for c in cells)
    return tuple((c.roll, c.row) for c in cells), columns


@given(st.integers(0, 2**32 - 1), st.sampled_from([(2, 0.1), (2, 0.3), (3, 0.06)]))
@settings(max_examples=60, deadline=None)
def test_all_placements_best_first(seed, size):
    """Exactly the placements whose prints share no cell, up to a turn, in falling order of their score."""
    count, density = size
    maps = random_maps(seed, count, density)
    choices = [[Cell(*map(int, c)) for c in np.argwhere(m.feasible)] for m in maps]
    expected: dict = {}
    for cells in product(*choices):
        reached = score(cells, maps)
        if reached >= 0:
            key = difference(cells)
            expected[key] = max(expected.get(key, 0.0), reached)
    search = together(maps)
    found = list(search.best_first())
    assert {difference(h.cells) for h in found} == set(expected)
    assert len(found) == len(expected)
    scores = [h.score for h in found]
    assert scores == sorted(scores, reverse=True)
    for holding in found:
        assert holding.score == pytest.approx(expected[difference(holding.cells)])
        for turn in search.turns(holding.cells, 0):
            turned = [c.turned(turn.columns, 8) for c in holding.cells]
            margins = [float(surface_margin(m)[c]) for m, c in zip(maps, turned, strict=True)]
            assert all(m.feasible[c] for m, c in zip(maps, turned, strict=True))
            assert turn.margin == min(margins)


SEQUENCES = [
    [["a"], ["a", "b"], ["b"]],  # a handover
    [["a", "b"], ["a", "b"]],  # together twice
    [["a"], ["b"], ["a"]],  # set down between
    [["a"], ["a"]],
]


@given(st.integers(0, 2**32 - 1), st.sampled_from(SEQUENCES), st.sampled_from([0.05, 0.15, 0.5]))
@settings(max_examples=60, deadline=None)
def test_sequences_by_trying_all_grasps(seed, tasks, density):
    """The best score over all grasps of all holds and all turns of all tasks, and whether there is one."""
    _, grid, _ = small()
    rng = np.random.default_rng(seed)
    maps = {
        (k, arm): map_of(rng.random((2, 6, 8)) < density, grid=grid)
        for k, arms in enumerate(tasks)
        for arm in arms
    }
    runs = hold_runs(tasks)
    # Gaps are by hold; the arms behind them do not matter here as long as both sides agree.
    arms, _, _ = small()
    gaps = PrintGaps([arms[k % 2] for k in range(len(runs))], grid)
    margins = {key: np.where(m.feasible, surface_margin(m), -1.0) for key, m in maps.items()}
    best = -1.0
    for rolls_rows in product(product(range(2), range(6)), repeat=len(runs)):
        alone = [
            min(margins[k, run.arm][rr].max() for k in run.tasks)
            for run, rr in zip(runs, rolls_rows, strict=True)
        ]
        if min(alone) <= max(best, -0.5):
            continue
        for columns in product(range(8), repeat=len(runs)):
            reached = np.inf
            for k in range(len(tasks)):
                inside = [i for i, run in enumerate(runs) if k in run.tasks]
                turns = [
                    min(margins[k, runs[i].arm][rolls_rows[i]][(columns[i] + turn) % 8] for i in inside)
                    for turn in range(8)
                ]
                reached = min(reached, max(turns))
                for i, j in combinations(inside, 2):
                    table = gaps.around(i, *rolls_rows[i], j)
                    reached = min(reached, table[rolls_rows[j]][(columns[j] - columns[i]) % 8])
                if reached <= best:
                    break
            best = max(best, reached)
    search = HoldingSearch(maps, tasks, gaps)
    found = next(search.best_first(), None)
    assert (found is None) == (best < 0)
    if found:
        assert found.score == pytest.approx(best)
        assert all(search.turns(found.cells, k) for k in range(len(search.groups)))


def test_hold_runs():
    runs = hold_runs([["left"], ["left", "right"], ["right"], ["left", "right"]])
    assert [(r.arm, list(r.tasks)) for r in runs] == [("left", [0, 1]), ("right", [1, 2, 3]), ("left", [3])]


def test_whenever_hill_climbing_finds_something_so_does_the_exact_search():
    """Over thousands of random pairs of maps; and never the other way round without proof."""
    arms, _, _ = small()
    both = only_exact = 0
    for seed in range(2000):
        maps = random_maps(seed, 2, [0.02, 0.05, 0.2][seed % 3])
        best = next(together(maps).best_first(), None)
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
    everything = map_of(np.ones((2, 10, 8), dtype=bool), grid=scene.manifold)
    names = ["a", "b", "c"]
    search = HoldingSearch(
        {(0, name): everything for name in names}, [names], PrintGaps(arms, scene.manifold)
    )
    (holding,) = islice(search.best_first(), 1)
    prints = [a.handprint(scene.manifold, c.row, c.roll) for a, c in zip(arms, holding.cells, strict=True)]
    assert print_overlap(prints, [c.column for c in holding.cells]) == 0
    assert holding.score > 0
