"""The complete search for several hands, against trying everything."""

from __future__ import annotations

import sys
from functools import cache
from itertools import chain, combinations, islice, product
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from symgrasp.errors import NoPlanError
from symgrasp.feasibility.cell import Cell
from symgrasp.object.manifold import ROLLS, grasp_to_tool
from symgrasp.planners.bimanual import Climb, hill_climb, print_overlap
from symgrasp.planners.configurations import ConfigurationFinder
from symgrasp.planners.free import FreePlacements
from symgrasp.planners.gaps import OVERLAP, PASSING, PrintGaps
from symgrasp.planners.holding import HoldingSearch, hold_runs, turn_groups
from symgrasp.planners.sequential import surface_margin
from symgrasp.planners.stations import SharedTorso
from symgrasp.robot.configuration import ArmConfiguration
from tests.conftest import load_small
from tests.planners.test_planners import map_of


@cache
def small():
    scene = load_small("log_two_robots", 6, 8)
    arms = list(scene.arms.values())
    return arms, scene.manifold, PrintGaps([*arms, arms[0]], scene.manifold)


@cache
def fine():
    """A grid fine enough for hands that pass each other while their prints overlap."""
    scene = load_small("log_two_robots", 24, 8)
    arms = list(scene.arms.values())
    return arms, scene.manifold, PrintGaps(arms, scene.manifold)


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
    return HoldingSearch([dict(zip(names, maps, strict=True))], small()[2])


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


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_hands_that_pass_each_other_come_last(seed):
    """All placements whose prints overlap and whose hands do not meet for certain, once each."""
    _, grid, gaps = fine()
    rng = np.random.default_rng(seed)
    maps = [map_of(rng.random((2, 24, 8)) < 0.06, grid=grid) for _ in range(2)]
    table = gaps.passing(0, 1)
    expected = set()
    for a, b in product(*([Cell(*map(int, c)) for c in np.argwhere(m.feasible)] for m in maps)):
        gap = table.gaps[table.row[a.roll * 24 + a.row, b.roll * 24 + b.row], (b.column - a.column) % 8]
        if gap == PASSING:
            expected.add(difference((a, b)))
    found = list(HoldingSearch([{"a": maps[0], "b": maps[1]}], gaps).best_first())
    passing = [h for h in found if h.score < 0]
    assert {difference(h.cells) for h in passing} == expected
    assert len(passing) == len(expected)
    assume(passing)
    assert found[len(found) - len(passing) :] == passing


def test_hands_that_meet_do_meet():
    """What the table excludes does intersect: some point lies in a body of each (linear programming)."""
    arms, grid, gaps = fine()
    apart, passing = gaps.table(0, 1), gaps.passing(0, 1)
    rng = np.random.default_rng(0)
    radius = float(grid.profile.radius(grid.h[0]))
    bodies = arms[0].hand_hulls(arms[0].hand.opening(radius))
    standoff = arms[0].hand.standoff(radius)

    def placed(line, column):
        roll, row = divmod(line, 24)
        T = grasp_to_tool(np.eye(4), grid.h[row], column * grid.dtheta, ROLLS[roll], standoff)
        return [points @ T[:3, :3].T + T[:3, 3] for points in bodies]

    met = missed = passed = 0
    for _ in range(300):
        (a, b), column = rng.integers(0, 48, 2), int(rng.integers(0, 8))
        if apart.gaps[apart.row[a, b], column] != OVERLAP:
            continue
        meets = passing.gaps[passing.row[a, b], column] == OVERLAP
        really = any(share_a_point(x, y) for x, y in product(placed(a, 0), placed(b, column)))
        assert really or not meets
        met += meets
        missed += really and not meets
        passed += not really
    assert met > 10
    assert passed > 0
    assert missed <= 0.2 * met


def share_a_point(a: np.ndarray, b: np.ndarray) -> bool:
    weights = np.block(
        [[a.T, -b.T], [np.ones(len(a)), np.zeros(len(b))], [np.zeros(len(a)), np.ones(len(b))]]
    )
    return linprog(np.zeros(len(a) + len(b)), A_eq=weights, b_eq=[0, 0, 0, 1, 1]).success


