"""What the steps of the tour do on the page beside the map: actions that its widgets have as well."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from ...panels.actions import Actions
from ...state.plans import plan_changes
from ...state.state import State

__all__ = ["LOG", "STORY", "tour_acts"]

STORY = "pick_pour_place"
"""The scene of the tour: it has several tasks that one grasp serves."""

LOG = "log_two_robots"
"""The scene in which hands of two robots are on one object."""


def tour_acts(actions: Actions) -> Mapping[str, Callable[[], None]]:
    """Return what each `app.shell.commands.Act` does, by its name."""
    change, plans = actions.change, actions.plans
    return {
        "story": lambda: actions.open_scene(STORY),
        "log": lambda: actions.open_scene(LOG),
        "compare": lambda: change(lambda s: _compared(s, compare=True)),
        "alone": lambda: change(lambda s: _compared(s, compare=False)),
        "plan": lambda: plans.run("sequential", "best"),
        "climb": lambda: plans.run("bimanual", "hill_climb"),
        "replay": lambda: change(plan_changes.play_climb),
        "motion": plans.find_motion,
        "play": lambda: change(plan_changes.play_arms),
    }


def _compared(state: State, *, compare: bool) -> State:
    return replace(state, map_view=state.map_view.with_compare(compare))
