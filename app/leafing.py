"""Changes of what is shown of plans: which of them, which task, what is played."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from app.facts import Facts, Pick
from app.plan_book import PlanBook
from app.values import PlanResult

__all__ = ["Leafing"]


@dataclass(frozen=True, eq=False)
class Leafing(Facts):
    """Facts, and how the plans among them are leafed through."""

    def booked(self, ticket: int, book: PlanBook) -> Self:
        """Take what a planner found and show its first task, unless nobody waits for it any more."""
        if self.busy is None or self.busy.ticket != ticket:
            return self
        return replace(self, book=book, busy=None, problem="", step=None, pick=None).show_step(0)

    def listed(self, ticket: int, plans: tuple[PlanResult, ...], more: bool) -> Self:
        """Take further plans of the list and show the first of them."""
        if self.busy is None or self.busy.ticket != ticket:
            return self
        state = replace(self, book=self.book.extended(plans, more=more), busy=None, problem="")
        return state.choose_plan(len(self.book.plans)) if plans else state

    def turn_book(self, change: Callable[[PlanBook], PlanBook]) -> Self:
        """Change what is shown of the plans, if that is all that changes."""
        book = change(self.book)
        return self if book is self.book else replace(self, book=book)

    def choose_plan(self, page: int) -> Self:
        """Show another plan of the list, at the same task."""
        step = self.step or 0
        return replace(self, book=self.book.turned_to(page)).show_step(step)

    def show_step(self, step: int) -> Self:
        """Show a task of the plan: the object turned by δᵢ and the grasp on its map."""
        return self.show_position(step)

    def show_position(self, position: float) -> Self:
        """Show the plan at a position of the play: the task nearest to it, the arms maybe between two."""
        if self.plan is None:
            return self
        book = self.book.at(position)
        step = book.nearest
        task = self.plan.plan.tasks[step]
        hold = next((h for h in task.holds if h.arm == self.arm), task.holds[0])
        pick = Pick(hold.grasp.h, hold.grasp.theta, 0 if np.cos(hold.grasp.roll) > 0 else 1)
        return replace(
            self,
            book=book,
            step=step,
            task=task.name,
            arm=hold.arm,
            delta=task.delta,
            pick=pick,
            looking=self.looking.another_cell(),
            result=self.plan.maps[task.name, hold.arm],
            problem="",
        )

    def show_frame(self, frame: int) -> Self:
        """Show a step of the hill climbing: the hands on the maps as they were computed."""
        climb = self.book.climb
        if climb is None:
            return self
        arm = self.arm if self.arm in climb.arms else climb.arms[0]
        return replace(
            self,
            book=self.book.at_frame(frame),
            step=None,
            task=climb.task,
            arm=arm,
            delta=0.0,
            pick=None,
            result=self.book.maps[climb.task, arm],
            problem="",
        )

    def play_arms(self) -> Self:
        """Start or stop the play of the plan."""
        return replace(self, book=self.book.play_arms())._followed()

    def play_climb(self) -> Self:
        """Start or stop the replay of the hill climbing."""
        return replace(self, book=self.book.play_climb())._followed()

    def played(self, seconds: float) -> Self:
        """Let what is played go on; it stops where the person has moved on to something else."""
        moving = self.book.moving
        if not moving:
            return self
        if (self.step if moving == "arms" else self.climbed) is None:
            return self.turn_book(PlanBook.still)
        return replace(self, book=self.book.advanced(seconds))._followed()

    def _followed(self) -> Self:
        """Show what the book is open at."""
        if self.book.moving == "climb" or self.book.frame is not None:
            return self.show_frame(self.book.frame or 0)
        return self.show_position(self.book.position)
