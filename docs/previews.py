"""Prints how long the 3D view takes to show the grasp that is pointed at on the map: ``make previews``."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from statistics import median

import numpy as np
from playwright.sync_api import Browser, expect, sync_playwright

from docs.figures.page import SIZE, open_server
from symgrasp.feasibility.create import create_map
from symgrasp.scene.scene import Scene
from tests.e2e.conftest import FLAGS, HOW_TO_GET_IT
from tests.e2e.page import WAIT, GraspPage
from tests.e2e.test_map_pane import at

__all__ = ["previews"]

SCENE = "bottle_on_table"

COUNT = 20
"""How many cells are pointed at, one after the other."""

WATCH = """(() => {
    const context = WebGL2RenderingContext.prototype, put = context.uniformMatrix4fv;
    let sum = 0, before = 0, begun = 0;
    context.uniformMatrix4fv = function (location, transpose, data, ...rest) {
        if (!begun) begun = performance.timeOrigin + performance.now();
        for (const value of data) sum = (31 * sum + value) % 1e9;
        return put.call(this, location, transpose, data, ...rest);
    };
    const look = () => {
        if (begun && sum !== before) window.lastChange = begun;
        if (begun) before = sum;
        sum = begun = 0;
        requestAnimationFrame(look);
    };
    requestAnimationFrame(look);
    addEventListener("pointermove", () => {
        window.lastMove = performance.timeOrigin + performance.now();
    }, true);
})();"""
"""Notes when the 3D view began to draw something elsewhere than before, and when the pointer moved."""


def previews(browser: Browser) -> Iterator[float]:
    """Yield the times (s) from the pointer's arrival at feasible cells until the view draws their grasps.

    The first one includes that the meshes of the preview are sent.
    """
    grid = create_map(Scene.load(SCENE))
    cells = np.argwhere(grid.feasible.any(axis=0))
    cells = cells[np.linspace(0, len(cells) - 1, COUNT).astype(int)]
    with open_server(SCENE) as address:
        page = browser.new_page(viewport=SIZE)
        page.add_init_script(WATCH)
        it = GraspPage(page, address)
        expect(it.text("Ready.")).to_be_visible(timeout=WAIT)
        it.settled_view()
        for row, column in cells:
            before = it.frame.evaluate("window.lastChange ?? 0")
            page.mouse.move(*at(it, grid, row, column))
            moved = page.evaluate("window.lastMove")
            while (changed := it.frame.evaluate("window.lastChange ?? 0")) <= max(before, moved):
                it.next_frame()
            yield (changed - moved) / 1e3
            it.settled_view()
        page.close()


if __name__ == "__main__":
    chromium = shutil.which("chromium")
    if chromium is None:
        raise SystemExit(HOW_TO_GET_IT)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=FLAGS)
        first, *later = previews(browser)
        print(f"preview of the first cell after {1e3 * first:.0f} ms")
        print(f"median of {len(later)} later ones: {1e3 * median(later):.0f} ms")
        print(f"longest of them: {1e3 * max(later):.0f} ms")
        browser.close()
