"""What a person does with maps or a survey, as the page sends it: JSON, the name of the deed in ``do``."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Literal

import msgspec

from symgrasp.feasibility.cell import Cell
from symgrasp.object.manifold import ROLLS

from ..state import changes
from ..state.plans import plan_changes
from ..state.state import State
from ..state.surveys import survey_changes

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
    """Picks a cell (row, column) of the map before it is shifted, with a roll or the one that is shown."""

    row: Index
    column: Index
    roll: Annotated[int, msgspec.Meta(ge=0, lt=len(ROLLS))] | None = None

    def applied(self, state: State) -> State:
        """Return the state with that grasp; a cell of a map that is no longer shown is ignored."""
        if not _has(state, self):
            return state
        after = changes.choose_surface_cell(state, self.row, self.column)
        return replace(after, pick=replace(after.pick, roll=self.roll)) if after.pick else after


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


class Slide(_Deed, frozen=True, tag="slide"):
    """Slides the map of a task of the stack, by its index (see `app.shell.layers.Layer.step`), to δ (rad)."""

    step: Index
    delta: Angle

    @property
    def key(self) -> str | None:
        """Key of the newest δ of that task."""
        return f"slide {self.step}"

    @property
    def origin(self) -> str:
        """A drag of the map."""
        return f"map, task {self.step}"

    def applied(self, state: State) -> State:
        """Return the state with that map slid; one that is no longer shown is ignored."""
        results = state.plan_results
        count = len(results.plan.plan.tasks) if results.plan else len(results.maps)
        if results.kind != "sequential" or self.step >= count:
            return state
        return plan_changes.slide_map(state, self.step, self.delta)


class Move(_Deed, frozen=True, tag="move"):
    """Moves a hand of a plan's task, both by their index, to a cell (row, column) in the object's frame."""

    step: Index
    hand: Index
    row: Index
    column: Index

    @property
    def key(self) -> str | None:
        """Key of the newest cell of that hand."""
        return f"move {self.step} {self.hand}"

    @property
    def origin(self) -> str:
        """A drag of the map."""
        return f"map, hand {self.step} {self.hand}"

    def applied(self, state: State) -> State:
        """Return the state with that hand moved; one that is no longer shown is ignored."""
        plan, grid = state.plan, state.scene.manifold
        if plan is None or plan.plan.kind == "sequential" or self.step >= len(plan.plan.tasks):
            return state
        known = self.hand < len(plan.plan.tasks[self.step].holds)
        if not known or self.row >= grid.heights or self.column >= grid.angles:
            return state
        return plan_changes.move_hand(state, self.step, self.hand, self.row, self.column)


class Slid(_Deed, frozen=True, tag="slid"):
    """Slides the maps of all tasks of a sequence by a share of their δ."""

    share: Annotated[float, msgspec.Meta(ge=0.0, le=1.0)]

    @property
    def key(self) -> str | None:
        """Key of the newest share."""
        return "slid"

    @property
    def origin(self) -> str:
        """A drag of the map."""
        return "map, all tasks"

    def applied(self, state: State) -> State:
        """Return the state with the maps slid, where a sequence is shown."""
        if state.plan_results.kind != "sequential":
            return state
        return plan_changes.change_plan_results(state, lambda results: results.slid(self.share))


class Act(_Deed, frozen=True, tag="act"):
    """Does what a step of the tour needs of the page beside the map; see `app.server.session.tour`."""

    name: Literal["story", "log", "compare", "alone", "plan", "climb", "replay", "motion", "play"]

    def applied(self, state: State) -> State:
        """Return the state as it is: actions are more than changes."""
        return state


class Show(_Deed, frozen=True, tag="show"):
    """Shows a task of the plan by its index."""

    step: Index

    def applied(self, state: State) -> State:
        """Return the state that shows it."""
        return plan_changes.show_step(state, self.step)


class AsPlanned(_Deed, frozen=True, tag="planned"):
    """Puts maps and hands that were moved back to where the plan has them."""

    def applied(self, state: State) -> State:
        """Return the state with all of them back."""
        return plan_changes.as_planned(state)


class Press(_Deed, frozen=True, tag="press"):
    """Presses a pointer anywhere on the page: changes until its release are one drag."""

    number: Annotated[int, msgspec.Meta(ge=1, lt=1 << 32)]

    def applied(self, state: State) -> State:
        """Return the state during the press."""
        return replace(state, press=self.number)


class Release(_Deed, frozen=True, tag="release"):
    """Releases it."""

    def applied(self, state: State) -> State:
        """Return the state after the press."""
        return replace(state, press=0)


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


Command = Pick | Turn | Hover | Slide | Slid | Act | Move | Show | AsPlanned | Press | Release | Leave | Place

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
