"""The complete search for several hands, against trying everything."""

from __future__ import annotations

import sys
from itertools import combinations, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from symgrasp.feasibility.cell import Cell
from symgrasp.planners.gaps import PrintGaps
from symgrasp.planners.holding import HoldingSearch, hold_runs, turn_groups
from symgrasp.planners.sequential import surface_margin
from tests.conftest import load_small
from tests.planners.small_maps import difference, fine, random_maps, score, small, together
from tests.planners.test_planners import map_of


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
    every = list(search.best_first())
    found = [h for h in every if h.score >= 0]
    assert every[: len(found)] == found
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
    search = HoldingSearch([{arm: maps[k, arm] for arm in arms} for k, arms in enumerate(tasks)], gaps)
    found = next(search.best_first(), None)
    assert (found is not None and found.score >= 0) == (best >= 0)
    if found and best >= 0:
        assert found.score == pytest.approx(best)
        assert all(search.turns(found.cells, k) for k in range(len(search.groups)))


@pytest.mark.parametrize("count", [3, 4])
def test_wide_open_maps_by_brute_force(count):
    """Where every cell is feasible, ties are everywhere: the best of all placements all the same."""
    scene = load_small("log_two_robots", 12, 6)
    arms, grid = list(scene.arms.values()), scene.manifold
    everything = map_of(np.ones((2, 12, 6), dtype=bool), grid=grid)
    gaps = PrintGaps([arms[k % 2] for k in range(count)], grid)
    margin = surface_margin(everything).ravel()
    line, column = np.divmod(np.arange(margin.size), 6)
    table = gaps.table(0, 1)  # all hands are alike
    gap = table.gaps[table.row[line[:, None], line], (column - column[:, None]) % 6]
    pairs = np.minimum(gap, np.minimum(margin[:, None], margin))
    best = -1.0
    for first in np.flatnonzero(column == 0):
        reached = np.minimum(pairs[first][:, None], np.minimum(pairs[first], pairs))
        if count == 3:
            best = max(best, reached.max())
            continue
        for second in np.flatnonzero(pairs[first] > best):
            others = np.minimum(pairs[second][:, None], pairs[second])
            best = max(best, min(pairs[first, second], np.minimum(reached, others).max()))
    names = [str(k) for k in range(count)]
    search = HoldingSearch([dict.fromkeys(names, everything)], gaps)
    found = next(search.best_first())
    assert found.score == pytest.approx(best)
    assert best > 0


@given(st.integers(0, 2**32 - 1), st.sampled_from([0.005, 0.02]))
@settings(max_examples=30, deadline=None)
def test_four_hands_by_trying_all(seed, density):
    """A handful of cells for each of four hands: the best score over all choices, if there is one."""
    arms, grid, _ = fine()
    rng = np.random.default_rng(seed)
    maps = [map_of(rng.random((2, 24, 8)) < density, grid=grid) for _ in range(4)]
    gaps = PrintGaps([arms[k % 2] for k in range(4)], grid)
    cells = [np.argwhere(m.feasible) for m in maps]
    alone = [surface_margin(m)[m.feasible] for m in maps]
    reached = np.full([len(own) for own in cells], np.inf)
    for k, margin in enumerate(alone):
        reached = np.minimum(reached, margin.reshape([-1 if axis == k else 1 for axis in range(4)]))
    for a, b in combinations(range(4), 2):
        table = gaps.table(a, b)
        line_a, line_b = (cells[k][:, 0] * 24 + cells[k][:, 1] for k in (a, b))
        columns = (cells[b][:, 2] - cells[a][:, 2][:, None]) % 8
        gap = table.gaps[table.row[line_a[:, None], line_b], columns]
        reached = np.minimum(reached, gap.reshape([len(cells[k]) if k in (a, b) else 1 for k in range(4)]))
    best = reached.max(initial=-1.0)
    names = [str(k) for k in range(4)]
    found = next(HoldingSearch([dict(zip(names, maps, strict=True))], gaps).best_first(), None)
    assert (found is not None and found.score >= 0) == (best >= 0)
    if found and best >= 0:
        assert found.score == pytest.approx(best)


def test_the_work_grows_with_the_number_of_tasks():
    """One grasp for a sequence: twice the tasks, about twice the calls, on maps of one size."""
    (m,) = random_maps(0, 1, 0.5)

    def calls(tasks: int) -> int:
        count = 0

        def note(frame, event, argument):
            nonlocal count
            count += event in ("call", "c_call")

        visits = [{"a": m}] * tasks
        sys.setprofile(note)
        try:
            search = HoldingSearch(visits, small()[2])
            found = next(search.best_first())
            assert all(search.turns(found.cells, k) for k in range(tasks))
        finally:
            sys.setprofile(None)
        return count

    calls(1)  # what is computed once
    assert calls(80) - calls(40) < 1.1 * (calls(60) - calls(20))
    assert calls(80) < 2.1 * calls(40)


def test_an_object_that_stands_is_not_turned():
    """Tasks between which nobody holds on share their turn."""
    assert turn_groups([["a"], ["a", "b"], ["b"]]) == [[0], [1], [2]]
    assert turn_groups([["a"], ["b"], ["b"], ["a"]]) == [[0, 1], [2, 3]]
    one, other = np.zeros((2, 2, 6, 8), dtype=bool)
    one[0, 2, 3] = other[1, 3, 5] = True
    visits = [{"a": map_of(one, grid=small()[1])}, {"b": map_of(other, grid=small()[1])}]
    search = HoldingSearch(visits, small()[2])
    (found,) = search.best_first()
    (turn,) = search.turns(found.cells, 0)
    assert [c.turned(turn.columns, 8) for c in found.cells] == [Cell(0, 2, 3), Cell(1, 3, 5)]


def test_hold_runs():
    runs = hold_runs([["left"], ["left", "right"], ["right"], ["left", "right"]])
    assert [(r.arm, list(r.tasks)) for r in runs] == [("left", [0, 1]), ("right", [1, 2, 3]), ("left", [3])]
