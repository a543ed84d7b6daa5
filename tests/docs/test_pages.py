"""What the README and the pages in docs/ show works, and prints what they say."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from PIL import Image

from docs.figures.__main__ import FIGURES
from docs.pages import NOT_RUN, PAGES, Step, blocks, commands, run, shown
from symgrasp.scene.scene import Scene
from tests.conftest import some

ROOT = Path(__file__).parent.parent.parent
README = ROOT / "README.md"
IMAGES = ROOT / "docs/images"
TUTORIAL = "tutorial_"
NUMBER = re.compile(r"-?\d+(?:\.\d+)?")


class Done(NamedTuple):
    """A page that was run: where, and what happened at each of its blocks."""

    folder: Path
    steps: list[Step]


def same(printed: str, expected: str) -> bool:
    """Whether texts agree: the words exactly, the numbers to a hundredth or to what is printed of them.

    Branches of the closed form that do equally well come in any order.
    """
    one, other = (re.sub(r"branch \d+", "branch", text) for text in (printed, expected))
    if NUMBER.sub("0", one).split() != NUMBER.sub("0", other).split():
        return False
    numbers = [np.array(NUMBER.findall(text), dtype=float) for text in (one, other)]
    return np.allclose(*numbers, rtol=0.01, atol=0.11)


def test_texts_are_compared():
    assert same("2 mm\n", "2.01 mm\n")
    assert same("branch 3", "branch 4")
    assert not same("2 mm", "2 cm")
    assert not same("20 cm", "21 cm")
    assert not same("a 1", "a 1 b")


@pytest.fixture(scope="module")
def done(tmp_path_factory) -> Callable[[Path], Done]:
    """Run a page, once for all tests."""

    @cache
    def run_once(page: Path) -> Done:
        folder = tmp_path_factory.mktemp(page.stem)
        return Done(folder, list(run(page, folder)))

    return run_once


# The commands of the last one measure grids.
IN_ORDER = sorted(PAGES, key=lambda page: page.name == "grids.md")


@pytest.mark.parametrize("page", some(len(PAGES) - 1, IN_ORDER), ids=lambda page: page.name)
def test_a_page_runs_from_top_to_bottom(page, done):
    """In one folder: a later block may use the file of an earlier one."""
    folder, steps = done(page)
    for step in steps:
        assert step.status == 0, step.printed
        if step.expected is not None:
            assert same(shown(step.printed, step.expected), step.expected), step.printed
        if step.block.language == "sh":
            wanted = [c for c in commands(step.block) if not c.startswith(NOT_RUN)]
            out = [name for c in wanted for name in re.findall(r"--(?:out|fit) (\S+)", c)]
            assert all((folder / name).exists() for name in out)


def test_the_tutorial_shows_the_pictures_that_it_makes(done):
    folder, steps = done(ROOT / "docs/tutorial.md")
    assert all(step.status == 0 for step in steps)
    made = sorted(folder.glob("*.png"))
    assert len(made) >= 2
    for picture in made:
        kept = IMAGES / f"{TUTORIAL}{picture.name}"
        now, then = (np.asarray(Image.open(p).convert("RGB"), dtype=float) for p in (picture, kept))
        assert now.shape == then.shape
        assert np.abs(now - then).mean() < 2


def test_there_is_something_to_run():
    languages = {page.name: [b.language for b in blocks(page)] for page in PAGES}
    assert {"sh", "python", "yaml"} <= set(languages["README.md"])
    assert languages["tutorial.md"].count("text") >= 6
    found = [c for page in PAGES for b in blocks(page) if b.language == "sh" for c in commands(b)]
    assert all(c.startswith(("symgrasp ", *NOT_RUN)) for c in found)
    assert sum(not c.startswith(NOT_RUN) for c in found) >= 15


def test_the_make_targets_exist():
    targets = re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(), flags=re.MULTILINE)
    text = "".join(page.read_text() for page in PAGES)
    named = set(re.findall(r"(?:^|`)make ([a-z]+)", text, flags=re.MULTILINE))
    assert named >= {"app", "test", "figures"}
    assert named <= set(targets)


def test_the_scene_example_loads():
    (text,) = [block.text for block in blocks(README) if block.language == "yaml"]
    scene = Scene.parse(text, "README.md")
    assert list(scene.tasks) == ["pick", "pour"]


@pytest.mark.parametrize("page", some(len(PAGES) - 1, IN_ORDER), ids=lambda page: page.name)
def test_links_and_pictures_lead_somewhere(page):
    links = re.findall(r"!?\[[^\]]+\]\(([^)]+)\)", page.read_text())
    missing = [link for link in links if not (page.parent / link).is_file()]
    assert links
    assert not missing


def test_every_picture_is_made_and_shown():
    found = [p for page in PAGES for p in re.findall(r"[\w/]+\.(?:png|svg|webp)(?=\))", page.read_text())]
    names = {Path(p).stem for p in found}
    assert {path.stem for path in IMAGES.iterdir()} == names
    assert {n for n in names if not n.startswith(TUTORIAL)} == {n for n in FIGURES if n != "tutorial"}


def test_the_first_screen():
    """A sentence, the picture of the page, the two commands."""
    lines = [line for line in README.read_text().splitlines() if line]
    assert lines[0] == "# symgrasp"
    assert lines[1].endswith(".")
    assert lines[2].startswith("![")
    assert lines[4].startswith("make app")
    assert lines[5].startswith("make test")


def test_the_first_picture_is_a_short_animation():
    first = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", README.read_text())[0]
    assert first == "docs/images/page_plays.webp"
    assert (ROOT / first).stat().st_size < 2e6
    with Image.open(ROOT / first) as picture:
        assert picture.format == "WEBP"
        assert getattr(picture, "n_frames", 1) > 40
        frames = []
        for k in range(0, getattr(picture, "n_frames", 1), 8):
            picture.seek(k)
            frames.append(np.asarray(picture.convert("RGB")).astype(int))
    for one, two in pairwise(frames):
        assert (np.abs(one - two).max(axis=2) > 40).any()
