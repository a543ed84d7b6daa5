"""What a notebook shows: the live page while its kernel runs, and the 3D view for whoever reads it later."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import nbformat
import numpy as np
import pytest
from nbclient import NotebookClient
from playwright.sync_api import Browser, Page, WebSocket, expect

from app.server.door.front_door import MAP
from symgrasp.feasibility.create import create_map
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.poses import rotation_z
from symgrasp.scene.scene import Scene
from tests.app.shown_map import ShownMap
from tests.conftest import ROOT
from tests.e2e.other_host import served
from tests.e2e.page import WAIT
from tests.e2e.test_page import drawn

SCENE = Scene.load("soda_can").with_settings(heights=12, angles=24, redundancy=4)

CELL = """import symgrasp as sg
scene = sg.load_scene("soda_can").with_settings(heights=12, angles=24, redundancy=4)
scene.show()
sg.create_map(scene).shift(0.5).show()"""


@contextmanager
def shown_by(thread: ThreadPoolExecutor, tmp_path: Path) -> Iterator[list[str]]:
    """The HTML that a cell shows, while the kernel of its notebook runs."""
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(CELL)])
    client = NotebookClient(notebook, timeout=600, resources={"metadata": {"path": str(tmp_path)}})
    kernel = client.setup_kernel(env=os.environ | {"PYTHONPATH": str(ROOT)})
    thread.submit(kernel.__enter__).result()
    try:
        thread.submit(client.execute_cell, notebook.cells[0], 0).result()
        outputs = [output.get("data", {}) for output in notebook.cells[0].outputs]
        assert sum("image/png" in data for data in outputs) == 2
        yield [data["text/html"] for data in outputs if "text/html" in data]
    finally:
        thread.submit(kernel.__exit__, None, None, None).result()


def _take_maps(socket: WebSocket, shown: ShownMap) -> None:
    def take(message: bytes | str) -> None:
        assert isinstance(message, bytes)
        shown.take(message)

    if MAP in socket.url:
        socket.on("framereceived", take)


def _wait_for_map(page: Page, shown: ShownMap, expected: FeasibilityMap) -> None:
    deadline = time.monotonic() + WAIT / 1000
    while (picture := shown.picture()) is None or not np.array_equal(picture, drawn(expected)):
        assert time.monotonic() < deadline, "the map never became right"
        page.evaluate("() => new Promise(done => requestAnimationFrame(done))")


@pytest.fixture
def thread() -> Iterator[ThreadPoolExecutor]:
    with ThreadPoolExecutor(1) as thread:  # an event loop of Playwright runs in this one
        yield thread


def test_a_notebook_shows_the_live_page_and_later_the_3d_view(browser: Browser, thread, tmp_path):
    context = browser.new_context(viewport={"width": 1280, "height": 800})
    context.set_default_timeout(WAIT)
    try:
        page = context.new_page()
        shown = ShownMap()
        page.on("websocket", lambda socket: _take_maps(socket, shown))
        with shown_by(thread, tmp_path) as (scene, turned), served(scene) as address:
            page.goto(address)
            live = page.frame_locator("iframe")
            expect(live.locator("#title")).to_have_text("soda_can · pick · panda")
            expect(live.locator("#nothing")).to_be_hidden()
            _wait_for_map(page, shown, create_map(SCENE))
            # A click on the map is one in the scene: both are of one session.
            live.get_by_test_id("map").click(position={"x": 120, "y": 120})
            panel = live.frame_locator("#view")
            expect(panel.get_by_text("panda").filter(has_text="hold")).to_be_visible()
            with served(turned) as other:
                page.goto(other)
                expect(live.locator("#turn")).to_contain_text("turned by 0.00°")
                expect(live.locator("#title")).to_have_text("soda_can · pick · panda")
                expect(live.locator("#nothing")).to_be_hidden()
                pick = SCENE.task("pick")
                pose = pick.T_world_object @ rotation_z(0.5)
                _wait_for_map(page, shown, create_map(SCENE.with_task(replace(pick, T_world_object=pose))))
        assert not list(tmp_path.iterdir())
        with served(scene) as address:
            page.goto(address)
            view = page.frame_locator("iframe")
            expect(view.locator("canvas").first).to_be_visible()
            expect(page.locator("iframe")).to_have_attribute("height", "480")
    finally:
        context.close()
