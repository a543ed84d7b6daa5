"""The map as it is shown, as a file: with axes, title and legend, for papers and slides."""

from __future__ import annotations

import re
import threading
from collections.abc import Callable, Mapping

import numpy as np

from symgrasp.errors import InputError
from symgrasp.feasibility import pictures
from symgrasp.feasibility.color_by import ColoredMap, Swatch

from ..state.map_view_state import RollChoice
from ..state.state import State
from .cell_colors import coloured
from .marks import marks_of
from .palette import PRINTS
from .prints import hand_color, print_index, print_names, shown_prints

__all__ = ["FORMATS", "map_picture", "picture_name"]

FORMATS: Mapping[str, Callable] = {"PNG": pictures.to_png, "SVG": pictures.to_svg}
"""What the page calls a format → what writes it."""

_ONE_AT_A_TIME = threading.Lock()
"""Matplotlib is not made for several threads."""


def picture_name(state: State, kind: str) -> str:
    """Return a name for the file."""
    stem = "_".join([state.scene.name, state.task, state.arm, state.map_view.color_by])
    return re.sub(r"\W+", "_", stem) + f".{kind.lower()}"


def map_picture(state: State, kind: str) -> bytes:
    """Draw the map as it is shown.

    Args:
        state: the state.
        kind: one of `FORMATS`.

    Raises:
        InputError: there is no map yet.
    """
    m = state.map
    if m is None or not state.is_fresh:
        raise InputError("page", "map", "none for this pose yet", "a computed map")
    found = _with_prints(coloured(m, state.map_view.roll, state.map_view.color_by), state)
    roll = "either roll" if state.map_view.roll is RollChoice.EITHER else f"roll {state.map_view.roll.value}"
    title = f"{state.scene.name} · {state.task} · {state.arm}"
    if state.delta:
        title += f" · turned by {np.rad2deg(state.delta):.5g}°"
    profile = state.scene.profile
    marks = [(mark.h, mark.theta) for mark in marks_of(state)]
    panel = ColoredMap(found.index[None], found.colors, found.swatches, found.scale)
    with _ONE_AT_A_TIME:
        figure = pictures.draw_map(
            panel, (profile.h_min, profile.h_max), m.manifold.theta_start, title, (roll,), marks
        )
        return FORMATS[kind](figure)


def _with_prints(found: ColoredMap, state: State) -> ColoredMap:
    """Lay the prints over a coloured map."""
    prints = shown_prints(state)
    if not prints:
        return found
    over = print_index(prints)
    index = np.where(over > 0, len(found.colors) + over, found.index)
    swatches = [
        Swatch("#{:02x}{:02x}{:02x}".format(*PRINTS[hand_color(k)]), f"hand of {name}", int(cells.sum()))
        for k, (name, cells) in enumerate(zip(print_names(state), prints, strict=True))
    ]
    return ColoredMap(index, np.vstack([found.colors, PRINTS]), (*found.swatches, *swatches), found.scale)
