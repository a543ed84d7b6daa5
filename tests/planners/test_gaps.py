"""The gaps between prints, and hands that pass each other."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from symgrasp.feasibility.cell import Cell
from symgrasp.object.manifold import ROLLS, grasp_to_tool
from symgrasp.planners.gaps import OVERLAP, PASSING
from symgrasp.planners.holding import HoldingSearch
from tests.planners.small_maps import difference, fine, small
from tests.planners.test_planners import map_of


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
