"""The table of robots says what the benchmark measured, and of every robot."""

from __future__ import annotations

import json
from dataclasses import asdict

import pytest

from docs.robots import BEGIN, END, MEASURED, PAGE, table, write
from symgrasp.bench.arms.robots import Check, RobotRow
from symgrasp.bench.figures import with_machine
from symgrasp.robot.catalogue import CATALOGUE

GOOD = RobotRow(
    "good", "", "wsg50", "closed form", "exact", 12.4, 0.261, 20000, 19999,
    Check(40, 0, 0), Check(40, 5, 1), Check(40, 39, 0),
)  # fmt: skip
ROWS = [
    GOOD,
    RobotRow("short", "expected six joints"),
    RobotRow("far", "expected a place", family="search", poses=9, found=9),
]


def lines(rows) -> dict[str, list[str]]:
    """Return the cells of each row, by the robot's name."""
    found = [line.split(" | ") for line in table(with_machine("robots", rows)).splitlines() if " | " in line]
    return {row[0].removeprefix("| "): [cell.removesuffix(" |") for cell in row] for row in found[1:]}


def test_a_row_says_what_was_measured():
    cells = lines(ROWS)["good"][1:]
    assert cells == [
        "yes", "closed form", "exact", "12", "26 %", "99.995 %", "0 of 40", "5 of 40", "1", "39 of 40",
    ]  # fmt: skip


def test_a_robot_without_a_map_is_a_row_with_the_reason():
    rows = lines(ROWS)
    assert rows["short"][1:] == ["no", *["–"] * 9]
    assert rows["far"][1:3] == ["yes", "search"]
    assert rows["far"][6] == "100 %"
    text = table(with_machine("robots", ROWS))
    assert "- short: expected six joints\n" in text
    assert "- far: expected a place\n" in text


def test_hardly_any_missing_is_not_none():
    row = RobotRow(**{**GOOD.__dict__, "poses": 10**7, "found": 10**7 - 1})
    assert lines([row])["good"][6] == "99.999 %"


def test_no_cells_are_no_check():
    row = RobotRow(**{**GOOD.__dict__, "limits": Check()})
    assert lines([row])["good"][8] == "no such cell"


def test_only_the_table_of_a_page_is_written(tmp_path):
    content = json.loads(json.dumps(with_machine("robots", ROWS)))
    page = tmp_path / "page.md"
    page.write_text(f"before\n{BEGIN}\nold\n{END}\nafter\n")
    for _ in range(2):
        write(content, page)
        assert page.read_text() == f"before\n{BEGIN}\n{table(content)}{END}\nafter\n"


def test_the_page_has_the_table_that_was_measured():
    content = json.loads(MEASURED.read_text())
    assert table(content) in PAGE.read_text()
    assert "site-packages" not in MEASURED.read_text()
    assert set(content["robots"][0]) == set(asdict(GOOD))


@pytest.mark.parametrize("robot", CATALOGUE, ids=lambda robot: robot.name)
def test_every_robot_of_the_catalogue_was_measured(robot):
    measured = [row["name"].split()[0] for row in json.loads(MEASURED.read_text())["robots"]]
    assert measured.count(robot.name) == 1
