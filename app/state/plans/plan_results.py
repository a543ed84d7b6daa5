"""The results of planners, and which part one browser shows: plan, step of a climb, playback."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from symgrasp.feasibility.cell import Cell
from symgrasp.motion.segments import Motion
from symgrasp.plan.plan import Plan
from symgrasp.planners.bimanual import ClimbStep
from symgrasp.planners.conflicts import Conflict

from ..cached import cached
from ..requests import Maps
from .motion_times import task_times
from .solution_order import PLANNED, SolutionOrder

__all__ = [
    "FIRST_SEED",
    "ClimbReplay",
    "HandsByHand",
    "PlanFileReport",
    "PlanKind",
    "PlanResult",
    "PlanResults",
    "Refusal",
]

PlanKind = Literal["sequential", "bimanual", "handover"]

Playing = Literal["", "arms", "climb"]
"""What is being played."""

FIRST_SEED = 18
"""Default seed of hill climbing: with it, the hands of two robots on the shipped log overlap at first.

With most seeds they start apart, so that there is nothing to replay.
"""

SECONDS_PER_TASK = 2.0
"""Time (s) that the playback of a plan without a motion shows a task for."""

FADE = 0.4
"""Time (s) in which one picture of such a plan fades out, and that in which the next one fades in."""

STEPS_PER_SECOND = 10.0
"""Speed of the replay of a climb."""

SHORTEST_REPLAY = 3.0
"""Shortest duration (s) of the replay of a climb; with few steps it shows each for longer."""

LONGEST_REPLAY = 12.0
"""Longest duration (s) of the replay of a climb; with more steps it skips some."""


@dataclass(frozen=True, eq=False)
class PlanResult:
    """A plan and what is needed to show it, except its maps.

    Attributes:
        plan: the plan.
        prints: for every task of the plan, in order, arm → the cells (H, A) under its hand.
        gaps: for every task of the plan the smallest gap (m) between two prints, negative where they
            overlap, None where one hand holds alone.
        motion: the plan's motion, None where it has none.
    """

    plan: Plan
    prints: tuple[Mapping[str, np.ndarray], ...]
    gaps: tuple[float | None, ...]
    motion: Motion | None = None

    @cached
    def times(self) -> list[tuple[float, float]]:
        """See `task_times`; empty where there is no motion."""
        return task_times(self.plan, self.motion) if self.motion else []


@dataclass(frozen=True)
class HandsByHand:
    """Where a person put the hands of a plan's task.

    Attributes:
        step: index of the task.
        cells: of each hand, in the order of the task's holds, over the grid in the object's frame.
    """

    step: int
    cells: tuple[Cell, ...]


@dataclass(frozen=True)
class Refusal:
    """Why there is no plan.

    Attributes:
        text: the error message.
        conflict: which tasks exclude each other, if that is the reason.
    """

    text: str
    conflict: Conflict | None = None


@dataclass(frozen=True, eq=False)
class ClimbReplay:
    """A hill climbing to replay, and the plan of the complete search on the same maps.

    Attributes:
        task: the task.
        arms: names of its arms.
        seed: of the random choices.
        steps: every position of the hands; at least one.
        found: the plan of the hill climbing, None where it failed.
        exact: the plan of the complete search, None where there is none.
        seconds: that the hill climbing took on maps that were there (s).
    """

    task: str
    arms: tuple[str, ...]
    seed: int
    steps: tuple[ClimbStep, ...]
    found: PlanResult | None
    exact: PlanResult | None
    seconds: float

    @property
    def speed(self) -> float:
        """Steps per second of the replay."""
        count = len(self.steps)
        return max(min(STEPS_PER_SECOND, count / SHORTEST_REPLAY), count / LONGEST_REPLAY)


@dataclass(frozen=True)
class PlanFileReport:
    """The result of verifying a plan from a file.

    Attributes:
        name: of the file.
        checks: how many statements were checked.
        failures: a text for each that does not hold.
    """

    name: str
    checks: int
    failures: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class PlanResults:
    """Everything about plans that a browser shows; a change returns a new one.

    Attributes:
        sequence_method, hands_method: the methods chosen.
        seed: of hill climbing.
        plans: the plans listed so far, best first.
        order: what their list is sorted by.
        index: of the plan that is shown.
        more: whether there may be further plans.
        kind: which planner was run last.
        maps: (task, arm) → map at δ = 0, of those it used, also where there is no plan.
        refusal: why there is no plan.
        climb: the hill climbing, if that was the method.
        frame: index of its step that is shown.
        slide: share of each task's δ by which its map is shifted, 0 to 1.
        turns: index of a task → δ (rad) by which a person slid its map instead.
        by_hand: where a person put the hands of a task; None where they are as planned.
        position: of the playback: time (s) of a plan with a motion, else k at task k.
        speed: of the playback of a motion: seconds of it in a second.
        playing: what is being played.
        opened: the report on the file that was opened last.
        motionless: why plans that were tried before the one with a motion have none.
    """

    sequence_method: str = "best"
    hands_method: str = "exact"
    seed: int = FIRST_SEED
    plans: tuple[PlanResult, ...] = ()
    order: SolutionOrder = PLANNED
    index: int = 0
    more: bool = False
    kind: PlanKind | None = None
    maps: Maps = field(default_factory=dict)
    refusal: Refusal | None = None
    climb: ClimbReplay | None = None
    frame: int | None = None
    slide: float = 1.0
    turns: Mapping[int, float] = field(default_factory=dict)
    by_hand: HandsByHand | None = None
    position: float = 0.0
    speed: float = 1.0
    playing: Playing = ""
    opened: PlanFileReport | None = None
    motionless: tuple[str, ...] = ()

    # -- derived values ---------------------------------------------------------------------

    @property
    def plan(self) -> PlanResult | None:
        """The plan that is shown."""
        return self.plans[self.index] if self.plans else None

    @property
    def last(self) -> int:
        """Index of the plan's last task."""
        return len(self.plan.plan.tasks) - 1 if self.plan else 0

    @property
    def end(self) -> float:
        """The last position of the playback."""
        return self.plan.motion.duration if self.plan and self.plan.motion else float(self.last)

    @property
    def nearest(self) -> int:
        """Index of the task that the playback is nearest to."""
        if self.plan and self.plan.motion:
            return max(sum(start <= self.position for start, _ in self.plan.times) - 1, 0)
        return int(np.clip(np.floor(self.position + 0.5), 0, self.last))

    @property
    def changing(self) -> bool:
        """Whether the picture of a task fades out: how the arms get to the next one is not planned."""
        moves = self.plan is not None and self.plan.motion is not None
        left = (self.nearest + 0.5 - self.position) * SECONDS_PER_TASK
        return self.playing == "arms" and not moves and self.nearest < self.last and left < FADE

    def turn(self, k: int) -> float:
        """Return the angle (rad) by which the map of the k-th task is shifted."""
        delta = self.plan.plan.tasks[k].delta if self.plan else 0.0
        return self.turns.get(k, self.slide * delta)

    def position_of(self, step: int) -> float:
        """Return the position of the playback at a task by its index."""
        if self.plan and self.plan.motion:
            return self.plan.times[int(np.clip(step, 0, self.last))][1]
        return float(step)

    @property
    def input_values(self) -> tuple[object, ...]:
        """All values that widgets show and can change."""
        return (
            self.sequence_method, self.hands_method, self.seed, self.index, self.plans, self.frame,
            self.slide, self.position, self.speed, self.climb, self.turns, self.by_hand,
        )  # fmt: skip

    # -- changes ----------------------------------------------------------------------------

    def cleared(self) -> PlanResults:
        """Drop the results; methods, seed and slide are kept."""
        return PlanResults(
            self.sequence_method, self.hands_method, self.seed, slide=self.slide, speed=self.speed
        )

    def found(
        self,
        kind: PlanKind,
        plans: tuple[PlanResult, ...],
        maps: Maps,
        *,
        more: bool,
        climb: ClimbReplay | None = None,
    ) -> PlanResults:
        """Store the first plans of a planner, at least one."""
        return replace(self.cleared(), kind=kind, plans=plans, maps=maps, more=more, climb=climb, slide=1.0)

    def refused(
        self, kind: PlanKind, refusal: Refusal, maps: Maps, climb: ClimbReplay | None = None
    ) -> PlanResults:
        """Store that a planner has no plan."""
        results = replace(self.cleared(), kind=kind, refusal=refusal, maps=maps, climb=climb)
        return replace(results, frame=len(climb.steps) - 1) if climb else results

    def extended(self, plans: tuple[PlanResult, ...], *, more: bool) -> PlanResults:
        """Add further plans to the list."""
        return replace(self, plans=(*self.plans, *plans), more=more)

    def with_motion(self, index: int, plan: PlanResult, motionless: tuple[str, ...] = ()) -> PlanResults:
        """Put a plan with its motion into the list, in the place of that without, and show it.

        Args:
            index: of the plan in the list.
            plan: the same plan with its motion.
            motionless: why plans that were tried before have none.
        """
        plans = (*self.plans[:index], plan, *self.plans[index + 1 :])
        return replace(self, plans=plans, index=index, position=0.0, playing="", motionless=motionless)

    def at_plan(self, index: int) -> PlanResults:
        """Show another plan of the list by its index."""
        index = int(np.clip(index, 0, len(self.plans) - 1))
        return replace(self.as_planned(), index=index) if self.plans else self

    def at_position(self, position: float) -> PlanResults:
        """Move the playback to a position."""
        position = float(np.clip(position, 0.0, self.end)) if np.isfinite(position) else self.position
        stays = position == self.position and self.frame is None
        return replace(self, position=position, frame=None, by_hand=self.by_hand if stays else None)

    def at_frame(self, frame: int) -> PlanResults:
        """Show a step of the climb by its index."""
        if self.climb is None:
            return self
        frame = int(np.clip(frame, 0, len(self.climb.steps) - 1))
        return replace(self, frame=frame, by_hand=None)

    def as_planned(self) -> PlanResults:
        """Put maps and hands that a person moved back to where the plan has them."""
        return replace(self, turns={}, by_hand=None)

    def slid(self, share: float) -> PlanResults:
        """Shift the maps of all tasks by a share of their δ."""
        return replace(self, slide=share, turns={})

    def play_arms(self) -> PlanResults:
        """Start or pause the playback of the plan; at its end it restarts."""
        if self.playing == "arms" or not self.end:
            return self.paused()
        position = 0.0 if self.position >= self.end else self.position
        return replace(self, playing="arms", position=position, frame=None)

    def play_climb(self) -> PlanResults:
        """Start or pause the replay of the climb; at its end it restarts."""
        if self.playing == "climb" or self.climb is None:
            return self.paused()
        over = self.frame is None or self.frame >= len(self.climb.steps) - 1
        return replace(self, playing="climb", frame=0 if over else self.frame)

    def paused(self) -> PlanResults:
        """Pause the playback."""
        return replace(self, playing="") if self.playing else self

    def advanced(self, seconds: float) -> PlanResults:
        """Advance the playback by a time (s); at its end it pauses."""
        if self.playing == "arms":
            moving = self.plan is not None and self.plan.motion is not None
            results = self.at_position(
                self.position + seconds * (self.speed if moving else 1 / SECONDS_PER_TASK)
            )
            return results if results.position < results.end else results.paused()
        if self.playing == "climb" and self.climb is not None:
            steps = max(1, round(seconds * self.climb.speed))
            results = self.at_frame((self.frame or 0) + steps)
            return results if results.frame != len(self.climb.steps) - 1 else results.paused()
        return self
