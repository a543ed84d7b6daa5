"""The display options of the map, and what was computed for it: a comparison, a cell's candidates."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from symgrasp.feasibility.cell import Cell
from symgrasp.feasibility.color_by import ColorBy
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.feasibility.refined import Refined
from symgrasp.reason import Reason
from symgrasp.survey.success import PoseNoise

from .requests import (
    CompareRequest,
    Comparison,
    ElbowMotions,
    ElbowRequest,
    ExplainRequest,
    ExplainResult,
    MapRequest,
    Probability,
    ProbabilityRequest,
    Request,
    Windows,
    WindowsRequest,
)

__all__ = ["NOISE", "MapViewState", "RollChoice"]

NOISE = PoseNoise(position=0.005, tilt=np.deg2rad(2.0).item())
"""How uncertain the object's pose is at first: by 5 mm and 2°."""


class RollChoice(Enum):
    """Which of the two rolls a map shows; the values are labels of the page."""

    EITHER = "either"
    ZERO = "0°"
    HALF_TURN = "180°"

    def rolls(self, m: FeasibilityMap) -> np.ndarray:
        """Return the index (H, A) of the roll shown: of either, the one with the furthest reason."""
        if self is RollChoice.EITHER:
            return (m.reason + np.nan_to_num(m.clearance)).argmax(axis=0)
        return self._rolls(m.reason.shape)

    def reason(self, m: FeasibilityMap) -> np.ndarray:
        """Return the reasons (H, A) that are shown."""
        return self.of(m, m.reason)

    def values(self, m: FeasibilityMap, color_by: ColorBy) -> np.ndarray:
        """Return the values (H, A) of a colouring that are shown, in `ColorBy.unit`."""
        return self.of(m, m.values(color_by))

    def certified(self, m: FeasibilityMap) -> np.ndarray | None:
        """Return which cells (H, A) are proven to hold as a whole; None where the map does not know.

        Of either roll, none is feasible anywhere in a cell that both are proven infeasible in.
        """
        return None if m.certified is None else self._certified(self.rolls(m), m.feasible, m.certified)

    def parts(self, parts: Refined) -> tuple[np.ndarray, np.ndarray]:
        """Return the reasons (H, A) that are shown of the parts of cells, and which of them are proven."""
        rolls = parts.reason.argmax(axis=0) if self is RollChoice.EITHER else self._rolls(parts.reason.shape)
        return _taken(rolls, parts.reason), self._certified(rolls, parts.feasible, parts.certified)

    def _certified(self, rolls: np.ndarray, feasible: np.ndarray, certified: np.ndarray) -> np.ndarray:
        shown = _taken(rolls, certified)
        if self is RollChoice.EITHER:
            shown &= _taken(rolls, feasible) | certified.all(axis=0)
        return shown

    def _rolls(self, shape: tuple[int, ...]) -> np.ndarray:
        """Return the index (H, A) of the one roll that is chosen, for cells (R, H, A)."""
        return np.full(shape[1:], 0 if self is RollChoice.ZERO else 1)

    def of(self, m: FeasibilityMap, cells: np.ndarray) -> np.ndarray:
        """Select from cells (R, H, A) of both rolls those (H, A) that are shown."""
        return _taken(self.rolls(m), cells)

    def roll(self, m: FeasibilityMap, row: int, column: int) -> int:
        """Return the index of the roll that is shown at a cell."""
        return int(self.rolls(m)[row, column])


