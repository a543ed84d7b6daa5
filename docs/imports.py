"""What the modules of both packages import, read from their source, and the rooms that they stand in.

A room is a folder of a package, or a module that stands beside those folders.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping, Set
from pathlib import Path

__all__ = ["MODULES", "ROOT", "imported", "reduced", "room_imports", "room_of"]

ROOT = Path(__file__).parent.parent

PACKAGES = ("symgrasp", "app")


def _name_of(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {_name_of(path): path for package in PACKAGES for path in (ROOT / package).rglob("*.py")}
"""Name of a module → its file."""


def room_of(module: str) -> str:
    """Return the room of a module by name."""
    return ".".join(module.split(".")[:2])


def imported(module: str) -> set[str]:
    """Return the modules that a module imports anywhere in it, also only for types or inside functions."""
    path = MODULES[module]
    package = module.split(".") if path.name == "__init__.py" else module.split(".")[:-1]
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = ".".join(package[: len(package) - node.level + 1]) if node.level else ""
            source = ".".join(part for part in (base, node.module) if part)
            inner = {f"{source}.{alias.name}" for alias in node.names}
            names |= {name if name in MODULES else source for name in inner}
    return names


def room_imports() -> dict[str, set[str]]:
    """Return room → the other rooms that its modules import from.

    The packages themselves are left out: `symgrasp` is the public door to all of its rooms.
    """
    found: dict[str, set[str]] = {}
    for module in MODULES.keys() - set(PACKAGES):
        room = room_of(module)
        rooms = {room_of(name) for name in imported(module) if name in MODULES}
        found.setdefault(room, set()).update(rooms - {room, *PACKAGES})
    return found


def reduced(graph: Mapping[str, Set[str]]) -> dict[str, set[str]]:
    """Return a graph without cycles, less the edges that a longer way makes superfluous."""
    beyond: dict[str, set[str]] = {}

    def reach(node: str) -> set[str]:
        if node not in beyond:
            beyond[node] = set(graph[node]).union(*(reach(other) for other in graph[node]))
        return beyond[node]

    return {node: set(own) - set().union(*(reach(other) for other in own)) for node, own in graph.items()}
