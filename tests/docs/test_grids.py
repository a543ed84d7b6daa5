"""The page on grids says what was measured, and of every shipped scene."""

from __future__ import annotations

import json

from docs.grids import MEASURED, PAGE, read, table
from symgrasp.bench.figures import with_machine
from symgrasp.bench.maps.grids import Counts, GridResult
from tests.conftest import SHIPPED

COUNTS = Counts(cells=1000, truly=200, called=190, missed=30, overstated=20, coarse=19, mixed=4)
ROWS = [
    GridResult(6, 12, COUNTS, no_plan="no grasp serves all tasks"),
    GridResult(12, 24, Counts(1000, 200, 200, 2, 2), None, 0.0125, 0.5236, 0.0071),
]


def test_tables_say_what_was_measured():
    content = json.loads(json.dumps({"scenes": [{"name": "vase", **with_machine("grids", ROWS)}]}))
    assert read(content) == {"vase": ROWS}
    lines = table(read(content)).splitlines()
    assert "| `vase` | 25.0 % | 2.0 % |" in lines
    assert "| `vase` | none | 12 mm, 30°, 7 mm |" in lines
    assert lines.count("| scene | 6 × 12 | 12 × 24 |") == 2


def test_the_page_has_the_tables_that_were_measured_of_every_shipped_scene():
    results = read(json.loads(MEASURED.read_text()))
    assert list(results) == SHIPPED
    assert table(results) in PAGE.read_text()
