"""The object: one of the library, an uploaded one, or that of the scene."""

from __future__ import annotations

import viser

from symgrasp.meshes import MESH_ENDINGS

from ..choices.object_choice import UNITS, UPLOAD_LIMIT, object_options
from ..state import changes
from ..state.state import State
from .actions import Actions
from .panel import Panel

__all__ = ["ObjectPanel"]

SURFACE_COLORS = ("map", "symmetry error")
"""Labels of what the object's surface can show."""


class ObjectPanel(Panel):
    """Chooses the object."""

    def __init__(self, gui: viser.GuiApi, actions: Actions) -> None:
        super().__init__(gui, actions)
        with gui.add_folder("Object"):
            self._build_choice()

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

    def show(self, state: State) -> None:
        """Offer the library's objects and the uploaded one."""
        if self.object_choice.options != (options := object_options(state.uploaded_object)):
            self.object_choice.options = options

    def write_inputs(self, state: State) -> None:
        """Set the object, and how it is coloured."""
        self.object_choice.value = state.object_option
        measured = bool(state.object_choice and state.object_choice.measurement)
        self.surface_colors.visible = self.flip.visible = measured
        self.surface_colors.value = SURFACE_COLORS[state.display.symmetry_error]
