"""The page on the architecture is true of the code: its rooms, its words, and the picture of its imports."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

import pytest

from docs.figures.architecture import FILE, PLACES, architecture, edges_as_text, is_crossing, route
from docs.imports import MODULES, ROOT, reduced, room_imports
from tests.test_imports import ROOMS

PAGE = ROOT / "docs/architecture.md"
FIGURE = ROOT / "docs/figures/architecture.py"
ORDER = ROOT / "tests/test_imports.py"


def rows(heading: str) -> list[list[str]]:
    """Return the cells of every row of the tables below a heading, without heads and lines."""
    text = PAGE.read_text(encoding="utf-8")
    (section,) = re.findall(rf"^#+ {heading}\n(.*?)(?=^#|\Z)", text, flags=re.DOTALL | re.MULTILINE)
    found = [
        [cell.strip() for cell in row.split("|")[1:-1]] for row in re.findall(r"^\|.*\|$", section, re.M)
    ]
    heads = {k - 1 for k, row in enumerate(found) if set(row[0]) == {"-"}}
    return [row for k, row in enumerate(found) if k not in heads and k - 1 not in heads]


def words(cell: str) -> list[str]:
    """Return what stands between backticks."""
    return re.findall(r"`([^`]+)`", cell)


def files(cell: str) -> list[Path]:
    """Return the files that are linked."""
    return [(PAGE.parent / link).resolve() for link in re.findall(r"\]\(([^)]+)\)", cell)]


def defined(path: Path) -> set[str]:
    """Return the name of a module and the names that it defines at its top."""
    names = {path.stem}
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, (ast.ClassDef, ast.FunctionDef)):
            names.add(node.name)
        elif isinstance(node, ast.Assign):
            names |= {target.id for target in node.targets if isinstance(target, ast.Name)}
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            names.add(node.target.id)
    return names


def test_every_room_is_described_in_order():
    assert [words(row[0])[0] for row in rows("Rooms")] == ROOMS
    assert all(row[1] for row in rows("Rooms"))


@cache
def stands_on() -> dict[str, set[str]]:
    """Return what each room imports, less what that stands on itself."""
    return reduced(room_imports())


@pytest.mark.parametrize("row", rows("Rooms"), ids=lambda row: row[0].strip("`"))
def test_a_room_stands_on_what_it_imports(row):
    assert set(words(row[2])) == stands_on()[words(row[0])[0]]


@pytest.mark.parametrize("row", rows("Words of the code"), ids=lambda row: row[0])
def test_a_word_of_the_code_is_where_the_glossary_says(row):
    (path,) = files(row[2])
    assert words(row[0])
    assert set(words(row[0])) <= defined(path)


@pytest.mark.parametrize("row", rows("Words of the method"), ids=lambda row: row[0])
def test_a_word_of_the_method_has_a_meaning_and_a_place(row):
    assert row[1].endswith((".", ")"))
    assert files(row[2])
    assert all(path.is_file() for path in files(row[2]))


def members() -> set[str]:
    """Return ``Class.attribute`` and ``module.function`` for all of both packages."""
    found = set()
    for path in MODULES.values():
        found |= {f"{path.stem}.{name}" for name in defined(path)}
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef):
                names = {part.name for part in node.body if isinstance(part, ast.FunctionDef)}
                fields = [part.target for part in node.body if isinstance(part, ast.AnnAssign)]
                names |= {target.id for target in fields if isinstance(target, ast.Name)}
                found |= {f"{node.name}.{name}" for name in names}
    return found


def test_names_in_the_text_exist():
    text = PAGE.read_text(encoding="utf-8")
    named = {word for word in words(text) if re.fullmatch(r"[A-Za-z_]+\.\w+|[A-Z][A-Za-z]+", word)}
    dotted = {word for word in named if "." in word}
    known = set().union(*(defined(path) for path in MODULES.values()), defined(FIGURE), defined(ORDER))
    assert len(named) > 100
    assert len(dotted) > 20
    assert not dotted - members() - set(MODULES)
    assert not named - dotted - known


def test_the_picture_shows_the_imports_of_today():
    """What fails here is mended by ``make figures ARGS=architecture``."""
    (edges,) = re.findall(r"<dc:description>(.*?)</dc:description>", FILE.read_text(encoding="utf-8"))
    assert edges == edges_as_text(room_imports())


def test_every_arrow_points_down_and_passes_no_box():
    assert set(PLACES) == set(ROOMS)
    assert len(set(PLACES.values())) == len(PLACES)
    for room, others in reduced(room_imports()).items():
        for other in others:
            assert PLACES[other].floor < PLACES[room].floor
            assert not is_crossing(route(PLACES[room], PLACES[other], PLACES), PLACES), f"{room} → {other}"


def test_the_picture_is_the_same_every_time(monkeypatch, tmp_path):
    kept = []
    for name in ("a.svg", "b.svg"):
        monkeypatch.setattr("docs.figures.architecture.FILE", tmp_path / name)
        architecture()
        kept.append((tmp_path / name).read_bytes())
    assert kept[0] == kept[1]


def test_arrows_that_follow_from_others_are_left_out():
    graph = {"a": set(), "b": {"a"}, "c": {"a", "b"}, "d": {"a"}}
    assert reduced(graph) == {"a": set(), "b": {"a"}, "c": {"b"}, "d": {"a"}}
