"""The widgets of one browser: what they are, what they do, and how they follow the state."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import viser

from app.map_view import Mark, legend_html, map_html, plan_html, prints_html
from app.prints import shown_prints
from app.profile_view import holds_html, profile_html, symmetry_html
from app.readout import grasp_html, map_title, notes_html, plan_line, status_html
from app.state import Pick, State
from app.things import UNITS, UPLOAD_LIMIT, choices
from app.values import RollChoice
from symgrasp.hand import HANDS
from symgrasp.mesh_io import MESH_ENDINGS

__all__ = ["PANELS_WIDTH", "Actions", "Controls"]

MAP_WIDTH = 480
CONTROLS_WIDTH = 320
PANELS_WIDTH = MAP_WIDTH + CONTROLS_WIDTH
TURN_STEP = 0.25
"""Step of the rotation slider (degrees): one column of the map's picture."""

REACH = 200.0
"""How far (cm) the object may be moved from the world's origin."""

COLOURS = ("map", "symmetry error")
"""What the object's surface may show."""

MOUNTABLE = tuple(name for name, hand in HANDS.items() if hand.urdf)
"""Hands that can be mounted where a scene mounts one."""

Change = Callable[[State], State]


class Actions(Protocol):
    """What the widgets ask for beyond a change of the state."""

    def change(self, change: Change, origin: str = "") -> None:
        """Apply a change; widgets of that origin are not written back."""

    def open_scene(self, name: str) -> None:
        """Load another scene."""

    def choose_object(self, choice: str) -> None:
        """Put another object into the scene."""

    def choose_hand(self, hand: str) -> None:
        """Mount another hand on the chosen arm."""

    def upload(self, name: str, content: bytes, scale: float) -> None:
        """Measure a mesh and put the object into the scene."""

    def plan(self, kind: str) -> None:
        """Run a planner."""

    def stop_or_retry(self) -> None:
        """Stop the computation, or begin the one that was stopped again."""

    def download(self) -> None:
        """Send the plan as a file."""


