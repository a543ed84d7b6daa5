"""What an uploaded file is, whatever button it came through."""

from __future__ import annotations

from typing import Literal

from symgrasp.files import LARGEST_YAML, parse_json, parse_yaml
from symgrasp.plan.plan import LARGEST_PLAN

from .archives import is_archive, names_in

__all__ = ["FileKind", "file_kind"]

FileKind = Literal["plan", "scene"]

PLAN_KEYS, SCENE_KEYS = {"kind", "scene", "tasks"}, {"robots", "object", "tasks"}
"""Keys that such a file has and the other has not all."""


def file_kind(content: bytes) -> FileKind | None:
    """Return what a file is by its keys; None where it is neither a plan nor a scene."""
    if is_archive(content):
        described = [path for path in names_in(content) if path.suffix.lower() in (".json", ".yaml", ".yml")]
        highest = min(described, key=lambda path: len(path.parts), default=None)
        return "plan" if highest and highest.suffix.lower() == ".json" else "scene"
    try:
        if content.lstrip().startswith(b"{"):
            data = parse_json(content) if len(content) <= LARGEST_PLAN else None
        else:
            data = parse_yaml(content.decode("utf-8")) if len(content) <= LARGEST_YAML else None
    except (ValueError, RecursionError):
        return None
    if not isinstance(data, dict):
        return None
    return "plan" if data.keys() >= PLAN_KEYS else "scene" if data.keys() >= SCENE_KEYS else None
