"""The planners against plain loops over random maps, and against the printed algorithms."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import combinations, pairwise, product

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from symgrasp.errors import InputError, NoPlanError
from symgrasp.feasibility.cell import Cell
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.object.manifold import Manifold, wrap
from symgrasp.object.profile import Profile
from symgrasp.planners.bimanual import Climb, ClimbStep, hill_climb, print_overlap
from symgrasp.planners.conflicts import (
    ConflictError,
    Exclusion,
    Shared,
    fewest_regrasps,
    find_conflict,
    height_gap,
    smallest_conflicts,
)
from symgrasp.planners.gaps import PrintGaps
from symgrasp.planners.holding import HoldingSearch
from symgrasp.planners.sequential import clearance_steps, common_grasps, first_common_grasp
from symgrasp.reason import Reason
from tests.conftest import load_small


@cache
def no_gaps() -> PrintGaps:
    return PrintGaps([], GRID)


GRID = Manifold(Profile([[0, 0.03], [0.4, 0.03]]), 5, 12)


def map_of(feasible: np.ndarray, name: str = "task", grid: Manifold = GRID) -> FeasibilityMap:
    """A map with these feasible cells (2, H, A) and nothing else known."""
    shape = feasible.shape
    return FeasibilityMap(
        scene="random",
        arm="arm",
        task=name,
        T_world_object=np.eye(4),
        manifold=grid,
        reason=np.where(feasible, Reason.FEASIBLE, Reason.UNREACHABLE).astype(np.uint8),
        q=np.zeros((*shape, 7)),
        sample=np.zeros(shape, dtype=np.int16),
        branch=np.zeros(shape, dtype=np.int16),
        clearance=np.where(feasible, 0.01, np.nan),
        phi=np.zeros(1),
        opening=np.zeros(grid.heights),
        bodies=(),
        proven=np.zeros(shape, dtype=bool),
        pair=np.full((*shape, 2), -1),
        depth=np.full(shape, np.nan),
    )


@st.composite
def random_maps(draw: st.DrawFn, count: int) -> list[FeasibilityMap]:
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    density = draw(st.sampled_from([0.01, 0.03, 0.1, 0.4]))
    shape = (2, GRID.heights, GRID.angles)
    maps = [map_of(rng.random(shape) < density, f"task {k}") for k in range(count)]
    return [replace(m, clearance=np.where(m.feasible, rng.integers(1, 9, shape), np.nan)) for m in maps]


@given(st.integers(1, 5).flatmap(random_maps))
@settings(max_examples=200, deadline=None)
def test_first_common_grasp_by_brute_force(maps):
    """It finds a grasp exactly when some height and roll serves all tasks, and the first of them."""
    common = [
        (row, roll)
        for row, roll in product(range(5), range(2))
        if all(m.feasible[roll, row].any() for m in maps)
    ]
    if not common:
        with pytest.raises(NoPlanError, match="no grasp"):
            first_common_grasp(maps)
        return
    found = first_common_grasp(maps)
    assert (found.grasp.row, found.grasp.roll) == common[0]
    assert found.deltas[0] == 0.0
    for m, cell, delta in zip(maps, found.cells, found.deltas, strict=True):
        assert m.feasible[cell]
        assert not m.feasible[cell.roll, cell.row, : cell.column].any()  # the first angle
        # The same grasp (h, θ*) on the map of the turned object: equation 3.
        assert m.shift(delta).feasible[found.grasp]
        assert wrap(delta - (cell.column - found.grasp.column) * GRID.dtheta) == pytest.approx(0.0, abs=1e-9)


@given(st.integers(1, 5).flatmap(random_maps))
@settings(max_examples=100, deadline=None)
def test_best_common_grasp_by_brute_force(maps):
    """No other height, roll and choice of angles has a better worst margin, or clearance of equal ones."""
    search = HoldingSearch([{"arm": m} for m in maps], no_gaps())
    best = (0.0, 0.0)
    for roll, row in product(range(2), range(5)):
        radius = float(GRID.profile.radius(GRID.h[row]))
        cells = [[(roll, row, j) for j in range(12) if m.feasible[roll, row, j]] for m in maps]
        if not all(cells):
            continue
        margin = [
            {c: min(m.margin(c).along, m.margin(c).around * radius) for c in own}
            for m, own in zip(maps, cells, strict=True)
        ]
        worst = min(max(own.values()) for own in margin)
        clear = min(
            max(m.clearance[c] for c in own if own[c] >= worst) for m, own in zip(maps, margin, strict=True)
        )
        best = max(best, (worst, float(clear)))
    if best[0] == 0.0:
        assert next(search.best_first(), None) is None
        assert not common_grasps(maps)
        return
    found = next(search.best_first())
    (grasp,) = found.cells
    reached = clear = np.inf
    for k, m in enumerate(maps):
        turn = search.turns(found.cells, k, found.score)[0].columns
        assert m.shift(turn * GRID.dtheta).feasible[grasp]
        cell = grasp.turned(turn, 12)
        along, around = m.margin(cell)
        reached = min(reached, along, around * float(GRID.profile.radius(GRID.h[cell.row])))
        clear = min(clear, float(m.clearance[cell]))
    assert (reached, clear) == pytest.approx(best)
    assert found.score == reached
    assert common_grasps(maps)[0][3:] == pytest.approx(best)
    listed = [(cell.roll, cell.row) for (cell,) in (h.cells for h in search.best_first())]
    assert listed == [(g.roll, g.row) for g in common_grasps(maps)]


@given(st.integers(1, 4).flatmap(random_maps), st.integers(0, 2**32 - 1))
@settings(max_examples=100, deadline=None)
def test_what_a_map_cannot_know_of_clearances_orders_nothing(maps, seed):
    """Clearances are known to a step: whatever else they are within it, the list is the same."""
    rng = np.random.default_rng(seed)
    orders = []
    for _ in range(2):
        steps = [5e-3 * (m.clearance - 1 + rng.uniform(0.01, 0.99, m.clearance.shape)) for m in maps]
        own = [replace(m, clearance=clearance) for m, clearance in zip(maps, steps, strict=True)]
        search = HoldingSearch([{"arm": m} for m in own], no_gaps())
        listed = [h.cells for h in search.best_first()]
        turns = [[(t.columns, t.torsos) for t in search.turns(c, k)] for c in listed for k in range(len(own))]
        orders.append((listed, turns, [(g.roll, g.row) for g in common_grasps(own)]))
    assert orders[0] == orders[1]
    ranks = [(-g.margin, -int(clearance_steps(g.clearance)), g.roll, g.row) for g in common_grasps(maps)]
    assert ranks == sorted(ranks)


@given(st.integers(1, 4).flatmap(random_maps))
@settings(max_examples=100, deadline=None)
def test_all_common_grasps_with_their_intervals(maps):
    found = {(g.roll, g.row): g for g in common_grasps(maps)}
    for roll, row in product(range(2), range(5)):
        serves = all(m.feasible[roll, row].any() for m in maps)
        assert ((roll, row) in found) == serves
        if serves:
            for m, runs in zip(maps, found[roll, row].intervals, strict=True):
                covered = np.zeros(12, dtype=int)
                for first, count in runs:
                    covered[np.arange(first, first + count) % 12] += 1
                assert np.array_equal(covered, m.feasible[roll, row].astype(int))


@given(st.integers(2, 6).flatmap(random_maps))
@settings(max_examples=150, deadline=None)
def test_smallest_conflicts_by_trying_all_sets(maps):
    masks = [m.feasible.any(axis=2) for m in maps]
    expected = []
    for size in range(1, len(maps) + 1):
        expected = [
            s
            for s in combinations(range(len(maps)), size)
            if not np.logical_and.reduce([masks[k] for k in s]).any()
        ]
        if expected:
            break
    assert smallest_conflicts(maps) == expected


@given(st.integers(2, 4).flatmap(random_maps))
@settings(max_examples=100, deadline=None)
def test_height_gap_by_trying_all_heights(maps):
    gaps = []
    for roll in range(2):
        rows = [np.flatnonzero(m.feasible[roll].any(axis=1)) for m in maps]
        gaps += [(max(c) - min(c)) * GRID.dh for c in product(*rows)]
    gap = height_gap(maps)
    assert (gap is None) == (not gaps)
    if gaps:
        assert gap == pytest.approx(min(gaps))


@given(st.integers(1, 5).flatmap(random_maps), st.sets(st.integers(0, 4)))
@settings(max_examples=150, deadline=None)
def test_fewest_regrasps_by_trying_all_splits(maps, resting):
    n = len(maps)
    resting = sorted(k for k in resting if k < n)
    masks = [m.feasible.any(axis=2) for m in maps]

    def works(cuts, stops):
        """Segments between cuts; stops[i] is where the object stands after segment i."""
        bounds = [0, *cuts, n]
        for i, (a, b) in enumerate(pairwise(bounds)):
            members = (
                [*range(a, b), *stops[i - 1 : i], *stops[i : i + 1]] if i else [*range(a, b), *stops[:1]]
            )
            if not np.logical_and.reduce([masks[k] for k in members]).any():
                return False
        return True

    fewest = next(
        (
            count + 1
            for count in range(n)
            for cuts in combinations(range(1, n), count)
            for stops in product(resting, repeat=count)
            if works(cuts, list(stops))
        ),
        None,
    )
    found = fewest_regrasps(maps, resting)
    assert (found is None) == (fewest is None)
    if found:
        assert len(found) == fewest
        assert [s.first for s in found] == [0, *(s.last + 1 for s in found[:-1])]
        assert found[-1].last == n - 1
        assert all(s.set_down in resting for s in found[:-1])
        assert found[-1].set_down is None


def test_why_there_is_no_common_grasp():
    low, high = np.zeros((2, 5, 12), dtype=bool), np.zeros((2, 5, 12), dtype=bool)
    low[0, 0:2, 3] = True
    high[0, 4, 3] = True
    both = low | high
    with pytest.raises(NoPlanError) as caught:
        first_common_grasp([map_of(low, "pick"), map_of(both, "pour"), map_of(high, "place")])
    text = str(caught.value)
    assert text.startswith("no grasp serves pick and place: they are 24.0 cm apart; ")
    assert "pick allows 4.0 to 12.0 cm at roll 0°, nothing at roll 180°" in text
    assert "place allows 36.0 to 36.0 cm at roll 0°" in text
    assert "pour" not in text


def test_conflicts_as_data():
    """Pick low, pour high or low, place high: two exclude each other; a regrasp at the pour helps."""
    low, high = np.zeros((2, 5, 12), dtype=bool), np.zeros((2, 5, 12), dtype=bool)
    low[0, 0:2, 3] = True
    high[0, 4, 3] = True
    maps = [map_of(low, "pick"), map_of(low | high, "pour"), map_of(high, "place")]
    with pytest.raises(ConflictError) as caught:
        first_common_grasp(maps, resting=[1])
    conflict = caught.value.conflict
    assert conflict.exclusions == (Exclusion(("pick", "place"), height_gap([maps[0], maps[2]])),)
    assert [task.task for task in conflict.heights] == ["pick", "pour", "place"]
    assert conflict.heights[1].spans == ((pytest.approx((0.04, 0.12)), pytest.approx((0.36, 0.36))), ())
    assert conflict.regrasps == (Shared(("pick",), "pour"), Shared(("pour", "place"), None))
    assert str(caught.value).endswith("each part does: pick, set down at pour; pour and place")
    assert find_conflict(maps).regrasps is None
    assert find_conflict(maps, [0]).regrasps == ()
    assert str(find_conflict(maps, [0])).endswith("no regrasp helps")


def test_maps_must_share_a_grid():
    other = Manifold(GRID.profile, 5, 10)
    with pytest.raises(InputError, match="one grid"):
        first_common_grasp([map_of(np.ones((2, 5, 12), bool)), map_of(np.ones((2, 5, 10), bool), grid=other)])
    with pytest.raises(InputError, match="at least one map"):
        first_common_grasp([])


@cache
def arms_and_grid():
    scene = load_small("log_two_robots", 10, 16)
    return list(scene.arms.values()), scene.manifold


def free(cells) -> bool:
    return True


def shares_no_cell(cells) -> bool:
    arms, grid = arms_and_grid()
    prints = [arm.handprint(grid, c.row, c.roll) for arm, c in zip(arms, cells, strict=True)]
    return print_overlap(prints, [c.column for c in cells]) == 0


@given(st.integers(0, 2**32 - 1), st.sampled_from([0.05, 0.2, 0.8]))
@settings(max_examples=30, deadline=None)
def test_hill_climb_places_hands_apart_on_feasible_cells(seed, density):
    arms, grid = arms_and_grid()
    rng = np.random.default_rng(seed)
    maps = [map_of(rng.random((2, 10, 16)) < density, grid=grid) for _ in arms]
    assume(all(m.feasible.any() for m in maps))
    try:
        found = hill_climb(maps, arms, free, seed)
    except NoPlanError:
        return
    assert all(m.feasible[c] for m, c in zip(maps, found.cells, strict=True))
    assert shares_no_cell(found.cells)
    assert hill_climb(maps, arms, free, seed) == found


def test_hill_climb_really_climbs():
    """From starts that overlap it walks to where the hands are apart."""
    arms, grid = arms_and_grid()
    everything = map_of(np.ones((2, 10, 16), dtype=bool), grid=grid)
    moved = [hill_climb([everything] * 2, arms, free, seed, Climb(restarts=1)) for seed in range(40)]
    assert any(found.iterations > 0 for found in moved)
    assert all(shares_no_cell(found.cells) for found in moved)


def test_hill_climb_moves_in_the_best_direction():
    """One free arm, one fixed: every step must go to a neighbour with the fewest shared cells."""
    arms, grid = arms_and_grid()
    fixed = np.zeros((2, 10, 16), dtype=bool)
    fixed[0, 4, 8] = True
    corridor = np.zeros((2, 10, 16), dtype=bool)
    corridor[0, 4:, 8] = True  # the only way is up
    found = hill_climb([map_of(fixed, grid=grid), map_of(corridor, grid=grid)], arms, free, 1)
    assert found.cells[0] == Cell(0, 4, 8)
    assert shares_no_cell(found.cells)
    assert found.cells[1].row > 4


def test_hill_climb_starts_on_feasible_cells_only():
    arms, grid = arms_and_grid()
    one = np.zeros((2, 10, 16), dtype=bool)
    one[1, 2, 3] = True
    other = np.zeros((2, 10, 16), dtype=bool)
    other[0, 9, 3] = True
    found = hill_climb([map_of(one, grid=grid), map_of(other, grid=grid)], arms, free, 5)
    assert found.cells == (Cell(1, 2, 3), Cell(0, 9, 3))


def test_hill_climb_says_what_stood_in_the_way():
    arms, grid = arms_and_grid()
    same = np.zeros((2, 10, 16), dtype=bool)
    same[0, 5, 5] = True
    m = map_of(same, grid=grid)
    trace: list[ClimbStep] = []
    with pytest.raises(NoPlanError, match="handprints always overlapped"):
        hill_climb([m, m], arms, free, 0, Climb(3, 10), trace=trace)
    assert [step.restart for step in trace] == [0] * 10 + [1] * 10 + [2] * 10
    assert all(step.collisions > 0 for step in trace)
    everything = map_of(np.ones((2, 10, 16), dtype=bool), grid=grid)
    with pytest.raises(NoPlanError, match="arms always met"):
        hill_climb([everything, everything], arms, lambda cells: False, 0, Climb(3, 50))
    nothing = map_of(np.zeros((2, 10, 16), dtype=bool), grid=grid)
    with pytest.raises(NoPlanError, match="no feasible cell"):
        hill_climb([m, nothing], arms, free, 0)


def test_prints_that_barely_share_a_cell_are_not_apart():
    arms, grid = arms_and_grid()
    prints = [arms[0].handprint(grid, row, 0) for row in range(10)]
    overlap = {(row, c): prints[4].overlap(prints[row], c) for row, c in product(range(10), range(16))}
    row, column = min((cell for cell, count in overlap.items() if count), key=lambda cell: overlap[cell])
    one, other = np.zeros((2, 10, 16), dtype=bool), np.zeros((2, 10, 16), dtype=bool)
    one[0, 4, 0] = other[0, row, column] = True
    with pytest.raises(NoPlanError, match="overlapped"):
        hill_climb([map_of(one, grid=grid), map_of(other, grid=grid)], arms, free, 0, Climb(2, 5))


def test_three_hands():
    arms, grid = arms_and_grid()
    everything = map_of(np.ones((2, 10, 16), dtype=bool), grid=grid)
    three = [arms[0], arms[1], arms[0]]
    found = hill_climb([everything] * 3, three, free, 3)
    prints = [a.handprint(grid, c.row, c.roll) for a, c in zip(three, found.cells, strict=True)]
    assert print_overlap(prints, [c.column for c in found.cells]) == 0