class Controls:
    """Builds all widgets of a browser and keeps them in step with the state.

    Args:
        client: the browser.
        actions: what they do.
        scenes: names to choose from.
    """

    def __init__(self, client: viser.ClientHandle, actions: Actions, scenes: tuple[str, ...]) -> None:
        self.gui, self.actions = client.gui, actions
        self.gui.configure_theme(
            control_layout="floating", dark_mode=False, show_logo=False, show_share_button=False,
            brand_color=(38, 102, 190),
        )  # fmt: skip
        self.gui.set_panel_label("symgrasp")
        panel = self.gui.add_panel()
        with panel.add_tab("Grasp map", viser.Icon.MAP_2):
            self._build_map()
            self._build_grasp()
            self.plan_maps = self.gui.add_html("")
        panel.dock_left()
        panel.set_width(MAP_WIDTH)
        self.gui.main_panel.dock_right()
        self.gui.main_panel.set_width(CONTROLS_WIDTH)
        self._build_status()
        self._build_scene(scenes)
        self._build_object()
        self._build_plan()
        self._shown_scene: object = None
        self._html: dict[str, str] = {}

    # -- building ---------------------------------------------------------------------------

    def _build_map(self) -> None:
        css = (Path(__file__).parent / "style.css").read_text(encoding="utf-8")
        self.gui.add_html(f"<style>{css}</style>")
        self.title = self.gui.add_html('<div class="sg sg-title">Loading …</div>')
        self.map = self.gui.add_html("")
        self.legend = self.gui.add_html("")
        self.holds = self.gui.add_html("")
        self.notes = self.gui.add_html("")

    def _build_status(self) -> None:
        """Always takes the same room: nothing below it may jump while it is being dragged."""
        self.status = self.gui.add_html('<div class="sg">Loading the scene …</div>')
        self.progress = self.gui.add_progress_bar(0.0)
        self.stop = self.gui.add_button("Cancel", icon=viser.Icon.X, color="gray", disabled=True)
        self.stop.on_click(lambda _: self.actions.stop_or_retry())

    def _build_object(self) -> None:
        gui = self.gui
        with gui.add_folder("Object"):
            self._build_choice()
            self.turn = gui.add_slider(
                "Rotation (°)", -180.0, 180.0, TURN_STEP, 0.0,
                hint="Turn the object about its own axis: the map only shifts.",
            )  # fmt: skip
            self._on(self.turn, lambda s, v: s.turn(np.deg2rad(v)), "inputs")
            self.position = {
                axis: gui.add_slider(f"{axis} (cm)", -REACH, REACH, 0.5, 0.0) for axis in ("x", "y", "z")
            }
            for axis, slider in self.position.items():
                self._on(slider, lambda s, v, axis=axis: s.move(**{axis: v / 100}), "inputs")
            self.lean = gui.add_slider(
                "Lean (°)", 0.0, 180.0, 1.0, 0.0, hint="Angle between the object's axis and the vertical."
            )
            self._on(self.lean, lambda s, v: s.move(lean=np.deg2rad(v)), "inputs")
            self.towards = gui.add_slider(
                "Lean to (°)", -180.0, 180.0, 1.0, 0.0, hint="Direction the axis leans to; 0 is along x."
            )
            self._on(self.towards, lambda s, v: s.move(towards=np.deg2rad(v)), "inputs")
            self.gizmo = gui.add_checkbox("Drag handles", False)
            self._on(self.gizmo, lambda s, v: replace(s, gizmo=v))
            reset = gui.add_button("Put it back", icon=viser.Icon.ARROW_BACK_UP, color="gray")
            reset.on_click(lambda _: self.actions.change(State.reset_pose))

    def _build_choice(self) -> None:
        gui = self.gui
        self.thing = gui.add_dropdown("Object", choices())
        self.thing.on_update(lambda e: self.actions.choose_object(self.thing.value) if e.client else None)
        limit = (
            f"{', '.join(ending[1:].upper() for ending in MESH_ENDINGS)}; at most {UPLOAD_LIMIT / 1e6:g} MB"
        )
        self.unit = gui.add_dropdown("Mesh unit", tuple(UNITS), hint="What one unit of an uploaded mesh is.")
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

        self.colours = gui.add_dropdown("Colours", COLOURS, visible=False)
        self._on(self.colours, lambda s, v: replace(s, errors=v == COLOURS[1]))

    def _build_grasp(self) -> None:
        gui = self.gui
        with gui.add_folder("Grasp"):
            self.h = gui.add_number("h (cm)", 0.0, step=0.1)
            self.theta = gui.add_number("θ (°)", 0.0, min=-180.0, max=180.0, step=0.1)
            pick = lambda s, _: s.choose(self.h.value / 100, np.deg2rad(self.theta.value))  # noqa: E731
            self._on(self.h, pick, "inputs")
            self._on(self.theta, pick, "inputs")
            self.roll = gui.add_dropdown("Roll", [roll.value for roll in RollChoice])
            self._on(self.roll, lambda s, v: s.choose_roll(RollChoice(v)))
            self.grasp = gui.add_html("")
            park = gui.add_button("Let go", icon=viser.Icon.HAND_OFF, color="gray")
            park.on_click(lambda _: self.actions.change(State.clear_pick))

    def _build_plan(self) -> None:
        gui = self.gui
        with gui.add_folder("Plan"):
            self.sequential = gui.add_button(
                "One grasp for all tasks",
                icon=viser.Icon.ROUTE,
                hint="The grasp with most room in its worst task",
            )
            self.sequential.on_click(lambda _: self.actions.plan("sequential"))
            self.bimanual = gui.add_button(
                "All arms together",
                icon=viser.Icon.USERS,
                hint="Hands as far apart as the maps allow",
            )
            self.bimanual.on_click(lambda _: self.actions.plan("bimanual"))
            self.plan_text = gui.add_html("")
            self.step = gui.add_slider("Plan step", 1, 2, 1, 1, visible=False)
            self._on(self.step, lambda s, v: s.show_step(int(v) - 1))
            self.download = gui.add_button("Download plan (JSON)", icon=viser.Icon.DOWNLOAD, visible=False)
            self.download.on_click(lambda _: self.actions.download())

    def _build_scene(self, scenes: tuple[str, ...]) -> None:
        gui = self.gui
        with gui.add_folder("Scene"):
            self.scene = gui.add_dropdown("Scene", scenes)
            self.task = _choice(gui, "Task")
            self.arm = _choice(gui, "Arm")
            self.hand = gui.add_dropdown("Hand", MOUNTABLE, visible=False)
            self.board = gui.add_checkbox("Flat map", True)
        self.scene.on_update(lambda e: self.actions.open_scene(self.scene.value) if e.client else None)
        self.hand.on_update(lambda e: self.actions.choose_hand(self.hand.value) if e.client else None)
        self._on(self.task, lambda s, v: s.choose_task(v))
        self._on(self.arm, lambda s, v: s.choose_arm(v))
        self._on(self.board, lambda s, v: replace(s, board=v))

    def _on(self, widget: Any, change: Callable[[State, Any], State], origin: str = "") -> None:
        """Let a widget change the state; what the page itself writes into it does not count.

        Widgets that a person drags or types in have the origin "inputs": they are not written back
        meanwhile.
        """

        @widget.on_update
        def _(event: viser.GuiEvent[Any]) -> None:
            if event.client is not None:
                value = widget.value
                self.actions.change(lambda state: change(state, value), origin)

    # -- following the state ----------------------------------------------------------------

    def show(self, state: State, *, write_inputs: bool) -> None:
        """Bring the panels up to the state.

        Args:
            state: the state.
            write_inputs: write the inputs as well; not while a person is moving them.
        """
        if state.scene is not self._shown_scene:
            self._shown_scene = state.scene
            self.h.min = 100 * state.scene.profile.h_min
            self.h.max = 100 * state.scene.profile.h_max
            self.task.options = tuple(state.scene.tasks)
        if self.thing.options != (things := choices(state.uploaded)):
            self.thing.options = things
        if self.arm.options != (arms := state.scene.task(state.task).arms):
            self.arm.options = arms
        if write_inputs:
            self._write_inputs(state)
        self._show_map(state)
        self._set("status", self.status, status_html(state))
        self._set("notes", self.notes, notes_html(state))
        self._set("grasp", self.grasp, grasp_html(state))
        self._show_busy(state)
        self._show_plan(state)

    def _write_inputs(self, state: State) -> None:
        base = state.base
        self.turn.value = _within(self.turn, np.rad2deg(state.delta))
        for axis, slider in self.position.items():
            slider.value = _within(slider, 100 * getattr(base, axis))
        self.lean.value = _within(self.lean, np.rad2deg(base.lean))
        self.towards.value = _within(self.towards, np.rad2deg(base.towards))
        self.scene.value = state.scene_name
        self.thing.value = state.choice
        self.colours.visible = bool(state.thing and state.thing.measurement)
        self.colours.value = COLOURS[state.errors]
        self.task.value, self.arm.value, self.roll.value = state.task, state.arm, state.roll.value
        hand = state.scene.mounted.get(state.arm)
        self.hand.visible = hand is not None
        if hand is not None:
            self.hand.value = hand
        self.gizmo.value, self.board.value = state.gizmo, state.board
        pick = state.pick or Pick(state.scene.profile.h_min, 0.0)
        self.h.value = round(100 * pick.h, 2)
        self.theta.value = round(float(np.rad2deg(pick.theta)), 2)
        if state.step is not None:
            self.step.value = state.step + 1

    def _show_map(self, state: State) -> None:
        self._set("title", self.title, map_title(state))
        self._set("holds", self.holds, holds_html(state) + symmetry_html(state))
        if state.map is None:
            self._set("map", self.map, '<div class="sg sg-faint">The map is being computed …</div>')
            self._set("legend", self.legend, "")
            return
        marks = [Mark(state.pick.h, state.pick.theta)] if state.pick else []
        prints, legend = shown_prints(state), legend_html(state.map, state.roll)
        if prints and state.shown:
            legend += prints_html(state.shown, prints)
            marks = [Mark(h.grasp.h, h.grasp.theta, h.arm) for h in state.shown.holds]
        stale = not state.is_current
        shown = map_html(state.map, state.roll, marks, prints, stale=stale)
        self._set("map", self.map, f'<div class="sg-side">{shown}{profile_html(state)}</div>')
        self._set("legend", self.legend, legend)

    def _show_busy(self, state: State) -> None:
        retry = state.busy is None and not state.is_current
        self.progress.value = 100 * state.busy.share if state.busy else 0.0
        self.stop.label = "Compute the map" if retry else "Cancel"
        self.stop.icon = viser.Icon.REFRESH if retry else viser.Icon.X
        self.stop.disabled = state.busy is None and not retry

    def _show_plan(self, state: State) -> None:
        plan = state.plan
        self._set("plan", self.plan_text, plan_line(state))
        self._set("plan_maps", self.plan_maps, plan_html(plan, state) if plan else "")
        self.download.visible = plan is not None
        self.sequential.disabled = not state.can_plan("sequential")
        self.bimanual.disabled = not state.can_plan("bimanual")
        self.step.visible = plan is not None and len(plan.plan.tasks) > 1
        if plan and self.step.visible:
            self.step.max = len(plan.plan.tasks)

    def _set(self, key: str, handle: viser.GuiHtmlHandle, content: str) -> None:
        if self._html.get(key) != content:
            self._html[key] = content
            handle.content = content


def _within(slider: viser.GuiSliderHandle[float], value: float) -> float:
    """Return a value as a slider can show it."""
    return float(np.clip(round(value / slider.step) * slider.step, slider.min, slider.max))


def _choice(gui: viser.GuiApi, label: str) -> viser.GuiDropdownHandle[str]:
    """Add a dropdown whose options are known later."""
    options: Sequence[str] = ["…"]
    return gui.add_dropdown(label, options)
