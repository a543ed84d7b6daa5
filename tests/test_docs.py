"""What the README shows works."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from docs.figures.__main__ import FIGURES
from symgrasp.cli import main
from symgrasp.scene import Scene

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text()
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


COMMANDS = [line.split("#")[0].strip() for block in blocks("sh") for line in block.splitlines()]
RUN = [c for c in COMMANDS if c.startswith("symgrasp ") and not c.startswith("symgrasp app")]


def test_the_commands_run(tmp_path, monkeypatch, capsys):
    """In the README's order: a later command may use the file of an earlier one."""
    monkeypatch.chdir(tmp_path)
    for command in RUN:
        assert main(shlex.split(command)[1:]) == 0, command
        assert capsys.readouterr().out
        if "--out" in command:
            assert (tmp_path / shlex.split(command)[-1]).is_file()


def test_there_are_commands():
    assert len(RUN) >= 5


def test_the_make_targets_exist():
    targets = re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(), flags=re.MULTILINE)
    named = {c.split()[1] for c in COMMANDS if c.startswith("make ")}
    assert named >= {"app", "test"}
    assert named <= set(targets)


def test_the_python_example_runs(tmp_path):
    (code,) = blocks("python")
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "plan.json").exists()


def test_the_scene_example_loads():
    (text,) = blocks("yaml")
    scene = Scene.parse(text, "README.md")
    assert list(scene.tasks) == ["pick", "pour"]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_and_pictures_lead_somewhere(page):
    links = re.findall(r"!?\[[^\]]+\]\(([^)]+)\)", page.read_text())
    missing = [link for link in links if not (page.parent / link).is_file()]
    assert links
    assert not missing


def test_every_picture_is_made_and_shown():
    shown = {p.stem for page in PAGES for p in map(Path, re.findall(r"[\w/]+\.png(?=\))", page.read_text()))}
    kept = {path.stem for path in (ROOT / "docs/images").iterdir()}
    assert kept == shown == set(FIGURES)


def test_the_first_screen():
    """A sentence, the picture of the page, the two commands."""
    lines = [line for line in README.splitlines() if line]
    assert lines[0] == "# symgrasp"
    assert lines[1].endswith(".")
    assert lines[2].startswith("![")
    assert lines[4].startswith("make app")
    assert lines[5].startswith("make test")
