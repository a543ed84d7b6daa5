"""What the page computes: scenes and maps, with what can be used again kept."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Protocol

import numpy as np

from app.scene3d.visual_meshes import link_visuals
from app.state.requests import (
    CompareRequest,
    Comparison,
    ExplainRequest,
    ExplainResult,
    MapRequest,
    MapResult,
)
from symgrasp.feasibility.create import MapMaker
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.meshes import read_mesh
from symgrasp.poses import rotation_z
from symgrasp.progress import Progress
from symgrasp.robot.model import RobotModel
from symgrasp.scene.scene import Scene
from symgrasp.world import RESTING_DEPTH, BulletWorld

__all__ = ["MapService", "Maps", "Shelf", "check_visuals"]

log = logging.getLogger(__name__)


Maps = Mapping[tuple[str, str], MapResult]
"""(task, arm) → its map."""


class Shelf(Protocol):
    """What a workbench needs of the store."""

    @property
    def folders(self) -> tuple[Path, ...]:
        """Where the files of an uploaded scene may lie."""
        ...

    def map(self, request: MapRequest, /) -> MapResult | None:
        """Return a map that was computed before."""

    def keep(self, result: MapResult) -> None:
        """Remember a map."""


class MapService:
    """Computes for one browser, in a physics world of its own; used by one thread at a time.

    Args:
        store: knows the maps that were computed before, and keeps new ones.
    """

    def __init__(self, store: Shelf) -> None:
        self.store = store
        self._maker: MapMaker | None = None

    def close(self) -> None:
        """Free the physics world."""
        if self._maker:
            self._maker.world.close()
            self._maker = None

    def maker(self, scene: Scene) -> MapMaker:
        """Return a map maker for the scene's robots, obstacles and object; its tasks do not matter."""
        old = self._maker
        shared = ("robots", "obstacles", "profile", "settings")
        if old and all(getattr(old.scene, part) is getattr(scene, part) for part in shared):
            return old
        self.close()
        self._maker = MapMaker(BulletWorld(scene), scene)
        return self._maker

    def map(self, request: MapRequest, progress: Progress) -> MapResult:
        """Return the map of a request, computed unless it is known."""
        known = self.store.map(request)
        if known:
            return known
        maker = self.maker(request.scene)
        contacts = self._contacts(maker.world, request)
        the_map = maker.map(request.arm, request.moved_task(), progress=progress)
        result = MapResult(request, the_map, contacts)
        self.store.keep(result)
        return result

    def check(self, request: CompareRequest, known: FeasibilityMap, progress: Progress) -> Comparison:
        """Compute the map of the turned object from scratch, and compare it with the shifted one.

        Args:
            request: which map, and by how much the object is turned.
            known: that map.
            progress: told the finished share; may raise `Cancelled`.
        """
        shifted, task = known.shift(request.delta), request.map.moved_task()
        turned = replace(task, T_world_object=task.T_world_object @ rotation_z(request.delta))
        maker = self.maker(request.map.scene)
        fresh = maker.map(request.map.arm, turned, manifold=shifted.manifold, progress=progress)
        return Comparison(request, fresh, int(np.count_nonzero(fresh.reason != shifted.reason)))

    def explain(self, request: ExplainRequest, progress: Progress) -> ExplainResult:
        """Judge every candidate of a cell."""
        maker, the_map = self.maker(request.map.scene), request.map
        found = maker.explain(the_map.arm, the_map.moved_task(), request.cell, progress=progress)
        return ExplainResult(request, found)

    def _contacts(self, world: BulletWorld, request: MapRequest) -> tuple[str, ...]:
        """Say what the object is inside of, deepest first, each obstacle once."""
        world.set_object(request.T_world_object)
        deepest: dict[str, str] = {}
        for c in world.object_contacts():
            if c.depth > RESTING_DEPTH:
                deepest.setdefault(c.b.body, f"{c.a.body} is {1e3 * c.depth:.0f} mm inside {c.b.body}")
        return tuple(deepest.values())

    def maps(
        self, requests: Sequence[MapRequest], progress: Progress
    ) -> tuple[dict[tuple[str, str], MapResult], Progress]:
        """Return maps by task and arm, and the progress of what comes after them."""
        parts = len(requests) + 1

        def part(k: int) -> Progress:
            return lambda share: progress((k + share) / parts)

        maps = {(r.task, r.arm): self.map(r, part(k)) for k, r in enumerate(requests)}
        return maps, part(len(requests))


def check_visuals(scene: Scene) -> None:
    """Read everything that is shown, so that what cannot be read is known now."""
    for robot in scene.robots.values():
        link_visuals(robot.model.urdf)
    for o in scene.obstacles:
        if o.kind == "urdf" and o.path:
            link_visuals(RobotModel(o.path).urdf)
        elif o.kind == "mesh" and o.path:
            read_mesh(o.path, f"obstacle {o.name}")
