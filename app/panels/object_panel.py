"""Which object, and where it stands."""

from __future__ import annotations

import numpy as np
import viser

from symgrasp.object.measure.mesh_io import MESH_ENDINGS
from symgrasp.scene.scene import Scene

from ..state import changes
from ..state.object_choice import UNITS, UPLOAD_LIMIT, choices
from ..state.state import State
from .actions import Actions
from .panel import Panel, within

__all__ = ["ObjectPanel", "span"]

TURN_STEP = 0.25
"""Step of the rotation slider (degrees): one column of the map's picture."""

BEYOND = 100.0
"""How far (cm) beyond every robot and task the object may be moved."""

COLOURS = ("map", "symmetry error")
"""What the object's surface may show."""


class ObjectPanel(Panel):
    """Chooses the object, turns it and moves it about."""

    def __init__(self, gui: viser.GuiApi, actions: Actions) -> None:
        super().__init__(gui, actions)
        with gui.add_folder("Object"):
            self._build_choice()
            self._build_pose()

    def _build_choice(self) -> None:
        gui = self.gui
        self.object_choice = self.choice("Object", choices())
        self.on_choice(self.object_choice, self.actions.choose_object)
        limit = (
            f"{', '.join(ending[1:].upper() for ending in MESH_ENDINGS)}; at most {UPLOAD_LIMIT / 1e6:g} MB"
        )
        self.unit = self.choice("Mesh unit", tuple(UNITS), hint="What one unit of an uploaded mesh is.")
        self.upload = gui.add_upload_button(
            "Upload a mesh",
            icon=viser.Icon.UPLOAD,
            color="gray",
            mime_type=",".join(MESH_ENDINGS),
            hint=limit,
        )
        self.upload.on_upload(
            lambda _: self.actions.upload(
                self.upload.value.name, self.upload.value.content, UNITS[self.unit.value]
            )
        )
        self.colours = self.choice("Colours", COLOURS, visible=False)
        self.on(self.colours, lambda s, v: changes.switched(s, symmetry_error=v == COLOURS[1]))

    def _build_pose(self) -> None:
        gui = self.gui
        self.turn = gui.add_slider(
            "Rotation (°)", -180.0, 180.0, TURN_STEP, 0.0,
            hint="Turn the object about its own axis: the map only shifts.",
        )  # fmt: skip
        self.on(self.turn, lambda s, v: changes.turn(s, np.deg2rad(v)), "inputs")
        self.position = {
            axis: gui.add_slider(f"{axis} (cm)", -BEYOND, BEYOND, 0.5, 0.0) for axis in ("x", "y", "z")
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

    def show(self, state: State) -> None:
        """Offer the object that was uploaded as well."""
        if self.object_choice.options != (things := choices(state.uploaded_object)):
            self.object_choice.options = things

    def write_inputs(self, state: State) -> None:
        """Show the object and its pose."""
        base = state.base
        self.turn.value = within(self.turn, np.rad2deg(state.delta))
        for k, (axis, slider) in enumerate(self.position.items()):
            slider.min, slider.max = span(state.scene, k)
            slider.value = within(slider, 100 * getattr(base, axis))
        self.lean.value = within(self.lean, np.rad2deg(base.lean))
        self.towards.value = within(self.towards, np.rad2deg(base.towards))
        self.object_choice.value = state.object_option
        self.colours.visible = bool(state.object_choice and state.object_choice.measurement)
        self.colours.value = COLOURS[state.display.symmetry_error]
        self.gizmo.value = state.display.drag_handles


def span(scene: Scene, axis: int) -> tuple[float, float]:
    """Return how far (cm) an object may be moved along a coordinate: it ends with round figures."""
    poses = [robot.T_world_base for robot in scene.robots.values()]
    poses += [task.T_world_object for task in scene.tasks.values()]
    places = [100 * pose[axis, 3] for pose in poses]
    low, high = min(places) - BEYOND, max(places) + BEYOND
    return float(np.floor(low / 10) * 10), float(np.ceil(high / 10) * 10)
