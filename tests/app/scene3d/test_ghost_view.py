"""The preview of a grasp: its meshes are with the browser before a cell is pointed at."""

# A map may be None in general, but not where these tests look.
# pyright: reportOptionalMemberAccess=false

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from app.scene3d.scene_view import SceneView
from app.server.door.viser_server import quiet_server
from symgrasp.feasibility.cell import Cell
from symgrasp.poses import from_position_quat
from tests.app.state.states import opened


def test_pointing_at_a_cell_adds_no_meshes_and_shows_those_that_are_there(monkeypatch):
    server = quiet_server()
    try:
        added: list[Any] = []
        add = server.scene.add_mesh_simple

        def noted(*arguments: Any, **options: Any) -> Any:
            added.append(add(*arguments, **options))
            return added[-1]

        monkeypatch.setattr(server.scene, "add_mesh_simple", noted)
        looker = SimpleNamespace(image_width=1280, image_height=800)
        client: Any = SimpleNamespace(scene=server.scene, atomic=server.atomic, camera=looker)
        view, state = SceneView(client, None, *[lambda *_: None] * 4), opened()
        view.show(state, move_gizmo=True)
        before = list(added)
        links = {node.name.split("/")[-2]: node for node in before if node.name.endswith("/pale")}
        arm = state.scene.arm(state.arm)
        assert set(links) == set(arm.robot.model.colliding_links())
        assert not any(node.visible for node in before if "/ghost" in node.name)

        cell = Cell(*np.argwhere(state.map.feasible)[0].tolist())
        view.show(replace(state, map_view=replace(state.map_view, hovered=cell)), move_gizmo=True)
        assert added == before
        witness = state.map.witness(cell)
        poses = arm.robot.T_world_base @ arm.robot.model.forward(arm.robot_values(witness.q, witness.opening))
        for link, node in links.items():
            assert node.visible
            shown = from_position_quat(np.array(node.position), np.array(node.wxyz))
            assert np.allclose(shown, poses[arm.robot.model.link_index(link)], atol=1e-6)
        view.show(state, move_gizmo=True)
        assert not any(node.visible for node in links.values())
    finally:
        server.stop()
