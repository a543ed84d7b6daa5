"""The map that is shown as a picture file with axes, title and legend, for papers and slides."""

from __future__ import annotations

import re
import threading
from collections.abc import Callable, Mapping

import numpy as np

from symgrasp.errors import InputError
from symgrasp.feasibility import pictures
from symgrasp.feasibility.color_by import ColoredMap, Swatch
from symgrasp.object.manifold import turn_text

from ..state.map_view_state import RollChoice
from ..state.state import State
from .cell_colors import colored_map
from .marks import marks_of
from .palette import PRINTS
from .prints import hand_color, print_index, print_names, shown_prints

__all__ = ["FORMATS", "map_picture", "picture_name"]

FORMATS: Mapping[str, Callable] = {"PNG": pictures.to_png, "SVG": pictures.to_svg}
"""Label of a format on the page → function that encodes a figure in it."""

_DRAWING = threading.Lock()
"""Held while drawing: Matplotlib is not thread-safe."""


def picture_name(state: State, kind: str) -> str:
    """Return a file name for the picture, with the ending of its format (a key of `FORMATS`)."""
    stem = "_".join([state.scene.name, state.task, state.arm, state.map_view.color_by])
    return re.sub(r"\W+", "_", stem) + f".{kind.lower()}"


def map_picture(state: State, kind: str) -> bytes:
    """Draw the map that is shown and return the content of the file.

    Args:
        state: the state.
        kind: format of the picture, a key of `FORMATS`.

    Raises:
        InputError: there is no map for the object's pose yet.
    """
    m = state.map
    if m is None or not state.is_current:
        raise InputError("page", "map", "none for this pose yet", "a computed map")
    colored = _with_prints(colored_map(m, state.map_view.roll, state.map_view.color_by), state)
    roll = "either roll" if state.map_view.roll is RollChoice.EITHER else f"roll {state.map_view.roll.value}"
    title = f"{state.scene.name} · {state.task} · {state.arm}"
    if state.delta:
        title += f" · turned by {turn_text(state.delta)}"
    profile = state.scene.profile
    marks = [(mark.h, mark.theta) for mark in marks_of(state)]
    panel = ColoredMap(colored.index[None], colored.colors, colored.swatches, colored.scale)
    with _DRAWING:
        figure = pictures.draw_map(
            panel, (profile.h_min, profile.h_max), m.manifold.theta_start, title, (roll,), marks
        )
        return FORMATS[kind](figure)


def _with_prints(colored: ColoredMap, state: State) -> ColoredMap:
    """Return a coloured map with the handprints over it."""
    prints = shown_prints(state)
    if not prints:
        return colored
    over = print_index(prints)
    index = np.where(over > 0, len(colored.colors) + over, colored.index)
    swatches = [
        Swatch("#{:02x}{:02x}{:02x}".format(*PRINTS[hand_color(k)]), f"hand of {name}", int(cells.sum()))
        for k, (name, cells) in enumerate(zip(print_names(state), prints, strict=True))
    ]
    return ColoredMap(
        index, np.vstack([colored.colors, PRINTS]), (*colored.swatches, *swatches), colored.scale
    )
