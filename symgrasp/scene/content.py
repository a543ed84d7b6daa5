"""The content of a scene file as plain data: its hash, and the files that it refers to."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from typing import Any

__all__ = ["content_sha256", "file_references"]


def content_sha256(content: Mapping[str, Any]) -> str:
    """Return the SHA-256 of plain data as canonical JSON."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def file_references(content: Mapping[str, Any]) -> Iterator[tuple[str, dict[str, Any], str]]:
    """Yield every reference to a file in the content of a scene that `SceneFile` accepts.

    Yields:
        The field, such as ``robots[0].urdf``, the mapping it is in, and its key there.
    """
    holders: list[tuple[str, dict[str, Any]]] = [("object", content["object"])]
    for i, robot in enumerate(content["robots"]):
        holders.append((f"robots[{i}]", robot))
        arms = [(f"robots[{i}]", robot)]
        arms += [(f"robots[{i}].arms[{k}]", arm) for k, arm in enumerate(robot.get("arms") or [])]
        holders += [
            (f"{field}.hand", arm["hand"]) for field, arm in arms if isinstance(arm.get("hand"), dict)
        ]
    holders += [(f"obstacles[{i}]", obstacle) for i, obstacle in enumerate(content.get("obstacles") or [])]
    for field, holder in holders:
        for key in ("urdf", "srdf", "mesh"):
            if holder.get(key) is not None:
                yield f"{field}.{key}", holder, key