class Picky(ConfigurationFinder):
    """Finds that bodies are free at some combinations of cells only."""

    def __init__(self, maps, seed):
        world: Any = None
        arms: Any = [SimpleNamespace(name=f"arm {k}") for k in range(len(maps))]
        super().__init__(world, arms, maps)
        self.seed = seed

    def find(self, cells, torso=None, *, every=True):
        free = np.random.default_rng([self.seed, *chain(*cells)]).random() < 0.05
        return [ArmConfiguration(arm, np.zeros(7), 0.0) for arm in self.arms] if free else None

    def excluding(self, cells, torso):
        return iter(())


@given(st.integers(0, 2**32 - 1), st.sampled_from([0.1, 0.3, 1.0]))
@settings(max_examples=60, deadline=None)
def test_the_best_that_is_free(seed, density):
    """Of all cells at which the bodies are free, none reach more; bodies are refused mostly."""
    maps = random_maps(seed, 2, density)
    finder = Picky(maps, seed)
    best = -1.0
    for cells in product(*([Cell(*map(int, c)) for c in np.argwhere(m.feasible)] for m in maps)):
        reached = score(cells, maps)
        if reached > best and finder.find(cells):
            best = reached
    found = next(iter(FreePlacements(together(maps), [finder])), None)
    if best >= 0:
        assert found
        assert score(found.steps[0].cells, maps) == pytest.approx(best) == found.score
        assert finder.find(found.steps[0].cells)
    elif found:
        assert apart(found.steps[0].cells) == OVERLAP


@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from([([[0, 1]], 2, 0.1), ([[0, 1]], 2, 0.2), ([[0, 1]], 3, 0.03), ([[0, 1], [2]], 3, 0.03)]),
)
@settings(max_examples=40, deadline=None)
def test_arms_of_one_body_share_its_torso(seed, size):
    """Exactly the placements for which one value of each torso serves all of its arms, best first."""
    bodies, arms, density = size
    values = 3
    by_torso = [random_maps(seed + 1000 * k, values, density) for k in range(arms)]
    union = [map_of(np.any([m.feasible for m in own], axis=0), grid=small()[1]) for own in by_torso]
    names = [f"arm {k}" for k in range(arms)]
    shared = [SharedTorso(0, {names[k]: by_torso[k] for k in body}) for body in bodies]
    alone = {k: [union[k]] for k in range(arms) if not any(k in body for body in bodies)}
    search = HoldingSearch([dict(zip(names, union, strict=True))], small()[2], shared)
    expected: dict = {}
    for cells in product(*([Cell(*map(int, c)) for c in np.argwhere(m.feasible)] for m in union)):
        reached = apart(cells)
        groups = [(body, range(values)) for body in bodies] + [([k], range(1)) for k in alone]
        for body, torso in groups:
            at = [[margin_at((alone.get(k) or by_torso[k])[t], cells[k]) for k in body] for t in torso]
            reached = min(reached, max(map(min, at)))
        if reached >= 0:
            key = difference(cells)
            expected[key] = max(expected.get(key, 0.0), reached)
    found = [h for h in search.best_first() if h.score >= 0]
    assert {difference(h.cells) for h in found} == set(expected)
    assert [h.score for h in found] == sorted((h.score for h in found), reverse=True)
    for holding in found:
        assert holding.score == pytest.approx(expected[difference(holding.cells)])
        for turn in search.turns(holding.cells, 0):
            turned = [c.turned(turn.columns, 8) for c in holding.cells]
            at = [union[k] if k in alone else by_torso[k][turn.torsos[k // 2]] for k in range(arms)]
            assert turn.margin == min(margin_at(m, c) for m, c in zip(at, turned, strict=True)) >= 0


def margin_at(m, cell) -> float:
    return float(surface_margin(m)[cell]) if m.feasible[cell] else -1.0


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
            only_exact += best is not None and best.score >= 0
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
    search = HoldingSearch([dict.fromkeys(names, everything)], PrintGaps(arms, scene.manifold))
    (holding,) = islice(search.best_first(), 1)
    prints = [a.handprint(scene.manifold, c.row, c.roll) for a, c in zip(arms, holding.cells, strict=True)]
    assert print_overlap(prints, [c.column for c in holding.cells]) == 0
    assert holding.score > 0
