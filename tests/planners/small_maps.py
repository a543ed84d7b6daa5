"""Small maps at random, and what searches in them are compared with."""

from __future__ import annotations

from functools import cache
from itertools import chain, combinations
from types import SimpleNamespace
from typing import Any

import numpy as np

from symgrasp.planners.configurations import ConfigurationFinder
from symgrasp.planners.gaps import PrintGaps
from symgrasp.planners.holding import HoldingSearch
from symgrasp.planners.sequential import surface_margin
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


def margin_at(m, cell) -> float:
    return float(surface_margin(m)[cell]) if m.feasible[cell] else -1.0


def difference(cells):
    """What stays of cells when all are turned together."""
    columns = tuple((c.column - cells[0].column) % 8 for c in cells)
    return tuple((c.roll, c.row) for c in cells), columns


class Picky(ConfigurationFinder):
    """Finds that bodies are free at some combinations of cells only."""

    def __init__(self, maps, seed):
        world: Any = None
        arms: Any = [SimpleNamespace(name=f"arm {k}") for k in range(len(maps))]
        super().__init__(world, arms, maps)
        self.seed = seed

    def find(self, cells, torso=None, *, every=True, trying=lambda: None):
        rng = np.random.default_rng([self.seed, *chain(*cells)])
        free = rng.random() < 0.05
        return [ArmConfiguration(arm, np.full(7, rng.random()), 0.0) for arm in self.arms] if free else None

    def excluding(self, cells, torso):
        return iter(())
