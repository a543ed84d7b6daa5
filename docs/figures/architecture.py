"""The rooms of both packages, and which imports from which: drawn from the imports themselves."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import NamedTuple

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch, Rectangle
from matplotlib.path import Path as Line

from app.render.palette import INK
from docs.figures.style import IMAGES, bare, board, new
from docs.imports import MODULES, reduced, room_imports
from symgrasp.files import write_atomically

__all__ = ["FILE", "PLACES", "Place", "architecture", "edges_as_text", "is_crossing", "route"]

FILE = IMAGES / "architecture.svg"


class Place(NamedTuple):
    """Where a room is drawn: columns from the left, floors from the ground."""

    column: float
    floor: float


PLACES = {
    "symgrasp.compiling": Place(0, 1.3), "symgrasp.caching": Place(0.5, 0.7), "symgrasp.poses": Place(2, 0),
    "symgrasp.files": Place(1, 0),
    "symgrasp.errors": Place(4, 0), "symgrasp.progress": Place(6, 0), "symgrasp.meshes": Place(4.5, 1.15),
    "symgrasp.page": Place(5, 0.45), "symgrasp.references": Place(3, 0.75),
    "symgrasp.descriptions": Place(3, 1.55),
    "symgrasp.object": Place(2, 2.3), "symgrasp.robot": Place(2, 3), "symgrasp.hands": Place(4, 3.5),
    "symgrasp.found_arms": Place(4, 4.5),
    "symgrasp.ik": Place(1, 4), "symgrasp.scene": Place(2, 4), "symgrasp.reason": Place(3, 4.5),
    "symgrasp.world": Place(2, 5), "symgrasp.collision": Place(0, 2),
    "symgrasp.engine": Place(2, 6), "symgrasp.feasibility": Place(2, 7),
    "symgrasp.plan": Place(2, 8), "symgrasp.planners": Place(2, 9), "symgrasp.motion": Place(1, 9.5),
    "symgrasp.survey": Place(2, 9.68), "symgrasp.bench": Place(2, 11),
    "symgrasp.cli": Place(2, 12), "symgrasp.__main__": Place(1, 13),
    "app.choices": Place(5.75, 9), "app.state": Place(5, 10), "app.files": Place(6.8, 12),
    "app.render": Place(5, 11),
    "app.html": Place(5, 12), "app.scene3d": Place(4, 12),
    "app.shell": Place(5.9, 11.4), "app.panels": Place(5, 13),
    "app.compute": Place(4, 14), "app.server": Place(5, 15), "app.__main__": Place(4, 15),
}  # fmt: skip
"""A room that is new needs a place here, above all that it imports and out of the way of the arrows."""

COLUMN, FLOOR = 1.3, 0.52
"""Width of a column and height of a floor (inches)."""

WIDTH, HEIGHT = 0.84, 0.58
"""Width and height of a box, as shares of these."""

COLUMNS, FLOORS = 7.8, 16.3

GROUNDS = {
    "symgrasp": ("#e8eef7", [(-0.5, -0.5, 7.0, 8.0), (-0.5, 7.5, 3.6, 6.1)]),
    "app": ("#f6ecdd", [(3.4, 8.4, 3.9, 7.4)]),
}
"""Package → its colour, and the rectangles (left, bottom, width, height) that it fills."""

EDGE = {"symgrasp": "#35609c", "app": "#9a6a1c"}
"""Package → colour of its boxes and arrows."""

LEGEND = "An arrow points to what a room imports from.\nArrows that follow from others are left out."


def route(source: Place, target: Place, boxes: Mapping[str, Place]) -> list[Place]:
    """Return the corners of an arrow with at most one bend, which passes no box if that can be.

    Args:
        source: the room that imports.
        target: the room that it imports from.
        boxes: all rooms.
    """
    across, down = Place(target.column, source.floor), Place(source.column, target.floor)
    ways = [[source, target]] if source.column == target.column else []
    ways += [[source, across, target], [source, down, target]]
    return next((way for way in ways if not is_crossing(way, boxes)), ways[0])


def is_crossing(way: list[Place], boxes: Mapping[str, Place]) -> bool:
    """Return whether an arrow passes a box besides those of its ends."""
    others = [box for box in boxes.values() if box not in (way[0], way[-1])]
    return any(
        min(a.column, b.column) - WIDTH / 2 < box.column < max(a.column, b.column) + WIDTH / 2
        and min(a.floor, b.floor) - HEIGHT / 2 < box.floor < max(a.floor, b.floor) + HEIGHT / 2
        for a, b in pairwise(way)
        for box in others
    )


def edges_as_text(graph: Mapping[str, set[str]]) -> str:
    """Write down which room imports from which, as the picture carries it."""
    return "; ".join(f"{room}: {', '.join(sorted(graph[room]))}" for room in sorted(graph))


def architecture() -> None:
    """Draw the rooms and the arrows that do not follow from others; the picture carries all of them."""
    graph = room_imports()
    figure = new(COLUMN * COLUMNS, FLOOR * FLOORS)
    axes = bare(board(figure, (0, 0, COLUMN * COLUMNS, FLOOR * FLOORS)))
    axes.set(xlim=(-0.5, COLUMNS - 0.5), ylim=(-0.5, FLOORS - 0.5))
    for package, (color, grounds) in GROUNDS.items():
        for left, bottom, width, height in grounds:
            axes.add_patch(Rectangle((left, bottom), width, height, facecolor=color, edgecolor="none"))
        left, bottom, width, height = grounds[-1]
        corner = (left + 0.08, bottom + height - 0.15)
        axes.text(*corner, package, color=EDGE[package], va="top", size=12, weight="bold")
    axes.text(-0.42, FLOORS - 0.8, LEGEND, va="top", size=10, linespacing=1.6)
    for room, others in sorted(reduced(graph).items()):
        for other in sorted(others):
            _draw_arrow(axes, route(PLACES[room], PLACES[other], PLACES), EDGE[room.split(".")[0]])
    for room in sorted(graph):
        _draw_box(axes, room)
    with rc_context({"svg.hashsalt": "symgrasp"}), write_atomically(FILE) as file:
        metadata = {"Date": None, "Creator": None, "Description": edges_as_text(graph)}
        figure.savefig(file, format="svg", metadata=metadata)


def _draw_box(axes: Axes, room: str) -> None:
    x, y = PLACES[room]
    package, _, name = room.partition(".")
    corner = (x - WIDTH / 2, y - HEIGHT / 2)
    box = FancyBboxPatch(
        corner, WIDTH, HEIGHT, boxstyle="round,pad=0,rounding_size=0.08",
        mutation_aspect=COLUMN / FLOOR, facecolor="white", edgecolor=EDGE[package], linewidth=1.2,
    )  # fmt: skip
    axes.add_patch(box)
    ending = "/" if MODULES.get(room, FILE).name == "__init__.py" else ".py"
    axes.text(x, y, name + ending, ha="center", va="center_baseline", color=INK, size=10)


def _draw_arrow(axes: Axes, way: list[Place], color: str) -> None:
    """Draw an arrow from the edge of its first box to the edge of its last one."""
    way = [_edge(way[0], way[1]), *way[1:-1], _edge(way[-1], way[-2])]
    arrow = FancyArrowPatch(
        path=Line([tuple(place) for place in way]), arrowstyle="-|>", mutation_scale=9,
        color=color, linewidth=1.1, shrinkA=0, shrinkB=0, joinstyle="round",
    )  # fmt: skip
    axes.add_patch(arrow)


def _edge(box: Place, towards: Place) -> Place:
    """Return where a line from the middle of a box leaves it."""
    side = (towards.column > box.column) - (towards.column < box.column)
    level = (towards.floor > box.floor) - (towards.floor < box.floor)
    return Place(box.column + side * WIDTH / 2, box.floor + level * HEIGHT / 2)
