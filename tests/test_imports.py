"""Data flows one way: a module imports only what stands above it."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import symgrasp

ROOT = Path(symgrasp.__file__).parent
ORDER = [
    "errors", "files", "compiling", "poses", "meshes", "meridian", "axis", "mesh_io", "outline", "surface",
    "measure", "profile", "objects", "manifold", "assembly", "hand", "handprint", "robot_model", "robot",
    "gripper", "measure_hand", "ik", "scene_file", "scene_build", "scene", "reason", "margins", "views",
    "pictures", "fit", "object_report", "world", "candidates", "feasibility", "explain", "algorithm1",
    "engine", "maps", "planners", "plan", "plan_writing", "solving", "planning", "listing", "exports",
    "verify", "plan_check", "bench", "cli", "__main__",
]  # fmt: skip


def modules() -> list[Path]:
    return sorted(path for path in ROOT.rglob("*.py") if path != ROOT / "__init__.py")


def part(path: Path) -> str:
    return path.relative_to(ROOT).with_suffix("").parts[0]


def imported(path: Path) -> set[str]:
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    return names


@pytest.mark.parametrize("path", modules(), ids=lambda p: str(p.relative_to(ROOT)))
def test_no_upward_import(path):
    own = part(path)
    assert own in ORDER, f"{own} has no place in the order of modules"
    parts = {name.split(".")[1] for name in imported(path) if name.startswith("symgrasp.")} & set(ORDER)
    upward = {p for p in parts if ORDER.index(p) > ORDER.index(own)}
    assert not upward


@pytest.mark.parametrize("path", modules(), ids=lambda p: str(p.relative_to(ROOT)))
def test_pybullet_and_viser_stay_where_they_belong(path):
    tops = {name.split(".")[0] for name in imported(path)}
    assert "viser" not in tops
    assert "pickle" not in tops
    assert ("pybullet" in tops) == (path == ROOT / "world" / "client.py")
    assert "app" not in tops or part(path) == "cli"


@pytest.mark.parametrize("path", modules(), ids=lambda p: str(p.relative_to(ROOT)))
def test_all_names_exist(path):
    relative = path.relative_to(ROOT).with_suffix("")
    if relative.name == "__main__":
        return
    name = ".".join(["symgrasp", *(p for p in relative.parts if p != "__init__")])
    module = __import__(name, fromlist=["*"])
    missing = [n for n in getattr(module, "__all__", []) if not hasattr(module, n)]
    assert not missing
