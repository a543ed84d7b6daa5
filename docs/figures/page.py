"""Pictures of the running page, in Chromium."""

from __future__ import annotations

import io
import re
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from PIL import Image
from playwright.sync_api import ViewportSize, sync_playwright

from docs.figures.style import IMAGES
from symgrasp.files import write_atomically
from tests.e2e.conftest import FLAGS, HOW_TO_GET_IT
from tests.e2e.page import WAIT, GraspPage

__all__ = ["SIZE", "open_server", "page", "page_plays", "page_two_robots"]

SIZE: ViewportSize = {"width": 1440, "height": 900}

PLAYED = (960, 600)
"""Width and height (px) of the animation."""

PICTURE = 0.1
"""Time (s) that the animation shows a picture for."""

REST = 1.5
"""Time (s) for which it rests between its parts."""

TURN = 5
"""Turn (°) of the bottle from picture to picture, over `TURNS` pictures."""

TURNS = 24

SPEED = 3
"""Seconds of the motion in a second of the animation."""

QUALITY = 55
"""Of the WebP pictures, out of 100."""


def page() -> None:
    """The page as a visitor finds it after clicking a green cell."""
    with _open("bottle_on_table") as it:
        it.number("h (cm)", 14)
        it.number("θ (°)", 150)
        _shoot(it, "page.png")


def page_two_robots() -> None:
    """Both hands on the log, and their prints."""
    with _open("log_two_robots") as it:
        it.tab("Hands")
        it.button("All arms together").click()
        it.button("Download plan").wait_for()
        _shoot(it, "page_two_robots.png")


def page_plays() -> None:
    """The bottle turns and its map shifts; then the arm picks, pours and places as it was planned."""
    pictures: list[Image.Image] = []
    durations: list[float] = []

    def add(it: GraspPage, duration: float = PICTURE) -> None:
        it.settled_view()
        shot = Image.open(io.BytesIO(it.page.screenshot())).convert("RGB")
        pictures.append(shot.resize(PLAYED, Image.Resampling.LANCZOS))
        durations.append(duration)

    with _open("pick_pour_place") as it:
        add(it, REST)
        for k in range(1, TURNS + 1):
            it.slide("Rotation (°)", TURN * k)
            add(it)
        durations[-1] = REST
        it.tab("Sequence")
        it.button("One grasp for all tasks").click()
        it.button("With motion").click()
        now = it.frame.get_by_text(re.compile(r"; \d+\.\d of \d+\.\d s")).filter(visible=True)
        now.wait_for(timeout=10 * WAIT)
        end = float(now.inner_text().split()[-2])
        add(it, REST)
        for t in np.arange(1, int(end / (SPEED * PICTURE)) + 1) * SPEED * PICTURE:
            it.slide("Time (s)", round(float(t), 2))
            it.text(f"; {t:.1f} of").wait_for()
            add(it)
        durations[-1] = REST
    with write_atomically(IMAGES / "page_plays.webp") as file:
        pictures[0].save(
            file, "WEBP", save_all=True, append_images=pictures[1:], loop=0, method=6, quality=QUALITY,
            duration=[round(1e3 * duration) for duration in durations],
        )  # fmt: skip


def _shoot(it: GraspPage, name: str) -> None:
    it.settled_view()
    it.page.screenshot(path=IMAGES / name)


@contextmanager
def _open(scene: str) -> Iterator[GraspPage]:
    """Open the page on a scene, without the invitation and the notice of a browser without a GPU."""
    chromium = shutil.which("chromium")
    if chromium is None:
        raise RuntimeError(HOW_TO_GET_IT)
    with open_server(scene) as address, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=FLAGS)
        it = GraspPage(browser.new_page(viewport=SIZE, device_scale_factor=1), address)
        notice = it.frame.locator(".mantine-Notification-closeButton")
        if notice.count():
            notice.first.click()
        it.page.get_by_role("button", name="No, thanks").click()
        yield it
        browser.close()


@contextmanager
def open_server(*scene: str) -> Iterator[str]:
    """Run the page on a free port, on a scene or the one it begins with; gives its address."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [sys.executable, "-m", "app", *scene, "--port", str(port)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout
        process.stdout.readline()  # printed once it listens
        yield f"http://127.0.0.1:{port}"
    finally:
        process.terminate()
        process.wait()
