"""The surveys that come with the package; names and descriptions, without building any."""

from __future__ import annotations

from pathlib import Path

from symgrasp.files import SCENES_DIR, parse_yaml

__all__ = ["list_surveys", "shipped_surveys"]


def shipped_surveys() -> dict[str, Path]:
    """Return the surveys that come with the package: name → file, in alphabetical order."""
    return {path.stem: path for path in sorted((SCENES_DIR / "surveys").glob("*.yaml"))}


def list_surveys() -> dict[str, str]:
    """Return what the shipped surveys show: name → description in one line, in order."""
    found = {name: parse_yaml(path.read_text(encoding="utf-8")) for name, path in shipped_surveys().items()}
    return {name: content.get("description", "") for name, content in found.items()}
