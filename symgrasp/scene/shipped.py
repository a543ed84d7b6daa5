"""The scenes that come with the package; names and descriptions, without building any."""

from __future__ import annotations

from pathlib import Path

from symgrasp.files import SCENES_DIR, parse_yaml
from symgrasp.references import package_dirs

__all__ = ["extra_of", "list_scenes", "missing_extra", "shipped_scenes"]

EXTRAS = {"example-robot-data": "robots", "fourier_robot_descriptions": "robots"}
"""Package that some shipped scenes take files from → extra of this package that installs it."""


def shipped_scenes() -> dict[str, Path]:
    """Return the scenes that come with the package: name → file, in alphabetical order."""
    return {path.stem: path for path in sorted(SCENES_DIR.glob("*.yaml"))}


def list_scenes() -> dict[str, str]:
    """Return what the shipped scenes show: name → description in one line, in order."""
    return {name: _description(path) for name, path in shipped_scenes().items()}


def extra_of(path: Path) -> str | None:
    """Return the extra of this package that installs the robots of a shipped scene, None if it needs none."""
    return next((EXTRAS[package] for package in _packages(path)), None)


def missing_extra(path: Path) -> str | None:
    """Return the extra that a shipped scene needs and that is not installed, None if there is none."""
    return next((EXTRAS[name] for name in _packages(path) if not package_dirs(f"package://{name}/")), None)


def _packages(path: Path) -> list[str]:
    """Return the packages of extras that a shipped scene takes files from."""
    text = path.read_text(encoding="utf-8")
    return [package for package in EXTRAS if f"package://{package}/" in text]


def _description(path: Path) -> str:
    return parse_yaml(path.read_text(encoding="utf-8")).get("description", "")
