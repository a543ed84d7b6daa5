"""The scenes that come with the package."""

from __future__ import annotations

from pathlib import Path

from symgrasp.files import SCENES_DIR

__all__ = ["shipped_scenes"]


def shipped_scenes() -> dict[str, Path]:
    """Return the scenes that come with the package: name → file, in alphabetical order."""
    return {path.stem: path for path in sorted(SCENES_DIR.glob("*.yaml"))}
