"""A real server, a real browser."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, ViewportSize, sync_playwright

from tests.e2e.page import GraspPage

FLAGS = [
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    # Mesa draws several times faster than Chromium's own software renderer, which steps in without it.
    "--ignore-gpu-blocklist",
    "--use-gl=angle",
    "--use-angle=gl-egl",
]
HOW_TO_GET_IT = "the browser tests need Chromium: apt-get install chromium"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if "/e2e/" in str(item.path):
            item.add_marker(pytest.mark.browser)


# Of the package, not of the session: an event loop of Playwright runs meanwhile, where others want their own.
@pytest.fixture(scope="package")
def launch() -> Iterator[Callable[[], Browser]]:
    """Starts Chromium."""
    chromium = shutil.which("chromium")
    if chromium is None:
        if os.environ.get("CI") == "true":
            pytest.fail(HOW_TO_GET_IT)
        pytest.skip(HOW_TO_GET_IT)
    with sync_playwright() as playwright:
        yield lambda: playwright.chromium.launch(executable_path=chromium, args=FLAGS)


# Of the module: after a hundred 3D views in one Chromium, its frames may come no more.
@pytest.fixture(scope="module")
def browser(launch: Callable[[], Browser]) -> Iterator[Browser]:
    browser = launch()
    yield browser
    browser.close()


def start_app(scene: str, port: int, caches: Path) -> subprocess.Popen[str]:
    """Start a server, which keeps what its pages show in a folder; it listens on return.

    Without a scene ("") it begins with its own.
    """
    command = [sys.executable, "-m", "app", *filter(None, [scene]), "--port", str(port)]
    environment = os.environ | {"XDG_CACHE_HOME": str(caches)}
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
    assert process.stdout
    assert process.stdout.readline() == f"symgrasp: http://127.0.0.1:{port}\n"
    return process


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.fixture(scope="package")
def start_server(
    launch: Callable[[], Browser], tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Callable[[str], str]]:
    """Start servers for scenes, one a scene; gives their addresses."""
    running: dict[str, tuple[subprocess.Popen[str], str]] = {}
    caches = tmp_path_factory.mktemp("caches")

    def start(scene: str) -> str:
        if scene not in running:
            port = free_port()
            running[scene] = start_app(scene, port, caches), f"http://127.0.0.1:{port}"
        return running[scene][1]

    yield start
    for process, _ in running.values():
        process.terminate()
        process.wait()


@pytest.fixture
def open_page(browser: Browser, start_server: Callable[[str], str]) -> Iterator[Callable[..., GraspPage]]:
    """Open a browser of its own on the server of a scene, and choose another scene in it."""
    contexts = []

    def open_(
        server: str = "bottle_on_table",
        scene: str | None = None,
        wait_for_map: bool = True,
        size: tuple[int, int] = (1280, 800),
    ) -> GraspPage:
        viewport: ViewportSize = {"width": size[0], "height": size[1]}
        context = browser.new_context(viewport=viewport, accept_downloads=True)
        contexts.append(context)
        page = GraspPage(context.new_page(), start_server(server), wait_for_map)
        if scene:
            page.choose("Scene", scene)
            page.expect_title(scene)
        return page

    yield open_
    for context in contexts:
        context.close()
