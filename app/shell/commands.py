"""What a person does with the map, or a survey, as the page sends it: JSON with the name of the deed in ``do``."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

import msgspec

from symgrasp.feasibility.cell import Cell

from ..state import changes, survey_changes
from ..state.state import State

__all__ = ["LONGEST", "Command", "decode"]

LONGEST = 200
"""Longest message (bytes)."""

Index = Annotated[int, msgspec.Meta(ge=0, lt=1 << 16)]
Angle = Annotated[float, msgspec.Meta(ge=-7.0, le=7.0)]


class _Deed(msgspec.Struct, tag_field="do", forbid_unknown_fields=True, frozen=True):
    """What is common to all of them."""

    @property
    def key(self) -> str | None:
        """Key of a value that a later message replaces; None for an event."""
        return None

    @property
    def origin(self) -> str:
        """What the change comes from; see `app.panels.actions.Actions.change`."""
        return ""

    def applied(self, state: State) -> State:
        """Return the state after it."""
        raise NotImplementedError


class Pick(_Deed, frozen=True, tag="pick"):
    """Picks a cell (row, column) of the map before it is shifted."""

    row: Index
    column: Index

    def applied(self, state: State) -> State:
        """Return the state with that grasp; a cell of a map that is no longer shown is ignored."""
        return changes.choose_surface_cell(state, self.row, self.column) if _has(state, self) else state


class Turn(_Deed, frozen=True, tag="turn"):
    """Turns the object to δ (rad)."""

    delta: Angle

    @property
    def key(self) -> str | None:
        """Key of the newest δ."""
        return "turn"

    @property
    def origin(self) -> str:
        """A drag of the map."""
        return "map"

    def applied(self, state: State) -> State:
        """Return the state with the object turned, as the slider does it."""
        return changes.turn(state, self.delta)


class Hover(_Deed, frozen=True, tag="hover"):
    """Points at a cell (row, column) of the map before it is shifted."""

    row: Index
    column: Index

    @property
    def key(self) -> str | None:
        """Key of the newest cell."""
        return "hover"

    def applied(self, state: State) -> State:
        """Return the state that previews the grasp."""
        if not _has(state, self) or state.result is None:
            return state
        roll = state.map_view.roll.roll(state.result.map, self.row, self.column)
        cell = Cell(roll, self.row, self.column)
        return replace(state, map_view=replace(state.map_view, hovered=cell))


class Leave(_Deed, frozen=True, tag="leave"):
    """Points at no cell any more."""

    @property
    def key(self) -> str | None:
        """Key of the newest cell."""
        return "hover"

    def applied(self, state: State) -> State:
        """Return the state without a preview."""
        return replace(state, map_view=replace(state.map_view, hovered=None))


class Place(_Deed, frozen=True, tag="place"):
    """Chooses a place of the survey that is shown, by its index, as a click on it in the 3D view does."""

    index: Index

    def applied(self, state: State) -> State:
        """Return the state with the object or the robot there; a place that is no longer shown is ignored."""
        return survey_changes.choose_place(state, self.index)


Command = Pick | Turn | Hover | Leave | Place

_decoder = msgspec.json.Decoder(Command)


def decode(data: str | bytes) -> Command:
    """Decode a message.

    Raises:
        ValueError: it is none of these, or too long.
    """
    if not isinstance(data, str) or len(data) > LONGEST:
        raise ValueError("a message that is too long, or no text")
    return _decoder.decode(data)


def _has(state: State, cell: Pick | Hover) -> bool:
    """Return whether the map that is shown has that cell."""
    if state.result is None:
        return False
    grid = state.result.map.manifold
    return cell.row < grid.heights and cell.column < grid.angles
