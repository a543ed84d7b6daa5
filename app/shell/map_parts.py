"""The map as the page draws it: messages with numbers for each cell, of which only changed ones are sent.

A message is binary: the length of a JSON text (4 bytes, little-endian), that text padded to a multiple of
four bytes, and arrays. Its ``kind`` says what it is about:

``cells``
    the map that was computed, before it is shifted by δ. Arrays over its grid (rows from the lowest height):
    clearance in 0.1 mm (uint16, `UNKNOWN` where there is none), then as uint8 the index of the colour, the
    reason and the roll that is shown, and which rolls are feasible (bit r for roll r). Where the scene
    asks for a resolution, ``parts`` says into how many the grid is split, and the last array, over them, is
    the index of the colour of each.
``prints``
    the cells under the hands, in the frame of the turned object: the index of the colour (uint8).
``look``
    everything else, δ among it: no arrays. It comes last, and what came before it is shown with it.

Cells and prints with a ``layer`` are those of a map of the stack below the main one, see `app.shell.layers`.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from symgrasp.feasibility.color_by import ColorBy
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.object.manifold import wrap
from symgrasp.reason import Reason

from ..render.cell_colors import colored_map, colored_parts
from ..render.holds import hand_holds
from ..render.marks import marks_of
from ..render.palette import OVERLAP, PRINTS
from ..render.patterns import PLAIN, cell_patterns
from ..render.prints import apart_text, hand_color, print_index, print_names, shown_prints
from ..render.weak_cache import cached_with_first
from ..state.map_view_state import RollChoice
from ..state.requests import CompareRequest
from ..state.state import State
from .layers import Layer, LayerKind, layers_of

__all__ = ["UNKNOWN", "map_parts"]

UNKNOWN = 0xFFFF
"""Clearance of a cell that has none."""


def map_parts(state: State) -> dict[str, bytes]:
    """Return the messages that show the map of a state, by their kind."""
    m, view = state.base_map, state.map_view
    layers = layers_of(state)
    parts = {
        "cells": _cells(m, view.roll, view.color_by) if m else _message("cells", {"heights": 0, "angles": 0}),
        "prints": _prints(state),
    }
    for k, layer in enumerate(layers):
        parts[f"cells {k}"] = _cells(layer.map, layer.roll, ColorBy.REASON, k)
        parts[f"prints {k}"] = _layer_prints(layer, k)
    return parts | {
        "look": _message(
            "look", _look(state) | {"layers": [_layer_look(x) for x in layers]} | _apart(state, layers)
        )
    }


def _message(kind: str, head: dict[str, Any], *arrays: np.ndarray) -> bytes:
    text = json.dumps({"kind": kind, **head}, ensure_ascii=False, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    return len(text).to_bytes(4, "little") + text + b"".join(array.tobytes() for array in arrays)


@cached_with_first
def _cells(m: FeasibilityMap, roll: RollChoice, color_by: ColorBy, layer: int | None = None) -> bytes:
    grid, colored = m.manifold, colored_map(m, roll, color_by)
    clearance = roll.of(m, m.clearance)
    known = np.isfinite(clearance)
    tenths = np.where(known, np.clip(np.round(1e4 * np.where(known, clearance, 0)), 0, UNKNOWN - 1), UNKNOWN)
    head = {
        "heights": grid.heights,
        "angles": grid.angles,
        "low": grid.profile.h_min,
        "high": grid.profile.h_max,
        "start": grid.theta_start,
        "colors": [_hex(color) for color in colored.colors],
        "reasons": [reason.legend for reason in Reason],
        "feasible": int(Reason.FEASIBLE),
        "profile": grid.profile.points.tolist(),
        "patterns": cell_patterns(color_by, lighter=m.certified is not None),
    }
    if layer is not None:
        head["layer"] = layer
    rolls = np.packbits(m.feasible, axis=0, bitorder="little")[0]
    parts: list[np.ndarray] = []
    if (split := colored_parts(m, roll, color_by)) is not None:
        head["parts"] = list(split.index.shape)
        parts.append(split.index)
    return _message(
        "cells",
        head,
        tenths.astype("<u2"),
        colored.index.astype(np.uint8),
        roll.reason(m).astype(np.uint8),
        roll.rolls(m).astype(np.uint8),
        rolls,
        *parts,
    )


def _prints(state: State) -> bytes:
    prints = shown_prints(state)
    if not prints:
        return _message("prints", {"heights": 0, "angles": 0})
    index = print_index(prints).astype(np.uint8)
    legend = [[_hex(PRINTS[hand_color(k)]), f"hand of {name}"] for k, name in enumerate(print_names(state))]
    if OVERLAP in index:
        legend.append([_hex(PRINTS[OVERLAP]), "both hands"])
    colors = [_hex(color) for color in PRINTS]
    heights, angles = index.shape
    return _message(
        "prints", {"heights": heights, "angles": angles, "colors": colors, "legend": legend}, index
    )


def _layer_prints(layer: Layer, k: int) -> bytes:
    if not layer.prints:
        return _message("prints", {"layer": k, "heights": 0, "angles": 0})
    index = print_index(layer.prints).astype(np.uint8)
    heights, angles = index.shape
    colors = [_hex(color) for color in PRINTS]
    return _message("prints", {"layer": k, "heights": heights, "angles": angles, "colors": colors}, index)


def _layer_look(layer: Layer) -> dict[str, Any]:
    """What is said of a map of the stack; ``rolls`` are those that can serve, as bits."""
    either = layer.roll is RollChoice.EITHER
    return {
        "kind": layer.kind,
        "title": layer.title,
        "delta": layer.turn,
        "planned": layer.planned,
        "marks": [[mark.h, float(wrap(mark.theta)), mark.label] for mark in layer.marks],
        "step": layer.step,
        "hand": layer.hand,
        "group": layer.group,
        "rolls": 3 if either else 1 << list(RollChoice).index(layer.roll) - 1,
        "shown": layer.is_shown,
        "color": _hex(PRINTS[hand_color(layer.hand)]) if layer.prints else None,
        "picked": None,
        "holds": [],
        "stale": False,
    }


def _apart(state: State, layers: Sequence[Layer]) -> dict[str, Any]:
    """Say how far the prints of the task that is shown are apart, where its hands are in the stack."""
    moved = state.plan_results.by_hand is not None or bool(state.plan_results.turns)
    said: dict[str, Any] = {"moved": moved}
    if any(layer.kind is LayerKind.HAND for layer in layers):
        if state.climb_step:
            cells = state.climb_step.collisions
            said["apart"] = f"prints share {cells} cells" if cells else "prints are apart"
        else:
            said["apart"] = apart_text(state, state.plan_results.nearest)
    return said


def _look(state: State) -> dict[str, Any]:
    look: dict[str, Any] = {
        "title": f"{state.scene.name} · {state.task} · {state.arm}",
        "busy": not state.is_current or state.busy is not None,
        "stale": not state.is_fresh,
        "age": _age(state),
        "delta": state.delta,
        "dark": state.display.dark,
        "object": state.scene.file.object.name,
        "marks": [[mark.h, float(wrap(mark.theta)), mark.label] for mark in marks_of(state)],
        "picked": [state.base_cell.row, state.base_cell.column] if state.base_cell else None,
        "holds": [[_hex(PRINTS[holds.color]), holds.spans] for holds in hand_holds(state)],
        "scene": state.scene_name,
        "compared": _compared(state),
        "compares": state.map_view.compare,
        "plan": _plan(state),
        "tour": state.tour,
        "patterned": state.map_view.patterns,
        "legend": [],
    }
    if state.base_map:
        colored = colored_map(state.base_map, state.map_view.roll, state.map_view.color_by)
        look["legend"] = [list(swatch) for swatch in colored.swatches]
        indices = {_hex(color): k for k, color in reversed(list(enumerate(colored.colors)))}
        patterns = dict(enumerate(cell_patterns(state.map_view.color_by)))
        look["patterns"] = [patterns.get(indices.get(swatch.color, -1), PLAIN) for swatch in colored.swatches]
        look["counted"] = _counted(state.base_map, state.map_view.roll, state.map_view.color_by)
        look["places"] = state.base_map.reason[0].size
        if colored.scale:
            scale = colored.scale
            look["scale"] = [scale.label, scale.high, [_hex(c) for c in scale.colors[::36]]]
    return look


def _compared(state: State) -> list[int] | None:
    """Return how many cells differ from a map computed from scratch for this turn, and of how many."""
    comparison = state.map_view.comparison
    if comparison is None or comparison.request != CompareRequest(state.request, state.delta):
        return None
    return [comparison.differing, comparison.map.reason.size]


def _plan(state: State) -> dict[str, Any]:
    """Say which plan is shown, and how far it is played."""
    results = state.plan_results
    motion, climb = results.plan and results.plan.motion, results.climb
    return {
        "kind": results.kind,
        "slide": results.slide,
        "playing": results.playing,
        "position": results.position,
        "duration": motion.duration if motion else None,
        "positions": len(climb.steps) if climb else None,
        "seconds": climb.seconds if climb else None,
    }


def _age(state: State) -> str:
    """Say what keeps the map that is shown from being that of the pose; nothing where it is."""
    if state.result and state.is_preliminary:
        known = state.result.map
        return "coarse and preliminary" if known.preliminary else f"preliminary, {len(known.phi)} samples"
    return "of an earlier pose" if state.result and not state.is_fresh else ""


def _counted(m: FeasibilityMap, roll: RollChoice, color_by: ColorBy) -> str:
    """Say what the legend counts."""
    rolls, heights, angles = m.reason.shape
    which = f"the better of its {rolls} rolls" if roll is RollChoice.EITHER else f"roll {roll.value}"
    said = f"{heights * angles} places on the object, each with {which}"
    split = m.refined is not None and color_by.has_parts
    return f"{said}; drawn are the parts that they are split into" if split else said


def _hex(color: np.ndarray) -> str:
    return "#{:02x}{:02x}{:02x}".format(*color)
