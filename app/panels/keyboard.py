"""The command palette and its hotkeys: most actions of the page's widgets without a mouse."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import viser

from ..state import changes
from ..state.map_view_state import RollChoice
from ..state.plans import plan_changes
from ..state.state import State
from ..state.undo import redo, undo
from .actions import Actions
from .panel import Panel

__all__ = ["Keyboard", "next_arm"]

TASK_KEYS = 9
"""How many tasks have a digit as their hotkey."""


class Keyboard(Panel):
    """Commands without widgets; each does what some widget does as well.

    Args:
        gui: where to add the commands.
        actions: what they do.
        scenes: names of the scenes that can be opened.
    """

    def __init__(self, gui: viser.GuiApi, actions: Actions, scenes: Sequence[str]) -> None:
        super().__init__(gui, actions)
        self._scenes, self._scene = scenes, ""
        change, plans = actions.change, actions.plans
        self.command("Undo", lambda: change(undo), "Z", "cmd/ctrl")
        self.command("Redo", lambda: change(redo), "Z", "cmd/ctrl+shift")
        self.command("Take the tour", lambda: change(lambda s: replace(s, tour=s.tour + 1)))
        self.command("Cancel or compute again", actions.stop_or_retry, "escape")
        self._tasks: dict[str, viser.CommandHandle] = {}
        self.command("Next arm", lambda: change(next_arm), "M")
        self.command("Next roll", lambda: change(_next_roll), "R")
        self.command("Put the object back", lambda: change(changes.reset_pose), "B")
        self.command("Let go of the grasp", lambda: change(changes.clear_pick), "L")
        self.command("Flat map", lambda: change(lambda s: changes.toggled(s, "flat_map")), "F")
        self.command(
            "Drag handles",
            lambda: change(lambda s: changes.toggled(s, "drag_handles")),
            "G",
        )
        self.command("Light or dark", lambda: change(lambda s: changes.toggled(s, "dark")), "T")
        self.command("Plan one grasp for all tasks", lambda: plans.run("sequential"), "P")
        self.command("Plan all arms together", lambda: plans.run("bimanual"), "H")
        self.command("Hand over: plan all tasks in order", lambda: plans.run("handover"))
        self.command("List more solutions", plans.list_more)
        self.command(
            "Next solution",
            lambda: change(lambda s: plan_changes.choose_plan(s, s.plan_results.index + 1)),
            "J",
        )
        self.command("Play or pause the plan", lambda: actions.change(plan_changes.play_arms), "K")
        self.command("Replay or pause the climb", lambda: actions.change(plan_changes.play_climb), "C")
        self.command("Add a task after this one", lambda: change(changes.add_task), "I")
        self.command("Next task of the plan", lambda: change(lambda s: _step(s, 1)), "pagedown")
        self.command("Previous task of the plan", lambda: change(lambda s: _step(s, -1)), "pageup")
        self.command("Make a link", actions.make_link)
        self.command("Save the scene (YAML)", actions.save_scene, "S", "cmd/ctrl")
        self.command("Save the 3D view (HTML)", actions.save_3d_view)
        self.command("Next scene", self._next_scene, "N")
        for name in scenes:
            self.command(f"Open {name}", lambda name=name: actions.open_scene(name))

    def show(self, state: State) -> None:
        """Offer the commands for the tasks of the scene."""
        self._scene = state.scene_name
        names = tuple(state.scene.tasks)[:TASK_KEYS]
        if names != tuple(self._tasks):
            for command in self._tasks.values():
                command.remove()
            self._tasks = {name: self._task(name, str(k)) for k, name in enumerate(names, 1)}

    def _task(self, name: str, digit: str) -> viser.CommandHandle:
        return self.command(
            f"Task {name}", lambda: self.actions.change(lambda s: changes.choose_task(s, name)), digit
        )

    def _next_scene(self) -> None:
        index = self._scenes.index(self._scene) if self._scene in self._scenes else -1
        self.actions.open_scene(self._scenes[(index + 1) % len(self._scenes)])


def next_arm(state: State) -> State:
    """Show the map of the task's next arm."""
    arms = state.scene.task(state.task).arms
    return changes.choose_arm(state, arms[(arms.index(state.arm) + 1) % len(arms)])


def _next_roll(state: State) -> State:
    rolls = list(RollChoice)
    return changes.choose_roll(state, rolls[(rolls.index(state.map_view.roll) + 1) % len(rolls)])


def _step(state: State, by: int) -> State:
    return state if state.plan is None else plan_changes.show_step(state, (state.step or 0) + by)
