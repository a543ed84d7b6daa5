"""The files of the page: HTML, styles and modules, as they are served."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

__all__ = ["PageFile", "page_file"]

MEDIA_TYPES = {".html": "text/html", ".css": "text/css", ".js": "text/javascript"}

FOLDER = Path(__file__).parent / "static"


@dataclass(frozen=True)
class PageFile:
    """A file and its media type."""

    text: str
    media_type: str


@cache
def _files() -> dict[str, PageFile]:
    return {
        path.name: PageFile(path.read_text(encoding="utf-8"), f"{MEDIA_TYPES[path.suffix]}; charset=utf-8")
        for path in FOLDER.iterdir()
        if path.suffix in MEDIA_TYPES
    }


def page_file(name: str) -> PageFile | None:
    """Return the file of that name, None where there is none."""
    return _files().get(name)
