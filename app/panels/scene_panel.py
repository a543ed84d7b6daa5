"""The scene, task and arm that are shown."""

from __future__ import annotations

import viser

from ..html.readout import scene_notes_html
from ..state import changes
from ..state.state import State
from .actions import Actions
from .panel import Panel

__all__ = ["ScenePanel"]


class ScenePanel(Panel):
    """Chooses scene, task and arm.

    Args:
        gui: where to add the widgets.
        actions: what they do.
        scenes: names of the scenes that can be opened.
    """

    def __init__(self, gui: viser.GuiApi, actions: Actions, scenes: tuple[str, ...]) -> None:
        super().__init__(gui, actions)
        with gui.add_folder("Scene"):
            self._scenes, self.scene = scenes, self.dropdown("Scene", scenes)
            self.task = self.dropdown("Task")
            self.arm = self.dropdown("Arm")
            self.flat_map = gui.add_checkbox("Flat map", True)
            self.notes = self.html()
        self.on_select(self.scene, actions.open_scene)
        self.on(self.task, lambda s, v: changes.choose_task(s, v))
        self.on(self.arm, lambda s, v: changes.choose_arm(s, v))
        self.on(self.flat_map, lambda s, v: changes.switched(s, flat_map=v))

    def show(self, state: State) -> None:
        """Offer the tasks and arms of the scene, and the uploaded scene; say what was guessed of it."""
        scenes = (*self._scenes, *([state.uploaded_scene.option] if state.uploaded_scene else []))
        if self.scene.options != scenes:
            self.scene.options = scenes
        if self.task.options != (tasks := tuple(state.scene.tasks)):
            self.task.options = tasks
        if self.arm.options != (arms := state.scene.task(state.task).arms):
            self.arm.options = arms
        self.notes.show(scene_notes_html(state))

    def write_inputs(self, state: State) -> None:
        """Set what is chosen."""
        self.scene.value = state.scene_name
        self.task.value, self.arm.value = state.task, state.arm
        self.flat_map.value = state.display.flat_map
