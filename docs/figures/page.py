"""Pictures of the running page, in Chromium."""

from __future__ import annotations

import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from playwright.sync_api import ViewportSize, sync_playwright

from docs.figures.style import IMAGES
from tests.e2e.conftest import FLAGS, HOW_TO_GET_IT
from tests.e2e.page import GraspPage

__all__ = ["page", "page_two_robots"]

SIZE: ViewportSize = {"width": 1440, "height": 900}


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


def _shoot(it: GraspPage, name: str) -> None:
    it.settled_view()
    it.page.screenshot(path=IMAGES / name)


@contextmanager
def _open(scene: str) -> Iterator[GraspPage]:
    """Open the page on a scene, without the browser's notice that it draws without a GPU."""
    chromium = shutil.which("chromium")
    if chromium is None:
        raise RuntimeError(HOW_TO_GET_IT)
    with _server(scene) as address, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=FLAGS)
        it = GraspPage(browser.new_page(viewport=SIZE, device_scale_factor=1), address)
        notice = it.page.locator(".mantine-Notification-closeButton")
        if notice.count():
            notice.first.click()
        yield it
        browser.close()


@contextmanager
def _server(scene: str) -> Iterator[str]:
    """Run the page on a free port; gives its address."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [sys.executable, "-m", "app", scene, "--port", str(port)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout
        process.stdout.readline()  # printed once it listens
        yield f"http://127.0.0.1:{port}"
    finally:
        process.terminate()
        process.wait()
