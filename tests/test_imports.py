"""The rooms of both packages in one order: imports only point to what stands before, and know no cycle."""

from __future__ import annotations

import ast
from graphlib import CycleError, TopologicalSorter
from importlib import import_module
from pathlib import Path

import pytest

import symgrasp

REPOSITORY = Path(symgrasp.__file__).parent.parent

ROOMS = [
    "symgrasp.errors", "symgrasp.progress", "symgrasp.files", "symgrasp.page", "symgrasp.compiling",
    "symgrasp.poses", "symgrasp.meshes", "symgrasp.reason", "symgrasp.object", "symgrasp.robot",
    "symgrasp.ik", "symgrasp.scene", "symgrasp.world", "symgrasp.engine", "symgrasp.feasibility",
    "symgrasp.plan", "symgrasp.planners", "symgrasp.bench", "symgrasp.cli", "symgrasp.__main__",
    "app.state", "app.files", "app.render", "app.html", "app.scene3d", "app.compute", "app.panels",
    "app.server", "app.__main__",
]  # fmt: skip
"""Folders, and modules that stand beside them, from the ground up."""


def name_of(path: Path) -> str:
    parts = path.relative_to(REPOSITORY).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def room_of(module: str) -> str:
    return ".".join(module.split(".")[:2])


MODULES = {name_of(p): p for package in ("symgrasp", "app") for p in (REPOSITORY / package).rglob("*.py")}


def imported(module: str) -> set[str]:
    """Return the modules that a module imports anywhere in it, also only for types or inside functions."""
    path = MODULES[module]
    package = module.split(".") if path.name == "__init__.py" else module.split(".")[:-1]
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = ".".join(package[: len(package) - node.level + 1]) if node.level else ""
            source = ".".join(part for part in (base, node.module) if part)
            inner = {f"{source}.{alias.name}" for alias in node.names}
            names |= {name if name in MODULES else source for name in inner}
    return names


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
