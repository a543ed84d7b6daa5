"""The layout of the panels of one browser, and their updates to its state."""

from __future__ import annotations

from pathlib import Path

import viser

from ..state.state import State
from .actions import Actions
from .candidates_panel import CandidatesPanel
from .files_panel import FilesPanel
from .grasp_panel import GraspPanel
from .hands_panel import HandsPanel
from .keyboard import Keyboard
from .map_options_panel import MapOptionsPanel
from .map_panel import MapPanel
from .object_panel import ObjectPanel
from .panel import Panel
from .plan_panel import PlanFilePanel, PlanPanel
from .robot_panel import RobotPanel
from .scene_panel import ScenePanel
from .sequence_panel import SequencePanel, TasksPanel
from .status_panel import NotesPanel, StatusPanel
from .survey_panel import SurveyPanel

__all__ = ["Layout", "panel_widths"]

WINDOW = 1280
"""Width (px) of a window from which on the panels have their full width."""

MAP_WIDTH, CONTROLS_WIDTH = 480, 320
"""Full widths (px) of the panels on the left and on the right."""

MIN_CONTROLS_WIDTH = 240


class Layout:
    """All panels of a browser: maps and plans on the left, scene and object on the right.

    Args:
        client: the browser.
        actions: what the widgets do.
        scenes: names of the scenes that can be opened.

    Attributes:
        view_width: width (px) that is left for the 3D view.
    """

    def __init__(self, client: viser.ClientHandle, actions: Actions, scenes: tuple[str, ...]) -> None:
        gui = client.gui
        self.gui, self._dark = gui, False
        window = client.camera.image_width  # read before the panels narrow the canvas
        map_width, controls_width = panel_widths(window)
        self.view_width = window - map_width - controls_width
        self._theme(dark=False)
        gui.set_panel_label("symgrasp")
        left = gui.add_panel()
        with left.add_tab("Grasp map", viser.Icon.MAP_2):
            gui.add_html(f"<style>{_style()}</style>")
            map_tab: list[Panel] = [
                MapPanel(gui, actions),
                NotesPanel(gui, actions),
            ]
            tabs = gui.add_tab_group()
            with tabs.add_tab("Grasp", viser.Icon.HAND_GRAB):
                map_tab += [GraspPanel(gui, actions), CandidatesPanel(gui, actions)]
            with tabs.add_tab("View", viser.Icon.PALETTE):
                map_tab.append(MapOptionsPanel(gui, actions))
        with left.add_tab("Sequence", viser.Icon.ROUTE):
            sequence_tab = [
                NotesPanel(gui, actions),
                SequencePanel(gui, actions),
                PlanPanel(gui, actions),
                TasksPanel(gui, actions),
                PlanFilePanel(gui, actions),
            ]
        with left.add_tab("Hands", viser.Icon.USERS):
            hands_tab = [
                NotesPanel(gui, actions),
                HandsPanel(gui, actions),
                PlanPanel(gui, actions),
                PlanFilePanel(gui, actions),
            ]
        with left.add_tab("Survey", viser.Icon.GRID_DOTS):
            survey_tab = [NotesPanel(gui, actions), SurveyPanel(gui, actions)]
        with left.add_tab("Files", viser.Icon.FILES):
            files_tab = [NotesPanel(gui, actions), FilesPanel(gui, actions)]
        left.dock_left()
        left.set_width(map_width)
        gui.main_panel.dock_right()
        gui.main_panel.set_width(controls_width)
        main = [
            StatusPanel(gui, actions),
            ScenePanel(gui, actions, scenes),
            RobotPanel(gui, actions),
            ObjectPanel(gui, actions),
            Keyboard(gui, actions, scenes),
        ]
        self.panels: tuple[Panel, ...] = (
            *map_tab, *sequence_tab, *hands_tab, *survey_tab, *files_tab, *main,
        )  # fmt: skip

    def show(self, state: State) -> None:
        """Update the outputs of the panels to a state."""
        if state.display.dark != self._dark:
            self._dark = state.display.dark
            self._theme(dark=state.display.dark)
        for panel in self.panels:
            panel.show(state)

    def write_inputs(self, state: State) -> None:
        """Update the inputs of the panels to a state; only on viser's event loop.

        viser stores what a person enters in the widget, from where `Panel.on` reads it, both in one
        step of the event loop: on another thread this could overwrite the value in between.
        """
        for panel in self.panels:
            panel.write_inputs(state)

    def _theme(self, *, dark: bool) -> None:
        self.gui.configure_theme(
            dark_mode=dark, show_logo=False, show_share_button=False, brand_color=(38, 102, 190)
        )


def panel_widths(window: int) -> tuple[int, int]:
    """Return the widths (px) of the left and right panels; a narrow window keeps room for the 3D view."""
    share = min(1.0, window / WINDOW)
    return round(MAP_WIDTH * share), max(round(CONTROLS_WIDTH * share), MIN_CONTROLS_WIDTH)


def _style() -> str:
    return (Path(__file__).parent / "style.css").read_text(encoding="utf-8")
