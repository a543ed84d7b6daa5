"""A scene whose arm has plans, but no motion: it does not get out of where it is at home."""

from __future__ import annotations

from typing import Any

import yaml

from symgrasp.files import SCENES_DIR


def caught_content() -> dict[str, Any]:
    """The content of a scene with a Panda whose forearm is in a window at home; its hand does not fit in."""
    content = yaml.safe_load((SCENES_DIR / "bottle_on_table.yaml").read_text(encoding="utf-8"))
    content |= {"name": "caught", "map": {"heights": 4, "angles": 8, "redundancy": 8}}
    x, z, inner, outer = 0.08, 0.68, 0.11, 0.2
    middle, width = (inner + outer) / 2, outer - inner
    for name, size, y, up in (
        ("lintel", (2 * outer, width), 0.0, middle), ("sill", (2 * outer, width), 0.0, -middle),
        ("left", (width, 2 * inner), middle, 0.0), ("right", (width, 2 * inner), -middle, 0.0),
    ):  # fmt: skip
        place = {"position": [x, y, z + up]}
        content["obstacles"].append({"name": name, "box": [0.02, *size], "pose": place})
    return content
