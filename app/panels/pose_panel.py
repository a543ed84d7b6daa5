"""The pose of the object."""

from __future__ import annotations

import numpy as np
import viser

from symgrasp.scene.scene import Scene

from ..state import changes
from ..state.state import State
from .actions import Actions
from .panel import Panel, slider_value

__all__ = ["PosePanel", "position_range"]

TURN_STEP = 0.25
"""Step of the rotation slider (degrees): one column of the map's picture."""

POSITION_MARGIN = 100.0
"""How far (cm) beyond every robot and task the sliders reach."""


class PosePanel(Panel):
    """Turns and moves the object."""

    def __init__(self, gui: viser.GuiApi, actions: Actions) -> None:
        super().__init__(gui, actions)
        with gui.add_folder("Pose"):
            self._build()

    def _build(self) -> None:
        gui = self.gui
        self.turn = gui.add_slider(
            "Rotation (°)", -180.0, 180.0, TURN_STEP, 0.0,
            hint="Turn the object about its own axis: the map only shifts.",
        )  # fmt: skip
        self.on(self.turn, lambda s, v: changes.turn(s, np.deg2rad(v)), "inputs")
        self.position = {
            axis: gui.add_slider(f"{axis} (cm)", -POSITION_MARGIN, POSITION_MARGIN, 0.5, 0.0)
            for axis in ("x", "y", "z")
        }
        for axis, slider in self.position.items():
            self.on(slider, lambda s, v, axis=axis: changes.moved(s, **{axis: v / 100}), "inputs")
        self.lean = gui.add_slider(
            "Lean (°)", 0.0, 180.0, 1.0, 0.0, hint="Angle between the object's axis and the vertical."
        )
        self.on(self.lean, lambda s, v: changes.moved(s, lean=np.deg2rad(v)), "inputs")
        self.towards = gui.add_slider(
            "Lean to (°)", -180.0, 180.0, 1.0, 0.0, hint="Direction the axis leans to; 0 is along x."
        )
        self.on(self.towards, lambda s, v: changes.moved(s, towards=np.deg2rad(v)), "inputs")
        self.gizmo = gui.add_checkbox("Drag handles", False)
        self.on(self.gizmo, lambda s, v: changes.switched(s, drag_handles=v))
        self.button(
            "Put it back",
            viser.Icon.ARROW_BACK_UP,
            lambda: self.actions.change(changes.reset_pose),
            color="gray",
        )

    def write_inputs(self, state: State) -> None:
        """Set the pose."""
        base = state.base
        self.turn.value = slider_value(self.turn, np.rad2deg(state.delta))
        for k, (axis, slider) in enumerate(self.position.items()):
            slider.min, slider.max = position_range(state.scene, k)
            slider.value = slider_value(slider, 100 * getattr(base, axis))
        self.lean.value = slider_value(self.lean, np.rad2deg(base.lean))
        self.towards.value = slider_value(self.towards, np.rad2deg(base.towards))
        self.gizmo.value = state.display.drag_handles


def position_range(scene: Scene, axis: int) -> tuple[float, float]:
    """Return the range (cm), in whole tens, of a position slider: x (0), y (1) or z (2)."""
    poses = [robot.T_world_base for robot in scene.robots.values()]
    poses += [task.T_world_object for task in scene.tasks.values()]
    coordinates = [100 * pose[axis, 3] for pose in poses]
    low, high = min(coordinates) - POSITION_MARGIN, max(coordinates) + POSITION_MARGIN
    return float(np.floor(low / 10) * 10), float(np.ceil(high / 10) * 10)
