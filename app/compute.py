"""What the page computes: scenes and maps, with what can be used again kept."""

from __future__ import annotations

import logging
import threading
import time
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Protocol

import numpy as np

from app.asking import Check, CheckRequest, Explained, ExplainRequest
from app.links import Link
from app.meshes import link_visuals
from app.things import OWN, Thing, from_library
from app.values import MapRequest, MapResult
from symgrasp.errors import Cancelled, SceneError, SymgraspError, one_of
from symgrasp.feasibility import FeasibilityMap, Progress
from symgrasp.files import SCENES_DIR
from symgrasp.maps import MapMaker
from symgrasp.meshes import read_mesh
from symgrasp.poses import rotation_z
from symgrasp.robot_model import RobotModel
from symgrasp.scene import Scene, shipped_scenes
from symgrasp.world import RESTING_DEPTH, BulletWorld, check_tasks

__all__ = ["Maps", "Shelf", "Store", "Workbench", "check_visuals"]

log = logging.getLogger(__name__)

MAPS_KEPT = 64
"""Maps that the server remembers, newest first; a big one (96 x 192 cells) takes about 4 MB."""

POSES_KEPT = 6
"""Of them, those of one task and arm that differ in pose: a drag leaves dozens that nobody comes back to."""


Maps = Mapping[tuple[str, str], MapResult]
"""(task, arm) → its map."""

WARMING = 5.0
"""How long (s) people wait for the first map before the page opens without it."""


class Store:
    """What all browsers share because it never changes: loaded scenes and computed maps.

    Args:
        first: the scene the page opens with, a shipped name or a file.

    Raises:
        InputError: that scene is unusable.
    """

    def __init__(self, first: str) -> None:
        self._lock = threading.Lock()
        self._scenes: dict[str, Scene] = {}
        self._with: dict[tuple[str, str], tuple[Scene, Thing]] = {}
        self._maps: OrderedDict[tuple[object, ...], MapResult] = OrderedDict()
        self.first = first
        self.names = tuple(dict.fromkeys([first, *shipped_scenes()]))
        own = [] if first in shipped_scenes() else [Path(first).resolve().parent]
        self.folders = (*own, SCENES_DIR)
        self.scene(first)

    def scene(self, name: str) -> Scene:
        """Return a scene by one of `names`, loaded and checked once.

        Raises:
            InputError: it is unusable.
        """
        with self._lock:
            known = self._scenes.get(name)
        if known:
            return known
        if name not in self.names:  # a page can ask for any name, but for no file
            raise SceneError("page", "scene", name, one_of(self.names, name))
        scene = Scene.load(name)
        check_tasks(scene)
        check_visuals(scene)
        with self._lock:
            return self._scenes.setdefault(name, scene)

    def scene_with(self, name: str, choice: str) -> tuple[Scene, Thing | None]:
        """Return a scene by name with its own object or one of the library, and that object.

        Raises:
            InputError: one of them is unusable, or they do not go together.
        """
        scene = self.scene(name)
        if choice == OWN:
            return scene, None
        with self._lock:
            known = self._with.get((name, choice))
        if known:
            return known
        thing = from_library(choice)
        changed = scene.with_object(thing.name, thing.profile), thing
        with self._lock:
            return self._with.setdefault((name, choice), changed)

    def linked(self, link: Link) -> tuple[Scene, Thing | None]:
        """Return the scene of a link with its object and hands.

        Raises:
            InputError: there is none of that name.
        """
        scene, thing = self.scene_with(link.scene or self.first, link.object or OWN)
        for arm, hand in link.hands.items():
            if scene.mounted.get(arm) != hand:
                scene = scene.with_hand(arm, hand)
                check_visuals(scene)
        return scene, thing

    def map(self, request: MapRequest) -> MapResult | None:
        """Return a map that was computed before."""
        with self._lock:
            known = self._maps.get(request.place)
            if known:
                self._maps.move_to_end(request.place)
        return known.of(request) if known else None

    def keep(self, result: MapResult) -> None:
        """Remember a map."""
        with self._lock:
            self._maps[result.request.place] = result
            requests = [known.request for known in self._maps.values()]
            alike = [r for r in requests if r.pose and r.differs_in_pose(result.request)]
            for request in alike[:-POSES_KEPT]:
                del self._maps[request.place]
            while len(self._maps) > MAPS_KEPT:
                self._maps.popitem(last=False)

    def warm(self) -> None:
        """Compute the first map of the first scene, unless that takes too long to wait for.

        What goes wrong is left for the page to say.
        """
        scene = self.scene(self.first)
        task = scene.task()
        begun: list[float] = []

        def patience(share: float) -> None:
            begun.append(time.monotonic())  # first told when everything is compiled
            if begun[-1] - begun[0] > WARMING and share < 1:
                raise Cancelled

        bench = Workbench(self)
        try:
            bench.map(MapRequest(scene, task.arms[0], task.name), patience)
        except SymgraspError as error:  # also when cancelled
            log.info("no first map: %s", error)
        finally:
            bench.close()


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


class Workbench:
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

    def check(self, request: CheckRequest, known: FeasibilityMap, progress: Progress) -> Check:
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
        return Check(request, fresh, int(np.count_nonzero(fresh.reason != shifted.reason)))

    def explain(self, request: ExplainRequest, progress: Progress) -> Explained:
        """Judge every candidate of a cell."""
        maker, the_map = self.maker(request.map.scene), request.map
        found = maker.explain(the_map.arm, the_map.moved_task(), request.cell, progress=progress)
        return Explained(request, found)

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
