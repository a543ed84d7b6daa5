"""Paths in messages as a browser may see them: as people refer to files, never where the server has them."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path

from symgrasp.files import SCENES_DIR

__all__ = ["shown_paths"]

SEPARATOR, NAME = r"[\\/]", r"[^\\/\s'\",;:()]+"
FOLDER = rf"{NAME}[^\\/'\",;:()]*"

PATH = re.compile(rf"(?<![\w:/.~-])(?:file://|[A-Za-z]:)?(?:{SEPARATOR}{FOLDER})+{SEPARATOR}({NAME})")
"""An absolute path with at least one folder, and its last part; folders may have spaces in their names."""


def shown_paths(text: str) -> str:
    """Return a message without absolute paths.

    A file of the shipped scenes or of an installed package is named as scene files refer to it
    (``package://…``), any other by its name alone.
    """
    packages = [Path(entry) for entry in sys.path if entry.endswith("-packages")]
    data = [folder / "cmeel.prefix" / "share" for folder in packages]
    references = {SCENES_DIR: f"package://{SCENES_DIR.name}/"} | dict.fromkeys(
        (*data, *packages), "package://"
    )
    for folder, reference in references.items():
        for path in dict.fromkeys((folder, folder.resolve())):
            text = text.replace(f"{path}{os.sep}", reference)
    return PATH.sub(r"\1", text)
