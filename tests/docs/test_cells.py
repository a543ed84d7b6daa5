"""The page on grids says what was proven of cells, of every shipped scene."""

from __future__ import annotations

import json

from docs.cells import MEASURED, PAGE, table
from symgrasp.bench.figures import with_machine
from symgrasp.bench.maps.cells import CellShares, measure_cells
from tests.conftest import SHIPPED, load_small

ROWS = [CellShares(24, 48, 100, 40, 200, 150, 2.53), CellShares(48, 96, 400, 240, 800, 640, 3.0)]


def test_the_table_says_what_was_measured():
    content = json.loads(json.dumps({"scenes": [{"name": "vase", **with_machine("grids", ROWS)}]}))
    assert "| `vase` | 24 × 48 | 40 %, 75 %; 2.5 | 60 %, 80 %; 3.0 |" in table(content).splitlines()


def test_the_page_has_the_table_that_was_measured_of_every_shipped_scene():
    content = json.loads(MEASURED.read_text())
    assert [scene["name"] for scene in content["scenes"]] == SHIPPED
    assert table(content) in PAGE.read_text()


def test_cells_are_counted():
    coarse, fine = measure_cells(load_small("pick_pour_place", 4, 12, 2), (1, 2))
    assert coarse.feasible + coarse.infeasible == 2 * 4 * 12
    assert fine.feasible + fine.infeasible == 4 * (coarse.feasible + coarse.infeasible)
    assert 0 < fine.none <= fine.infeasible
    assert fine.whole <= fine.feasible
