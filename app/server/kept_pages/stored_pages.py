"""What pages show, in files that outlive the server: two for each page, under a hash of its token."""

from __future__ import annotations

import hashlib
import logging
import os
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from symgrasp.files import read_file, write_atomically

from ...files.stored_page import StoredPage, scene_file
from .left_pages import LeftPage

__all__ = ["StoredFiles", "StoredPages", "stored_pages_folder"]

log = logging.getLogger(__name__)

MOST = 32
"""How many pages are kept, the latest ones."""

LARGEST = 60_000_000
"""Most bytes of a file: the scene of a page with uploaded robots may take 50 MB."""

MOST_BYTES = 300_000_000
"""Most bytes of all files."""

PAUSE = 1.0
"""Time (s) between two looks at what is shown."""


@dataclass(frozen=True)
class StoredFiles:
    """The files of a page: its settings, and its scene; see `app.files.stored_page`."""

    settings: bytes
    scene: bytes


@dataclass(eq=False)
class _Written:
    """What was written last of a page."""

    page: LeftPage
    settings: str
    scene: bytes
    plan: str | None


def stored_pages_folder() -> Path:
    """Return the folder of the user for them."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(base) if base else Path.home() / ".cache") / "symgrasp" / "pages"


class StoredPages:
    """Writes what pages show into files, and finds it there; `find` may be called from any thread.

    Args:
        folder: where the files are; it is made.
        shown: returns what the pages show now, by their tokens.
    """

    def __init__(self, folder: Path, shown: Callable[[], Mapping[str, LeftPage]]) -> None:
        self._folder, self._shown = folder, shown
        self._written: dict[str, _Written] = {}
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._follow, name="stored pages", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Write what is shown at last, and end the thread; a second call does nothing."""
        self._closed.set()
        self._thread.join()

    def find(self, token: str) -> StoredFiles | None:
        """Return the files of a page; None where there are none that can be read."""
        settings, scene = self._paths(token)
        with suppress(OSError, ValueError):
            return StoredFiles(read_file(settings, LARGEST), read_file(scene, LARGEST))
        return None

    def _paths(self, token: str) -> tuple[Path, Path]:
        name = hashlib.sha256(token.encode()).hexdigest()  # whoever reads the folder learns no token
        return self._folder / f"{name}.json", self._folder / f"{name}.scene"

    def _follow(self) -> None:
        over = False
        while not over:
            over = self._closed.wait(PAUSE)
            shown = self._shown()
            for token, page in shown.items():
                try:
                    self._write(token, page)
                except Exception as error:  # must not end the thread; it is tried again after a change
                    log.warning("what a page shows could not be stored: %s: %s", type(error).__name__, error)
                    self._written[token] = _Written(page, "", b"", None)
            self._written = {token: last for token, last in self._written.items() if token in shown}

    def _write(self, token: str, page: LeftPage) -> None:
        """Write what has changed on a page; nothing while it plays."""
        last, state = self._written.get(token), page.state
        if (last and last.page.state is state) or state.plan_results.playing:
            return
        same = last is not None and last.settings != "" and last.page.state.scene is state.scene
        scene = last.scene if last and same else scene_file(state)
        plan = state.plan.plan if state.plan else None
        before = last.page.state.plan if last and last.settings else None
        text = last.plan if last and before and before.plan is plan else plan and plan.to_json()
        settings = StoredPage.of(state, page.camera, scene, text).model_dump_json()
        self._written[token] = _Written(page, settings, scene, text)
        if last and last.settings == settings:
            return
        if max(len(scene), len(settings)) > LARGEST:
            return
        self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        paths = self._paths(token)
        for path, content in zip(reversed(paths), (scene, settings.encode()), strict=True):
            if path is paths[1] and same and path.exists():
                continue
            with write_atomically(path) as file:
                file.write(content)
        self._make_room()

    def _make_room(self) -> None:
        """Remove the oldest pages beyond `MOST` and `MOST_BYTES`."""
        found = []
        for settings in self._folder.glob("*.json"):
            with suppress(OSError):  # another server may remove it
                scene = settings.with_suffix(".scene")
                stat = settings.stat()
                found.append((stat.st_mtime, stat.st_size + scene.stat().st_size, settings, scene))
        found.sort(reverse=True)
        total = 0
        for k, (_, size, *paths) in enumerate(found):
            total += size
            if k >= MOST or total > MOST_BYTES:
                for path in paths:
                    path.unlink(missing_ok=True)
