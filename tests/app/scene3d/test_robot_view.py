"""Robots in the 3D view: a browser draws a link as soon as it arrives, so it arrives where it belongs."""

# A map may be None in general, but not where these tests look.
# pyright: reportOptionalMemberAccess=false

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from app.scene3d.scene_view import SceneView
from app.server.door.viser_server import quiet_server
from app.state import changes
from app.state.requests import Busy
from app.state.state import State
from symgrasp.poses import from_position_quat
from tests.app.state.states import opened
from tests.conftest import load_small

BEGUN = State.of(load_small("bottle_on_table"), "bottle_on_table")


@pytest.mark.parametrize(
    "state",
    [
        BEGUN,
        replace(BEGUN, busy=Busy(1, "Computing the map", BEGUN.request)),
        changes.choose_cell(opened(), *np.argwhere(opened().result.map.feasible.any(axis=0))[0].tolist()),
    ],
    ids=["at first", "while the map is computed", "at a grasp"],
)
def test_links_are_added_where_they_are(state, monkeypatch):
    server = quiet_server()
    try:
        added: dict[str, np.ndarray] = {}
        add = server.scene.add_glb

        def noted(name: str, *arguments: Any, **options: Any) -> Any:
            added[name] = from_position_quat(options["position"], options["wxyz"])
            return add(name, *arguments, **options)

        monkeypatch.setattr(server.scene, "add_glb", noted)
        looker = SimpleNamespace(image_width=1280, image_height=800)
        client: Any = SimpleNamespace(scene=server.scene, atomic=server.atomic, camera=looker)
        view = SceneView(client, None, *[lambda *_: None] * 4)
        view.show(state, move_gizmo=True)
        (robot,) = state.scene.robots.values()
        values = robot.home
        if state.cell:
            witness = state.map.witness(state.cell)
            values = state.scene.arm(state.arm).robot_values(witness.q, witness.opening)
        nodes = view.robots[robot.name].nodes
        assert len(added) >= len(nodes) > 5
        for index, node in nodes.items():
            assert np.allclose(added[node.name], robot.model.forward(values)[index], atol=1e-6)
        assert not np.allclose([pose[:3, 3] for pose in added.values()], 0.0)
    finally:
        server.stop()
