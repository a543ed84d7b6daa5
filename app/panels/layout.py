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
from .pose_panel import PosePanel
from .robot_panel import RobotPanel
from .scene_panel import ScenePanel
from .sequence_panel import SequencePanel, TasksPanel
from .status_panel import NotesPanel, StatusPanel
from .survey_panel import SurveyPanel

__all__ = ["Layout", "panels_width"]

WIDE = 1100
"""Width (px) of viser's page from which on the panels stand side by side, not one above the other."""

PANEL_WIDTH = 320
"""Full width (px) of a panel."""

MOST = 0.4
"""Share of the width that panels which stand above each other take at most."""

VIEW_SHARE = 0.42
"""Share of the height of viser's page that the 3D view has above panels; style.css has it as well."""


class Layout:
    """All panels of a browser: scene and object on the right, and grasps and plans beside or below them.

    Args:
        client: the browser.
        actions: what the widgets do.
        scenes: names of the scenes that can be opened.
        stacked: whether the panels lie below the 3D view: in a narrow window.

    Attributes:
        view_size: width and height (px) that are left for the 3D view.
    """

    def __init__(
        self, client: viser.ClientHandle, actions: Actions, scenes: tuple[str, ...], *, stacked: bool = False
    ) -> None:
        gui = client.gui
        self.gui, self._dark = gui, False
        camera = client.camera  # read before the panels narrow the canvas
        window, height = camera.image_width, camera.image_height
        beside = (window - panels_width(window), height)
        self.view_size = (window, round(VIEW_SHARE * height)) if stacked else beside
        self._theme(dark=False)
        gui.set_panel_label("symgrasp")
        grasps = gui.add_panel()
        with grasps.add_tab("Grasp map", viser.Icon.MAP_2):
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
        with grasps.add_tab("Sequence", viser.Icon.ROUTE):
            sequence_tab = [
                NotesPanel(gui, actions),
                SequencePanel(gui, actions),
                PlanPanel(gui, actions),
                TasksPanel(gui, actions),
                PlanFilePanel(gui, actions),
            ]
        with grasps.add_tab("Hands", viser.Icon.USERS):
            hands_tab = [
                NotesPanel(gui, actions),
                HandsPanel(gui, actions),
                PlanPanel(gui, actions),
                PlanFilePanel(gui, actions),
            ]
        with grasps.add_tab("Survey", viser.Icon.GRID_DOTS):
            survey_tab = [NotesPanel(gui, actions), SurveyPanel(gui, actions)]
        with grasps.add_tab("Files", viser.Icon.FILES):
            files_tab = [NotesPanel(gui, actions), FilesPanel(gui, actions)]
        gui.main_panel.dock_right()
        if window >= WIDE:
            gui.main_panel.set_width(PANEL_WIDTH)
            grasps.dock_right()
            grasps.set_width(PANEL_WIDTH)
        else:
            gui.main_panel.set_width(panels_width(window))
            grasps.dock_below(gui.main_panel)
        grasps.expand()  # a phone shows it as a section of one panel, else closed
        main = [
            StatusPanel(gui, actions),
            PosePanel(gui, actions),
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


def panels_width(window: int) -> int:
    """Return the width (px) that all panels take; a narrow window keeps room for the 3D view."""
    return 2 * PANEL_WIDTH if window >= WIDE else min(PANEL_WIDTH, round(MOST * window))


def _style() -> str:
    return (Path(__file__).parent / "style.css").read_text(encoding="utf-8")
