"""Makes the README's pictures from the shipped scenes and the running page: ``make figures``."""

from __future__ import annotations

import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from playwright.sync_api import Browser, sync_playwright

from symgrasp.files import write_atomically
from symgrasp.maps import create_map
from symgrasp.scene import Scene
from tests.e2e.conftest import FLAGS, HOW_TO_GET_IT
from tests.e2e.page import GraspPage

IMAGES = Path(__file__).parent / "images"
SIZE = {"width": 1280, "height": 800}


@contextmanager
def server(scene: str) -> Iterator[str]:
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


def open_page(browser: Browser, address: str) -> GraspPage:
    """Open the page, and put away the browser's notice that it draws without a GPU."""
    page = GraspPage(browser.new_page(viewport=SIZE), address)
    page.page.locator(".mantine-Notification-closeButton").click()
    return page


def first_screen(browser: Browser, address: str) -> None:
    """The page as a visitor finds it after clicking a green cell."""
    page = open_page(browser, address)
    page.number("h (cm)", 14)
    page.number("θ (°)", 150)
    page.settled_view()
    page.page.screenshot(path=IMAGES / "page.png")


def two_robots(browser: Browser, address: str) -> None:
    """Figure 7: both hands on the log, and their prints."""
    page = open_page(browser, address)
    page.button("All arms together").click()
    page.button("Download plan (JSON)").wait_for()
    page.settled_view()
    page.page.screenshot(path=IMAGES / "log_two_robots.png")


def maps() -> None:
    """Figure 4: a map with the reason of every cell."""
    png = create_map(Scene.load("bottle_on_table"))._repr_png_()
    with write_atomically(IMAGES / "map_bottle_on_table.png") as file:
        file.write(png)


def main() -> None:
    """Make all pictures."""
    IMAGES.mkdir(exist_ok=True)
    chromium = shutil.which("chromium")
    if chromium is None:
        sys.exit(HOW_TO_GET_IT)
    maps()
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=FLAGS)
        for scene, figure in (("bottle_on_table", first_screen), ("log_two_robots", two_robots)):
            with server(scene) as address:
                figure(browser, address)
        browser.close()


if __name__ == "__main__":
    main()
