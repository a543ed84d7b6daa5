"""The object and its pose."""

from __future__ import annotations

import numpy as np
import viser

from symgrasp.meshes import MESH_ENDINGS
from symgrasp.scene.scene import Scene

from ..choices.object_choice import UNITS, UPLOAD_LIMIT, object_options
from ..state import changes
from ..state.state import State
from .actions import Actions
from .panel import Panel, slider_value

__all__ = ["ObjectPanel", "position_range"]

TURN_STEP = 0.25
"""Step of the rotation slider (degrees): one column of the map's picture."""

POSITION_MARGIN = 100.0
"""How far (cm) beyond every robot and task the sliders reach."""

SURFACE_COLORS = ("map", "symmetry error")
"""Labels of what the object's surface can show."""


class ObjectPanel(Panel):
    """Chooses the object, turns and moves it."""

    def __init__(self, gui: viser.GuiApi, actions: Actions) -> None:
        super().__init__(gui, actions)
        with gui.add_folder("Object"):
            self._build_choice()
            self._build_pose()

    def _build_choice(self) -> None:
        self.object_choice = self.dropdown("Object", object_options())
        self.on_select(self.object_choice, self.actions.choose_object)
        limit = (
            f"{', '.join(ending[1:].upper() for ending in MESH_ENDINGS)}; at most {UPLOAD_LIMIT / 1e6:g} MB"
        )
        self.unit = self.dropdown("Mesh unit", tuple(UNITS), hint="What one unit of an uploaded mesh is.")
        self.tolerance = self.gui.add_number(
            "Tolerance (mm)", 0.0, min=0.0, step=0.1,
            hint="How far an uploaded mesh may deviate from symmetry; 0 for the larger of 1.5 mm and 3 % of "
            "the radius. The object may stick out of what is planned with by that much.",
        )  # fmt: skip
        self.on_select(self.unit, lambda _: self.actions.measure_again(*self._measures()))
        self.on_select(self.tolerance, lambda _: self.actions.measure_again(*self._measures()))
        self.upload = self.upload_button(
            "Upload a mesh",
            UPLOAD_LIMIT,
            lambda name, content: self.actions.upload_object(name, content, *self._measures()),
            mime_type=",".join(MESH_ENDINGS),
            hint=limit,
        )
        self.flip = self.button(
            "Flip",
            viser.Icon.FLIP_VERTICAL,
            lambda: self.actions.change(changes.flip_object),
            color="gray",
            visible=False,
            hint="Stand the uploaded object on its other end.",
        )
        self.surface_colors = self.dropdown("Colours", SURFACE_COLORS, visible=False)
        self.on(self.surface_colors, lambda s, v: changes.switched(s, symmetry_error=v == SURFACE_COLORS[1]))

    def _measures(self) -> tuple[float, float | None]:
        """Return what is chosen: metres in a unit of a mesh, and the tolerance (m), None for the default."""
        return UNITS[self.unit.value], self.tolerance.value / 1e3 or None

    def _build_pose(self) -> None:
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

    def show(self, state: State) -> None:
        """Offer the library's objects and the uploaded one."""
        if self.object_choice.options != (options := object_options(state.uploaded_object)):
            self.object_choice.options = options

    def write_inputs(self, state: State) -> None:
        """Set the object and its pose."""
        base = state.base
        self.turn.value = slider_value(self.turn, np.rad2deg(state.delta))
        for k, (axis, slider) in enumerate(self.position.items()):
            slider.min, slider.max = position_range(state.scene, k)
            slider.value = slider_value(slider, 100 * getattr(base, axis))
        self.lean.value = slider_value(self.lean, np.rad2deg(base.lean))
        self.towards.value = slider_value(self.towards, np.rad2deg(base.towards))
        self.object_choice.value = state.object_option
        measured = bool(state.object_choice and state.object_choice.measurement)
        self.surface_colors.visible = self.flip.visible = measured
        self.surface_colors.value = SURFACE_COLORS[state.display.symmetry_error]
        self.gizmo.value = state.display.drag_handles


def position_range(scene: Scene, axis: int) -> tuple[float, float]:
    """Return the range (cm), in whole tens, of a position slider: x (0), y (1) or z (2)."""
    poses = [robot.T_world_base for robot in scene.robots.values()]
    poses += [task.T_world_object for task in scene.tasks.values()]
    coordinates = [100 * pose[axis, 3] for pose in poses]
    low, high = min(coordinates) - POSITION_MARGIN, max(coordinates) + POSITION_MARGIN
    return float(np.floor(low / 10) * 10), float(np.ceil(high / 10) * 10)
