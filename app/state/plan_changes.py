"""Changes of what is shown of plans: which of them, which task, what is played."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from app.state.facts import Facts, Pick
from app.state.plan_results import PlanResult, PlanResults

__all__ = ["Leafing"]


@dataclass(frozen=True, eq=False)
class Leafing(Facts):
    """Facts, and how the plans among them are leafed through."""

    def booked(self, ticket: int, plan_results: PlanResults) -> Self:
        """Take what a planner found and show its first task, unless nobody waits for it any more."""
        if self.busy is None or self.busy.ticket != ticket:
            return self
        return replace(
            self, plan_results=plan_results, busy=None, problem="", step=None, pick=None
        ).show_step(0)

    def listed(self, ticket: int, plans: tuple[PlanResult, ...], more: bool) -> Self:
        """Take further plans of the list and show the first of them."""
        if self.busy is None or self.busy.ticket != ticket:
            return self
        state = replace(
            self, plan_results=self.plan_results.extended(plans, more=more), busy=None, problem=""
        )
        return state.choose_plan(len(self.plan_results.plans)) if plans else state

    def turn_book(self, change: Callable[[PlanResults], PlanResults]) -> Self:
        """Change what is shown of the plans, if that is all that changes."""
        plan_results = change(self.plan_results)
        return self if plan_results is self.plan_results else replace(self, plan_results=plan_results)

    def choose_plan(self, page: int) -> Self:
        """Show another plan of the list, at the same task."""
        step = self.step or 0
        return replace(self, plan_results=self.plan_results.turned_to(page)).show_step(step)

    def show_step(self, step: int) -> Self:
        """Show a task of the plan: the object turned by δᵢ and the grasp on its map."""
        return self.show_position(step)

    def show_position(self, position: float) -> Self:
        """Show the plan at a position of the play: the task nearest to it, the arms maybe between two."""
        if self.plan is None:
            return self
        plan_results = self.plan_results.at(position)
        step = plan_results.nearest
        task = self.plan.plan.tasks[step]
        hold = next((h for h in task.holds if h.arm == self.arm), task.holds[0])
        pick = Pick(hold.grasp.h, hold.grasp.theta, 0 if np.cos(hold.grasp.roll) > 0 else 1)
        return replace(
            self,
            plan_results=plan_results,
            step=step,
            task=task.name,
            arm=hold.arm,
            delta=task.delta,
            pick=pick,
            map_view=self.map_view.another_cell(),
            result=self.plan.maps[task.name, hold.arm],
            problem="",
        )

    def show_frame(self, frame: int) -> Self:
        """Show a step of the hill climbing: the hands on the maps as they were computed."""
        climb = self.plan_results.climb
        if climb is None:
            return self
        arm = self.arm if self.arm in climb.arms else climb.arms[0]
        return replace(
            self,
            plan_results=self.plan_results.at_frame(frame),
            step=None,
            task=climb.task,
            arm=arm,
            delta=0.0,
            pick=None,
            result=self.plan_results.maps[climb.task, arm],
            problem="",
        )

    def play_arms(self) -> Self:
        """Start or stop the play of the plan."""
        return replace(self, plan_results=self.plan_results.play_arms())._followed()

    def play_climb(self) -> Self:
        """Start or stop the replay of the hill climbing."""
        return replace(self, plan_results=self.plan_results.play_climb())._followed()

    def played(self, seconds: float) -> Self:
        """Let what is played go on; it stops where the person has moved on to something else."""
        moving = self.plan_results.moving
        if not moving:
            return self
        if (self.step if moving == "arms" else self.climbed) is None:
            return self.turn_book(PlanResults.still)
        return replace(self, plan_results=self.plan_results.advanced(seconds))._followed()

    def _followed(self) -> Self:
        """Show what the book is open at."""
        if self.plan_results.moving == "climb" or self.plan_results.frame is not None:
            return self.show_frame(self.plan_results.frame or 0)
        return self.show_position(self.plan_results.position)
