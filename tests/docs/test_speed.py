"""The README's table of times says what the benchmark measured."""

from __future__ import annotations

import ast
import json
import re
from pathlib import Path

import pytest

from docs.speed import ARMS, BEGIN, BENCH, END, PAGE, ROWS, full_table, table, write
from symgrasp import bench

README = Path(__file__).parent.parent.parent / "README.md"

NAMING = ("Figure", "against", "ratios", "times")
"""Functions that make a figure, whose first argument is its name."""


def patterns() -> list[str]:
    """Return what the benchmark's figures may be called, as regular expressions."""
    found = []
    for path in Path(bench.__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") in NAMING:
                name = node.args[0]
                if isinstance(name, ast.Constant):
                    found.append(re.escape(str(name.value)))
                elif isinstance(name, ast.JoinedStr):
                    parts = [
                        re.escape(str(p.value)) if isinstance(p, ast.Constant) else ".+" for p in name.values
                    ]
                    found.append("".join(parts))
    return found


def content(names) -> dict:
    figures = [{"name": name, "unit": "ms", "values": [3.0, 1.0, 1234.5], "cpu": [5.0]} for name in names]
    return {"machine": {"python": "3.11.2", "machine": "x86_64", "cpus": 2}, "figures": figures}


@pytest.mark.parametrize("row", ROWS)
def test_the_benchmark_measures_every_row(row):
    *above, name = row.rsplit(": ", 1) if not any(re.fullmatch(p, row) for p in patterns()) else [row]
    wanted = [*above, "  " + name] if above else [name]
    for part in wanted:
        assert any(re.fullmatch(p, part) for p in patterns()), part


def test_a_table_has_median_and_spread():
    lines = table(content(ROWS)).splitlines()
    assert "2 cores (x86_64)" in lines[0]
    assert len(lines) == 4 + len(ROWS)
    assert all(line.endswith("| 3 ms | 1 | 1,230 | 5 ms |") for line in lines[4:])
    assert len(table(content(["something else"])).splitlines()) == 4


def test_every_arm_is_a_row_of_the_page_and_every_number_of_arms_one_of_the_readme():
    measured = content(f"{ARMS}{name}" for name in ("one, left", "one, right", "two, arm"))
    for figure, factor in zip(measured["figures"], (1, 3, 5), strict=True):
        figure["values"] = [factor * value for value in (1.0, 2.0, 9.0)]
    assert full_table(measured).splitlines()[4:] == [
        "| map of one, left | 2 ms | 1 | 9 | 5 ms |",
        "| map of one, right | 6 ms | 3 | 27 | 5 ms |",
        "| map of two, arm | 10 ms | 5 | 45 | 5 ms |",
    ]
    assert table(measured).splitlines()[4:] == [
        "| map of an arm, scenes with 1 arm mapped | 10 ms | 5 | 45 | 5 ms |",
        "| map of an arm, scenes with 2 arms mapped | 4.5 ms | 1 | 27 | 5 ms |",
    ]


def test_only_the_table_of_a_page_is_written(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(f"before\n{BEGIN}\nold\n{END}\nafter\n")
    for _ in range(2):
        write(table(content(ROWS)), page)
        assert page.read_text() == f"before\n{BEGIN}\n{table(content(ROWS))}{END}\nafter\n"


def test_a_page_gets_a_section_for_the_table(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("# Title\n\ntext\n\n## Security\n\nmore\n")
    write(table(content(ROWS)), page)
    text = page.read_text()
    assert text.startswith("# Title\n\ntext\n\n## How fast\n\n")
    assert text.endswith(f"{table(content(ROWS))}{END}\n\n## Security\n\nmore\n")


def test_the_pages_have_the_tables_that_were_measured():
    """Both or neither: a table without its measurement could say anything."""
    text = README.read_text()
    assert (BEGIN in text) == BENCH.exists()
    if BENCH.exists():
        measured = json.loads(BENCH.read_text())
        assert table(measured) in text
        assert full_table(measured) in PAGE.read_text()
