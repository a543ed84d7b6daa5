"""One grasp for a sequence of tasks: its plan, the maps of all tasks, and the list of tasks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import viser

from ..html.conflicts import failure_html, regrasp_count
from ..html.readout import sequence_html, tasks_html
from ..html.stack import stack_html
from ..state import changes
from ..state.plans import plan_changes
from ..state.state import State
from ..state.task_list import TaskList
from .actions import Actions
from .panel import Panel

__all__ = ["SEQUENCE_METHODS", "SequencePanel", "TasksPanel"]

SEQUENCE_METHODS: Mapping[str, str] = {
    "most room in the worst task": "best",
    "first found (Algorithm 2)": "first",
    "fewest regrasps": "regrasp",
}
"""Label of a method on the page → the method."""


class SequencePanel(Panel):
    """Plans one grasp for all tasks of an arm, and shows it in their maps."""

    def __init__(self, gui: viser.GuiApi, actions: Actions) -> None:
        super().__init__(gui, actions)
        plans = actions.plans
        self.title = self.html()
        self.method = self.dropdown("Method", tuple(SEQUENCE_METHODS))
        self.on(
            self.method,
            lambda s, v: plan_changes.change_plan_results(
                s, lambda results: replace(results, sequence_method=SEQUENCE_METHODS[v])
            ),
        )
        self.run = self.button("One grasp for all tasks", viser.Icon.ROUTE, lambda: plans.run("sequential"))
        self.failure = self.html()
        self.regrasp = self.button(
            "Plan with regrasps", viser.Icon.ROUTE, lambda: plans.run("sequential", "regrasp"), visible=False
        )
        self.stack = self.html()
        self.slide = gui.add_slider(
            "Slide by δ (%)", 0, 100, 1, 100, visible=False,
            hint="Turning the object by δ slides a task's map until the common grasp is feasible in it.",
        )  # fmt: skip
        self.on(
            self.slide,
            lambda s, v: plan_changes.change_plan_results(s, lambda results: results.slid(v / 100)),
            "inputs",
        )

    def show(self, state: State) -> None:
        """Show the maps with the grasp, or why there is none."""
        plan_results = state.plan_results
        refusal = plan_results.refusal if plan_results.kind == "sequential" else None
        count = regrasp_count(refusal)
        self.title.show(sequence_html(state))
        self.run.disabled = not state.can_plan("sequential")
        self.failure.show(failure_html(refusal, state.scene.manifold) if refusal else "")
        self.regrasp.visible = count > 0
        self.regrasp.label = f"Plan with {count} regrasp{'s' * (count > 1)}"
        self.stack.show(stack_html(state))
        self.slide.visible = plan_results.kind == "sequential" and plan_results.last > 0

    def write_inputs(self, state: State) -> None:
        """Set method and slide."""
        self.method.value = _label(SEQUENCE_METHODS, state.plan_results.sequence_method)
        self.slide.value = round(100 * state.plan_results.slide)


class TasksPanel(Panel):
    """Adds, renames, reorders and removes tasks."""

    def __init__(self, gui: viser.GuiApi, actions: Actions) -> None:
        super().__init__(gui, actions)
        with gui.add_folder("Tasks"):
            self.list = self.html()
            self.add = self.button(
                "Add a task after this one",
                viser.Icon.PLUS,
                lambda: actions.change(changes.add_task),
                color="gray",
                hint="The object's present pose becomes a task after the chosen one, which stays as it was",
            )
            self.name = gui.add_text("Task name", "")
            edits: dict[str, Callable[[TaskList], TaskList]] = {
                "Rename": lambda tasks: tasks.renamed(self.name.value),
                "Earlier": lambda tasks: tasks.shifted(-1),
                "Later": lambda tasks: tasks.shifted(1),
                "Remove": TaskList.removed,
            }
            self.edit = gui.add_button_group("Chosen task", tuple(edits))

            @self.edit.on_click
            async def _(_: object) -> None:  # at once, while the values are those of this click
                edit = edits[self.edit.value]
                actions.change(lambda s: changes.change_tasks(s, edit))

    def show(self, state: State) -> None:
        """List the tasks."""
        self.list.show(tasks_html(state))

    def write_inputs(self, state: State) -> None:
        """Set the text field to the chosen task's name."""
        self.name.value = state.task


def _label(methods: Mapping[str, str], method: str) -> str:
    return next(label for label, value in methods.items() if value == method)
