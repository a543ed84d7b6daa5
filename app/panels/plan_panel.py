"""The planners: run them, see their maps, step through what they found."""

from __future__ import annotations

import viser

from app.map_view import plan_html
from app.panels.panel import Actions, Panel
from app.readout import plan_line
from app.state import State

__all__ = ["PlanMapsPanel", "PlanPanel"]


class PlanPanel(Panel):
    """Runs the planners and steps through the plan."""

    def __init__(self, gui: viser.GuiApi, actions: Actions) -> None:
        super().__init__(gui, actions)
        with gui.add_folder("Plan"):
            self.sequential = self.button(
                "One grasp for all tasks",
                viser.Icon.ROUTE,
                lambda: actions.plan("sequential"),
                hint="The grasp with most room in its worst task",
            )
            self.bimanual = self.button(
                "All arms together",
                viser.Icon.USERS,
                lambda: actions.plan("bimanual"),
                hint="Hands as far apart as the maps allow",
            )
            self.text = self.html()
            self.step = gui.add_slider("Plan step", 1, 2, 1, 1, visible=False)
            self.on(self.step, lambda s, v: s.show_step(int(v) - 1))
            self.download = self.button(
                "Download plan (JSON)", viser.Icon.DOWNLOAD, actions.download, visible=False
            )

    def show(self, state: State) -> None:
        """Offer what can be planned, and sum up the plan."""
        plan = state.plan
        self.text.show(plan_line(state))
        self.download.visible = plan is not None
        self.sequential.disabled = not state.can_plan("sequential")
        self.bimanual.disabled = not state.can_plan("bimanual")
        self.step.visible = plan is not None and len(plan.plan.tasks) > 1
        if plan and self.step.visible:
            self.step.max = len(plan.plan.tasks)

    def write_inputs(self, state: State) -> None:
        """Show which task it is."""
        if state.step is not None:
            self.step.value = state.step + 1


class PlanMapsPanel(Panel):
    """The maps of the plan's tasks, each turned by its δ, with the common grasp in all."""

    def __init__(self, gui: viser.GuiApi, actions: Actions) -> None:
        super().__init__(gui, actions)
        self.maps = self.html()

    def show(self, state: State) -> None:
        """Draw them."""
        self.maps.show(plan_html(state.plan, state) if state.plan else "")
