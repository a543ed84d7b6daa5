"""Prints how long the page takes: to its first words and map, and to show robots.

``make opening``, or ``make opening ARGS="pr2 talos"`` for other robots.
"""

from __future__ import annotations

import argparse
import io
import shutil
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

from playwright.sync_api import Browser, expect, sync_playwright

from docs.figures.page import SIZE, open_server
from symgrasp.cli.main import main as symgrasp
from symgrasp.robot.catalogue import CATALOGUE
from tests.e2e.conftest import FLAGS, HOW_TO_GET_IT
from tests.e2e.page import GraspPage

__all__ = ["ROBOTS", "Visit", "opened", "run", "visits"]

ROBOTS = ("pr2", "talos", "tiago_dual", "so101")
"""Robots of the catalogue that are opened unless others are named."""

LONGEST = 120_000
"""Longest wait (ms) for a robot."""

VISITS = 4
"""How often the page is opened on a server: once first, and later."""

WATCH = """document.addEventListener("DOMContentLoaded", () => {
    const nothing = document.getElementById("nothing");
    if (!nothing) return;
    new MutationObserver(() => {
        if (nothing.hidden) window.mapShown ??= performance.now();
    }).observe(nothing, { attributes: true });
});"""
"""Notes when the map takes the place of its skeleton."""


@dataclass(frozen=True)
class Visit:
    """Times (s) of one visit since the browser asked for the page.

    Attributes:
        words: until words and the skeleton of the map were painted.
        map: until the map was there.
    """

    words: float
    map: float


def visits(browser: Browser) -> Iterator[Visit]:
    """Yield the times of visits, one after the other, to a server that was started for no scene."""
    with open_server() as address:
        for _ in range(VISITS):
            context = browser.new_context(viewport=SIZE)
            page = context.new_page()
            page.add_init_script(WATCH)
            it = GraspPage(page, address)
            expect(it.text("Ready.")).to_be_visible(timeout=LONGEST)
            painted = page.evaluate("performance.getEntriesByName('first-contentful-paint')[0].startTime")
            yield Visit(painted / 1e3, page.evaluate("window.mapShown") / 1e3)
            context.close()


@contextmanager
def opened(browser: Browser, name: str, folder: Path) -> Iterator[tuple[GraspPage, float]]:
    """Open the page on a robot of the catalogue and the can that `symgrasp robot --scene` puts in its reach.

    Args:
        browser: that opens it.
        name: of the robot.
        folder: where the scene is written.

    Yields:
        The page once robot and first map are shown, and the time (s) since the browser asked for it. The
        server has been started before and answers.
    """
    urdf = next(robot.urdf for robot in CATALOGUE if robot.name == name)
    scene = folder / f"{name}.yaml"
    with redirect_stdout(io.StringIO()):
        status = symgrasp(["robot", urdf, "--scene", str(scene)])
    if status:
        raise RuntimeError(f"no scene with {name}")
    with open_server(str(scene)) as address:
        page = browser.new_page(viewport=SIZE)
        start = time.monotonic()
        it = GraspPage(page, address, wait_for_map=False)
        expect(it.text("Ready.")).to_be_visible(timeout=LONGEST)
        expect(page.locator("#nothing")).to_be_hidden(timeout=LONGEST)
        expect(page.locator("#title")).to_have_attribute("aria-busy", "false", timeout=LONGEST)
        yield it, time.monotonic() - start
        page.close()


def run(names: Sequence[str]) -> Iterator[str]:
    """Yield what was measured: of the page, and of robots from opening it to their first map."""
    chromium = shutil.which("chromium")
    if chromium is None:
        raise RuntimeError(HOW_TO_GET_IT)
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=FLAGS)
        for k, visit in enumerate(visits(browser), 1):
            yield f"visit {k}: words after {visit.words:.2f} s, map after {visit.map:.2f} s"
        for name in names:
            with opened(browser, name, Path(folder)) as (_, seconds):
                yield f"{name}: robot and map shown {seconds:.1f} s after opening the page"
        browser.close()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Measure how long the page takes to open.")
    known = [robot.name for robot in CATALOGUE]
    parser.add_argument("robots", nargs="*", metavar="NAME", help=f"of {', '.join(known)}")
    asked = parser.parse_args().robots
    if unknown := set(asked).difference(known):
        parser.error(f"{', '.join(sorted(unknown))}: expected some of {', '.join(known)}")
    for line in run(asked or ROBOTS):
        print(line, flush=True)
