"""Where the panels of one browser stand, and how they are brought up to its state."""

from __future__ import annotations

from pathlib import Path

import viser

from app.panels.grasp_panel import GraspPanel
from app.panels.map_panel import MapPanel
from app.panels.object_panel import ObjectPanel
from app.panels.panel import Actions, Panel
from app.panels.plan_panel import PlanMapsPanel, PlanPanel
from app.panels.scene_panel import ScenePanel
from app.panels.status_panel import NotesPanel, StatusPanel
from app.state import State

__all__ = ["PANELS_WIDTH", "Controls"]

MAP_WIDTH = 480
CONTROLS_WIDTH = 320
PANELS_WIDTH = MAP_WIDTH + CONTROLS_WIDTH


class Controls:
    """All panels of a browser: maps to read on the left, what to choose on the right.

    Args:
        client: the browser.
        actions: what the widgets do.
        scenes: names to choose from.
    """

    def __init__(self, client: viser.ClientHandle, actions: Actions, scenes: tuple[str, ...]) -> None:
        gui = client.gui
        gui.configure_theme(
            control_layout="floating", dark_mode=False, show_logo=False, show_share_button=False,
            brand_color=(38, 102, 190),
        )  # fmt: skip
        gui.set_panel_label("symgrasp")
        left = gui.add_panel()
        with left.add_tab("Grasp map", viser.Icon.MAP_2):
            gui.add_html(f"<style>{_style()}</style>")
            map_tab = [
                MapPanel(gui, actions),
                NotesPanel(gui, actions),
                GraspPanel(gui, actions),
                PlanMapsPanel(gui, actions),
            ]
        left.dock_left()
        left.set_width(MAP_WIDTH)
        gui.main_panel.dock_right()
        gui.main_panel.set_width(CONTROLS_WIDTH)
        main = [
            StatusPanel(gui, actions),
            ScenePanel(gui, actions, scenes),
            ObjectPanel(gui, actions),
            PlanPanel(gui, actions),
        ]
        self.panels: tuple[Panel, ...] = (*map_tab, *main)

    def show(self, state: State, *, write_inputs: bool) -> None:
        """Bring the panels up to the state.

        Args:
            state: the state.
            write_inputs: write the inputs as well; not while a person is moving them.
        """
        for panel in self.panels:
            panel.show(state)
            if write_inputs:
                panel.write_inputs(state)


def _style() -> str:
    return (Path(__file__).parent / "style.css").read_text(encoding="utf-8")
