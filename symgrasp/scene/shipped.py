"""The scenes that come with the package; names and descriptions, without building any."""

from __future__ import annotations

from pathlib import Path

from symgrasp.files import SCENES_DIR, parse_yaml

__all__ = ["list_scenes", "shipped_scenes"]


def shipped_scenes() -> dict[str, Path]:
    """Return the scenes that come with the package: name → file, in alphabetical order."""
    return {path.stem: path for path in sorted(SCENES_DIR.glob("*.yaml"))}


def list_scenes() -> dict[str, str]:
    """Return what the shipped scenes show: name → description in one line, in order."""
    return {name: _description(path) for name, path in shipped_scenes().items()}


def _description(path: Path) -> str:
    return parse_yaml(path.read_text(encoding="utf-8")).get("description", "")
