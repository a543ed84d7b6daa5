"""The map as a page shows it, from the messages that the page gets."""

from __future__ import annotations

import hashlib
import json
from typing import Any

import numpy as np

from app.html.map import COLUMNS
from app.shell.map_parts import map_parts
from app.state.state import State

GREY = np.array([236, 238, 241])
"""What cells of an old map are blended with."""


class ShownMap:
    """The newest message of each kind.

    Attributes:
        on_cells: called when another map arrives.
    """

    def __init__(self) -> None:
        self._heads: dict[str, dict[str, Any]] = {}
        self._data: dict[str, bytes] = {}
        self._arrived: dict[str, tuple[dict[str, Any], bytes]] = {}
        self.on_cells = lambda: None
        self._digest: str | None = ""

    def take(self, message: bytes) -> None:
        """Take a message; see `app.shell.map_parts`."""
        length = int.from_bytes(message[:4], "little")
        head = json.loads(message[4 : 4 + length])
        kind = f"{head['kind']} {head['layer']}" if "layer" in head else head["kind"]
        self._arrived[kind] = head, message[4 + length :]
        if head["kind"] != "look":
            return
        self._heads |= {kind: head for kind, (head, _) in self._arrived.items()}
        self._data |= {kind: data for kind, (_, data) in self._arrived.items()}
        if "cells" in self._arrived:
            self.on_cells()
        self._arrived.clear()
        self._digest = None

    @property
    def look(self) -> dict[str, Any]:
        return self._heads.get("look", {"title": "", "legend": [], "marks": [], "delta": 0.0, "busy": True})

    @property
    def title(self) -> str:
        """As the page writes it."""
        return " — ".join(filter(None, (self.look["title"], self.look.get("age"))))

    @property
    def legend(self) -> list[str]:
        return [f"{label}: {cells}" for _, label, cells in self.look["legend"]] + [
            label for _, label in self._heads.get("prints", {}).get("legend", [])
        ]

    @property
    def has_prints(self) -> bool:
        return bool(self._data.get("prints"))

    @property
    def digest(self) -> str:
        """Of the picture; empty while there is none."""
        if self._digest is None:
            picture = self.picture()
            self._digest = "" if picture is None else hashlib.sha256(picture.tobytes()).hexdigest()
        return self._digest

    def picture(self) -> np.ndarray | None:
        """The colours (H, COLUMNS, 3) of the map, the highest cells first; None while there is none."""
        return self._picture("cells", self.look)

    def layer(self, k: int) -> np.ndarray:
        """The colours of a map of the stack."""
        picture = self._picture(f"cells {k}", self.look["layers"][k])
        assert picture is not None
        return picture

    def layer_prints(self, k: int) -> np.ndarray:
        """The hand (H, A) that is over each cell of a map of the stack, as an index into the colours."""
        head = self._heads[f"prints {k}"]
        return np.frombuffer(self._data[f"prints {k}"], np.uint8).reshape(head["heights"], head["angles"])

    def _picture(self, kind: str, look: dict[str, Any]) -> np.ndarray | None:
        head = self._heads.get(kind)
        if not head or not head["heights"]:
            return None
        size = head["heights"] * head["angles"]
        data = np.frombuffer(self._data[kind], np.uint8)
        heights, angles = head.get("parts", (0, 0))
        assert len(data) == 6 * size + heights * angles
        index = data[2 * size : 3 * size].reshape(head["heights"], head["angles"])
        if heights:
            index = data[6 * size :].reshape(heights, angles)
        theta = -np.pi + (np.arange(COLUMNS) + 0.5) * (2 * np.pi / COLUMNS) + look["delta"]
        share = np.mod(theta - head["start"], 2 * np.pi) / (2 * np.pi)
        colors = np.array([[int(c[k : k + 2], 16) for k in (1, 3, 5)] for c in head["colors"]])
        if look["stale"]:
            colors = np.round(0.3 * colors + 0.7 * GREY)
        columns = np.floor(share * index.shape[1]).astype(int) % index.shape[1]
        return colors.astype(np.uint8)[index[::-1, columns]]


def shown(state: State) -> ShownMap:
    """Return what a page shows of a state."""
    page = ShownMap()
    for message in map_parts(state).values():
        page.take(message)
    return page
