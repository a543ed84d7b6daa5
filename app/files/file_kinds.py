"""What an uploaded file is, whatever button it came through."""

from __future__ import annotations

from typing import Literal

from symgrasp.files import LARGEST_YAML, parse_json, parse_yaml

__all__ = ["FileKind", "file_kind"]

FileKind = Literal["plan", "scene"]

PLAN_KEYS, SCENE_KEYS = {"kind", "scene", "tasks"}, {"robots", "object", "tasks"}
"""Keys that such a file has and the other has not all."""


def file_kind(content: bytes) -> FileKind | None:
    """Return what a file is by its keys; None where it is neither a plan nor a scene."""
    if content.startswith(b"PK"):  # an archive
        return "scene"
    try:
        if content.lstrip().startswith(b"{"):
            data = parse_json(content)
        else:
            data = parse_yaml(content.decode("utf-8")) if len(content) <= LARGEST_YAML else None
    except (ValueError, RecursionError):
        return None
    if not isinstance(data, dict):
        return None
    return "plan" if data.keys() >= PLAN_KEYS else "scene" if data.keys() >= SCENE_KEYS else None
