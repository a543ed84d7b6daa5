"""The rooms of both packages in one order: imports only point to what stands before, and know no cycle."""

from __future__ import annotations

from graphlib import CycleError, TopologicalSorter
from importlib import import_module

import pytest

from docs.imports import MODULES, imported, room_of

ROOMS = [
    "symgrasp.errors", "symgrasp.progress", "symgrasp.files", "symgrasp.references", "symgrasp.page",
    "symgrasp.caching", "symgrasp.compiling", "symgrasp.poses", "symgrasp.meshes", "symgrasp.reason",
    "symgrasp.object",
    "symgrasp.descriptions", "symgrasp.robot", "symgrasp.hands", "symgrasp.found_arms",
    "symgrasp.ik", "symgrasp.scene", "symgrasp.world", "symgrasp.collision", "symgrasp.engine",
    "symgrasp.feasibility",
    "symgrasp.plan", "symgrasp.planners", "symgrasp.motion", "symgrasp.survey", "symgrasp.bench",
    "symgrasp.cli", "symgrasp.__main__",
    "app.choices", "app.state", "app.files", "app.render", "app.html", "app.shell", "app.scene3d",
    "app.compute", "app.panels", "app.server", "app.__main__",
]  # fmt: skip
"""Folders, and modules that stand beside them, from the ground up."""


@pytest.mark.parametrize("module", sorted(MODULES))
def test_no_upward_import(module):
    if module in ("symgrasp", "app"):
        return  # what they say of all others is tested where it is used
    assert room_of(module) in ROOMS, f"{module} has no place in the order of rooms"
    rooms = {room_of(name) for name in imported(module) if name in MODULES} - {"symgrasp", "app"}
    own = ROOMS.index(room_of(module))
    assert not {room for room in rooms if ROOMS.index(room) > own}


def test_no_cycle():
    graph = {module: imported(module) & set(MODULES) - {module} for module in MODULES}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail(" → ".join(error.args[1]))


@pytest.mark.parametrize("module", sorted(MODULES))
def test_toolkits_stay_where_they_belong(module):
    tops = {name.split(".")[0] for name in imported(module)}
    assert ("pybullet" in tops) == (module == "symgrasp.world.client")
    if module.startswith("symgrasp"):
        assert "viser" not in tops
        assert "pickle" not in tops
        assert "app" not in tops


@pytest.mark.parametrize("module", sorted(MODULES))
def test_all_names_exist(module):
    if module.endswith("__main__"):
        return
    found = import_module(module)
    assert not [name for name in getattr(found, "__all__", []) if not hasattr(found, name)]
