"""The 3D view as one HTML file that opens anywhere, without a server or a network."""

from __future__ import annotations

import math
from html import escape
from types import SimpleNamespace
from typing import cast

import numpy as np
import viser

from symgrasp.errors import printable

from ..render.playback import motion_state
from ..scene3d.scene_view import SceneView
from ..state.page_link import Camera
from ..state.plans.plan_changes import show_position
from ..state.state import State
from .door.viser_server import quiet_server

__all__ = ["snapshot_html"]

FRAME = 0.05
"""Time (s) between two pictures of a motion."""


def snapshot_html(state: State, camera: Camera, fov: float) -> str:
    """Return the HTML document of a state's 3D view, which plays where the state shows a plan with a motion.

    viser serializes the scene that all browsers of a server share, not that of one browser, so the
    state is drawn into the shared scene of a temporary server.

    Args:
        state: what to show.
        camera: the camera.
        fov: its vertical field of view (rad).
    """
    server = quiet_server()
    try:
        # A server offers all that `SceneView` uses of a browser, except a camera.
        client = SimpleNamespace(
            scene=server.scene,
            atomic=server.atomic,
            camera=SimpleNamespace(image_width=1280, image_height=800),
        )
        view = SceneView(
            cast("viser.ClientHandle", client), None, _ignore, _ignore, lambda _: None, lambda _: None
        )
        view.camera = camera
        view.show(show_position(state, 0.0) if motion_state(state) else state, move_gizmo=True)
        start = server.initial_camera
        start.position, start.look_at, start.fov = np.array(camera[:3]), np.array(camera[3:]), fov
        start.up = (0.0, 0.0, 1.0)
        recording = server.get_scene_serializer()
        for t in _moments(state):
            recording.insert_sleep(FRAME)
            view.show(show_position(state, t), move_gizmo=False)
        document = recording.as_html(dark_mode=state.display.dark)
        title = f"<title>{escape(printable(state.scene.name))} · symgrasp</title>"
        return document.replace("<title>Viser</title>", title, 1)
    finally:
        server.stop()


def _moments(state: State) -> list[float]:
    """Return the times (s) after the first of the motion that a state shows, none where it shows none."""
    end = state.plan_results.end if motion_state(state) else 0.0
    return [min(k * FRAME, end) for k in range(1, math.ceil(end / FRAME) + 1)]


def _ignore(row: int, column: int) -> None:
    """Ignore a click: a file has no session."""
