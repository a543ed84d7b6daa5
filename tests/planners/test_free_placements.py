"""The best placement that is free, with one torso for all arms of a body, and hill climbing beside it."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from symgrasp.errors import NoPlanError
from symgrasp.feasibility.cell import Cell
from symgrasp.planners.bimanual import Climb, hill_climb, print_overlap
from symgrasp.planners.free import FreePlacements
from symgrasp.planners.gaps import OVERLAP, PrintGaps
from symgrasp.planners.holding import HoldingSearch
from symgrasp.planners.sequential import surface_margin
from symgrasp.planners.stations import SharedTorso
from tests.conftest import load_small
from tests.planners.small_maps import Picky, apart, difference, margin_at, random_maps, score, small, together
from tests.planners.test_planners import map_of


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


@given(st.integers(0, 2**32 - 1), st.sampled_from([0.1, 0.3]))
@settings(max_examples=60, deadline=None)
def test_what_counts_is_how_easily_arms_stand_in_the_end(seed, density):
    """Of all placements none reaches more in the configurations that are free, whatever the witnesses are."""
    maps = [replace(m, ease=np.ones(m.feasible.shape)) for m in random_maps(seed, 2, density)]
    finder = Picky(maps, seed)
    best = -1.0
    for cells in product(*([Cell(*map(int, c)) for c in np.argwhere(m.feasible)] for m in maps)):
        if apart(cells) >= 0 and (found := finder.find(cells)):
            eased = [surface_margin(m)[c] * own.q[0] for m, c, own in zip(maps, cells, found, strict=True)]
            best = max(best, min(apart(cells), *eased))
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("symgrasp.planners.free.ease", lambda arm, q: q[0])
        placement = next(iter(FreePlacements(together(maps), [finder])), None)
    if best >= 0:
        assert placement
        assert placement.score == pytest.approx(best)


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