def _taken(rolls: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Select from cells (R, H, A) those (H, A) of the given rolls."""
    return np.take_along_axis(cells, rolls[None], axis=0)[0]


@dataclass(frozen=True)
class MapViewState:
    """How one browser shows the map.

    Attributes:
        roll: the rolls shown.
        color_by: what the colours stand for.
        handprint: whether the handprint of the picked grasp is drawn.
        compare: whether the shifted map is compared with one computed from scratch.
        comparison: the newest result of that.
        explained: the candidates of the cell that was picked last.
        candidate: index of the candidate shown; None for the default, see `State.candidate`.
        rolls_apart: whether each roll has a map of its own as well.
        patterns: whether colours of cells have patterns over them, which tell them apart without colour.
        hovered: the cell of the unshifted map that is pointed at.
        noise: how uncertain the object's pose is where the colours show probabilities.
        probability: the newest result of that.
        windows: how wide the windows of cells are, the newest result.
        moves_elbow: whether the elbow of the arm that holds the object can be moved.
        elbow_motions: how it may move at a cell, the newest result.
        elbow: where it was moved to, the redundancy (rad); None where it was not.
    """

    roll: RollChoice = RollChoice.EITHER
    color_by: ColorBy = ColorBy.REASON
    handprint: bool = False
    compare: bool = False
    comparison: Comparison | None = None
    explained: ExplainResult | None = None
    candidate: int | None = None
    rolls_apart: bool = False
    patterns: bool = False
    hovered: Cell | None = None
    noise: PoseNoise = NOISE
    probability: Probability | None = None
    windows: Windows | None = None
    moves_elbow: bool = False
    elbow_motions: ElbowMotions | None = None
    elbow: float | None = None

    @property
    def input_values(self) -> tuple[object, ...]:
        """Everything that widgets show and can change."""
        return (
            self.roll, self.color_by, self.handprint, self.compare, self.candidate, self.rolls_apart,
            self.patterns,
            self.noise, self.moves_elbow, self.elbow,
        )  # fmt: skip

    def missing_request(self, request: MapRequest, delta: float, cell: Cell | None) -> Request | None:
        """Return the first request about a map whose result is missing.

        Args:
            request: the map.
            delta: turn of the object (rad).
            cell: the picked cell of the map before it is shifted.
        """
        compare = CompareRequest(request, delta)
        if self.compare and (self.comparison is None or self.comparison.request != compare):
            return compare
        if cell is not None:
            explain = ExplainRequest(request, cell)
            if self.explained is None or self.explained.request != explain:
                return explain
            elbow = ElbowRequest(request, cell)
            known = self.elbow_motions and self.elbow_motions.request == elbow
            if self.moves_elbow and not known and self.explained.explanation.reason == Reason.FEASIBLE:
                return elbow
        if self.color_by is ColorBy.PROBABILITY and self.probability_of(request) is None:
            return ProbabilityRequest(request, self.noise)
        if self.color_by is ColorBy.WINDOW and self.windows_of(request) is None:
            return WindowsRequest(request)
        return None

    def windows_of(self, request: MapRequest) -> Windows | None:
        """Return how wide the windows of a map's cells are, if that is shown and known."""
        found = self.windows if self.color_by is ColorBy.WINDOW else None
        return found if found and found.request == WindowsRequest(request) else None

    def probability_of(self, request: MapRequest) -> Probability | None:
        """Return how probable the grasps of a map are, if that is shown and known."""
        found = self.probability if self.color_by is ColorBy.PROBABILITY else None
        return found if found and found.request == ProbabilityRequest(request, self.noise) else None

    def with_compare(self, compare: bool) -> MapViewState:
        """Turn the comparison with a recomputed map on or off."""
        return replace(self, compare=compare, comparison=self.comparison if compare else None)

    def with_candidate(self, candidate: int) -> MapViewState:
        """Show a candidate by its index among the explained ones; 0 is the best."""
        count = len(self.explained.explanation.candidates) if self.explained else 0
        return replace(self, candidate=int(np.clip(candidate, 0, count - 1)) if count else None, elbow=None)

    def with_result(
        self, result: Comparison | ExplainResult | Probability | Windows | ElbowMotions
    ) -> MapViewState:
        """Store a result about the map."""
        if isinstance(result, Probability):
            return replace(self, probability=result)
        if isinstance(result, Windows):
            return replace(self, windows=result)
        if isinstance(result, ElbowMotions):
            return replace(self, elbow_motions=result)
        if isinstance(result, Comparison):
            return replace(self, comparison=result if self.compare else None)
        # A candidate without an explanation was restored by an undo: keep it, and where its elbow was.
        if self.explained is None:
            return replace(self, explained=result)
        return replace(self, explained=result, candidate=None, elbow=None)

    def without_results(self) -> MapViewState:
        """Drop what was computed."""
        return replace(
            self, comparison=None, explained=None, hovered=None, probability=None, windows=None,
            elbow_motions=None,
        )  # fmt: skip

    def for_another_scene(self) -> MapViewState:
        """Return it for another scene: both rolls, the same display options, nothing computed."""
        return MapViewState(
            color_by=self.color_by,
            handprint=self.handprint,
            compare=self.compare,
            rolls_apart=self.rolls_apart,
            patterns=self.patterns,
            noise=self.noise,
            moves_elbow=self.moves_elbow,
        )

    def for_another_cell(self) -> MapViewState:
        """Return it for another picked cell: the default candidate, the elbow as it has it."""
        return replace(self, candidate=None, elbow=None)
