"""Plans of any kind: the list of solutions, the playback, and plan files."""

from __future__ import annotations

import math

import viser

from symgrasp.plan.plan import LARGEST_PLAN

from ..files.archives import ARCHIVE_LIMIT
from ..files.plan_formats import FORMATS
from ..html.conflicts import plan_file_html
from ..html.motion import motion_html
from ..html.readout import solution_html
from ..html.solutions import solutions_html
from ..state.plans import plan_changes
from ..state.state import State
from .actions import Actions
from .click_targets import ClickTargets
from .panel import Panel

__all__ = ["PlanFilePanel", "PlanPanel"]

SPEEDS = {"¼ ×": 0.25, "½ ×": 0.5, "1 ×": 1.0, "2 ×": 2.0, "4 ×": 4.0}
"""Label → seconds of a motion that are played in a second."""


class PlanPanel(Panel):
    """Chooses one of the listed plans and plays it."""

    def __init__(self, gui: viser.GuiApi, actions: Actions) -> None:
        super().__init__(gui, actions)
        plans = actions.plans
        self.solution = gui.add_slider("Solution", 1, 2, 1, 1, visible=False)
        self.on(self.solution, lambda s, v: plan_changes.choose_plan(s, int(v) - 1), "scrub")
        self.folder = gui.add_folder("Solutions", visible=False)
        with self.folder:
            self.list = self.html()
        self.targets = ClickTargets(gui, self.folder, self._clicked)
        self.text = self.html()
        self.more = self.button(
            "List more solutions", viser.Icon.LIST, plans.list_more, color="gray", visible=False
        )
        self.step = gui.add_slider("Plan step", 1.0, 2.0, 0.02, 1.0, visible=False)
        self.on(self.step, lambda s, v: plan_changes.show_position(s, v - 1), "scrub")
        self.time = gui.add_slider("Time (s)", 0.0, 1.0, 0.02, 0.0, visible=False)
        self.on(self.time, plan_changes.show_position, "scrub")
        self.speed = self.dropdown("Speed", tuple(SPEEDS), initial_value="1 ×", visible=False)
        self.on(self.speed, lambda s, v: plan_changes.choose_speed(s, SPEEDS[v]))
        self.play = self.button(
            "Play",
            viser.Icon.PLAYER_PLAY,
            lambda: actions.change(plan_changes.play_arms),
            color="gray",
            visible=False,
        )
        self.motion = self.html()
        self.with_motion = self.button(
            "With motion", viser.Icon.ROUTE, plans.find_motion, color="gray", visible=False
        )

    def _clicked(self, target: str) -> None:
        """Show the plan of a row, or sort by a heading."""
        if target.isdigit():
            self.actions.change(lambda s: plan_changes.choose_plan(s, int(target)))
        else:
            self.actions.change(lambda s: plan_changes.sort_solutions(s, target))

    def show(self, state: State) -> None:
        """List the plans and describe the one that is shown."""
        plan_results = state.plan_results
        several = len(plan_results.plans) > 1
        if several:
            self.solution.max = len(plan_results.plans)
        self.solution.visible = several
        self.more.visible = plan_results.more
        self.list.show(solutions_html(state, self.targets.id))
        self.folder.visible = several
        self.text.show(solution_html(state))
        moving = state.plan is not None and state.plan.motion is not None
        self.play.visible = plan_results.end > 0
        self.step.visible = plan_results.last > 0 and not moving
        self.time.visible = self.speed.visible = moving
        if moving:
            self.time.max = math.ceil(100 * plan_results.end) / 100
        elif plan_results.last:
            self.step.max = float(plan_results.last + 1)
        playing = plan_results.playing == "arms"
        self.play.label = "Pause" if playing else "Play"
        self.play.icon = viser.Icon.PLAYER_PAUSE if playing else viser.Icon.PLAYER_PLAY
        self.motion.show(motion_html(state))
        self.with_motion.visible = state.plan is not None and not moving

    def write_inputs(self, state: State) -> None:
        """Set the sliders to the plan and task that are shown."""
        plan_results = state.plan_results
        if len(plan_results.plans) > 1:
            self.solution.value = plan_results.index + 1
        self.speed.value = next(label for label, speed in SPEEDS.items() if speed == plan_results.speed)
        if state.plan and state.plan.motion:
            self.time.value = round(plan_results.position, 2)
        elif plan_results.last:
            self.step.value = round(plan_results.position + 1, 2)


class PlanFilePanel(Panel):
    """Downloads the plan and opens plan files."""

    def __init__(self, gui: viser.GuiApi, actions: Actions) -> None:
        super().__init__(gui, actions)
        plans = actions.plans
        with gui.add_folder("Plan file"):
            self.format = self.dropdown("Format", tuple(FORMATS), visible=False)
            self.download = self.button(
                "Download plan", viser.Icon.DOWNLOAD, lambda: plans.download(self.format.value), visible=False
            )
            self.upload = self.upload_button(
                "Open a plan",
                ARCHIVE_LIMIT,
                plans.open_file,
                mime_type=".json,.zip",
                hint=f"JSON of at most {LARGEST_PLAN / 1e6:g} MB; or a ZIP file of a plan with its robots, "
                f"at most {ARCHIVE_LIMIT / 1e6:g} MB. It is verified before it is shown.",
            )
            self.report = self.html()

    def show(self, state: State) -> None:
        """Offer the download, and report on the file that was opened last."""
        self.format.visible = self.download.visible = state.plan is not None
        self.report.show(plan_file_html(state.plan_results.opened) if state.plan_results.opened else "")
