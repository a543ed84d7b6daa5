"""Computes the maps of one session; runs in that session's process."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from symgrasp.errors import InputError, SymgraspError
from symgrasp.feasibility.create import MapMaker
from symgrasp.feasibility.creation.coarse import coarse_map, is_map_compiled
from symgrasp.feasibility.creation.torso_maps import torso_sample
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.feasibility.self_motion import self_motion
from symgrasp.poses import rotation_z
from symgrasp.progress import Progress
from symgrasp.scene.scene import Scene
from symgrasp.survey.success import success_map
from symgrasp.world import RESTING_DEPTH, BulletWorld, open_world

from ..state.requests import (
    CompareRequest,
    Comparison,
    ElbowMotion,
    ElbowMotions,
    ElbowRequest,
    ExplainRequest,
    ExplainResult,
    MapRequest,
    MapResult,
    Maps,
    Probability,
    ProbabilityRequest,
    Windows,
    WindowsRequest,
)

__all__ = ["DRAWS", "MapService"]

DRAWS = 100
"""Of how many poses a map is computed for the probabilities of grasps."""

ELBOW_STEP = 0.01
"""Distance (rad) of the values of the redundancy between which the elbow moves straight, at most."""

LEAST_MOTION = 2e-3
"""Width (rad) from which on a window is a motion that can be seen, and set by a slider."""


class MapService:
    """Computes maps in a physics world of its own; used by one thread at a time.

    The world of the last scene is kept and reused when only the object's pose or the tasks change.

    Args:
        on_map: called with every map that `map` and `maps` compute.
    """

    def __init__(self, on_map: Callable[[MapResult], None] = lambda _: None) -> None:
        self._on_map = on_map
        self._maker: MapMaker | None = None
        self._draws: tuple[ProbabilityRequest, list[np.ndarray]] | None = None

    def close(self) -> None:
        """Free the physics world."""
        if self._maker:
            self._maker.world.close()
            self._maker = None

    def map(
        self,
        request: MapRequest,
        progress: Progress,
        preliminary: Callable[[MapResult], None] | None = None,
    ) -> MapResult:
        """Compute a map.

        Args:
            request: which map.
            progress: called with the finished share; may raise `Cancelled`.
            preliminary: called with maps to look at meanwhile: a coarse one if code has to be compiled first,
                and what samples of the redundancy show where all of it is searched.
        """
        maker = self._maker_for(request.scene, progress)
        contacts = _contacts(maker.world, request)
        task, arm = request.moved_task(), request.scene.arm(request.arm)

        def show(found: FeasibilityMap | None) -> None:
            if preliminary and found:
                preliminary(MapResult(request, found, contacts, preliminary=True).renamed(request))

        if preliminary and not is_map_compiled(request.scene, arm):
            show(coarse_map(maker.world, arm, task, progress))
        sampled = show if preliminary else None
        the_map = maker.map(request.arm, task, progress=progress, sampled=sampled)
        result = MapResult(request, the_map, contacts).renamed(request)
        self._on_map(result)
        return result

    def maps(self, requests: Sequence[MapRequest], cached: Maps, progress: Progress) -> tuple[Maps, Progress]:
        """Compute the maps that are not cached.

        Args:
            requests: the maps.
            cached: (task, arm) → map, of those computed before.
            progress: called with the finished share; may raise `Cancelled`.

        Returns:
            All maps by task and arm, and the progress to use for the computation that follows.
        """
        parts = len(requests) + 1

        def part(k: int) -> Progress:
            return lambda share: progress((k + share) / parts)

        maps: Maps = {}
        for k, request in enumerate(requests):
            key = request.task, request.arm
            maps[key] = cached[key] if key in cached else self.map(request, part(k))
        return maps, part(len(requests))

    def compare(
        self, request: CompareRequest, shifted_from: FeasibilityMap, progress: Progress
    ) -> Comparison:
        """Compute the map of the turned object from scratch, and compare it with the shifted one.

        Args:
            request: which map, and by how much the object is turned.
            shifted_from: that map, for the object that is not turned.
            progress: called with the finished share; may raise `Cancelled`.
        """
        shifted, task = shifted_from.shift(request.delta), request.map.moved_task()
        turned = replace(task, T_world_object=task.T_world_object @ rotation_z(request.delta))
        maker = self._maker_for(request.map.scene, progress)
        fresh = maker.map(request.map.arm, turned, manifold=shifted.manifold, progress=progress)
        return Comparison(request, fresh, int(np.count_nonzero(fresh.reason != shifted.reason)))

    def explain(self, request: ExplainRequest, progress: Progress) -> ExplainResult:
        """Compute the result of every candidate of a cell."""
        maker, the_map = self._maker_for(request.map.scene, progress), request.map
        explanation = maker.explain(the_map.arm, the_map.moved_task(), request.cell, progress=progress)
        return ExplainResult(request, explanation)

    def probability(self, request: ProbabilityRequest, progress: Progress) -> Probability:
        """Compute how probable the grasps of a map are; goes on where an equal request was cancelled."""
        maker, the_map = self._maker_for(request.map.scene, progress), request.map
        if self._draws is None or self._draws[0] != request:
            self._draws = request, []
        found = success_map(
            maker,
            the_map.arm,
            the_map.moved_task(),
            request.noise,
            DRAWS,
            progress=progress,
            known=self._draws[1],
        )
        self._draws = None
        return Probability(request, found.feasible.sum(axis=0), len(found.feasible))

    def windows(self, request: WindowsRequest, shown: FeasibilityMap, progress: Progress) -> Windows:
        """Compute how wide the windows of the cells of a map are; none is known of arms without redundancy.

        Args:
            request: which map.
            shown: that map, for the object that is not turned.
            progress: called with the finished share; may raise `Cancelled`.
        """
        maker = self._maker_for(request.map.scene, progress)
        try:
            widest = maker.with_windows(shown, progress).widest
        except InputError:
            widest = None
        return Windows(request, np.full(shown.reason.shape, np.nan) if widest is None else widest)

    def elbow(self, request: ElbowRequest, shown: FeasibilityMap, progress: Progress) -> ElbowMotions:
        """Compute how the elbow may move while the hand stays at a feasible cell.

        Args:
            request: which cell of which map.
            shown: that map, for the object that is not turned.
            progress: called with the finished share; may raise `Cancelled`.
        """
        scene, cell = request.map.scene, request.cell
        maker, arm = self._maker_for(scene, progress), scene.arm(request.map.arm)
        m = replace(shown, shown_in=scene)
        try:
            (windows,) = maker.windows(m, np.array([cell]), progress, settle=False)
        except InputError:  # the arm has no redundancy, or none that is known at any value
            return ElbowMotions(request, ())
        motions: list[ElbowMotion] = []
        for window in windows:
            if window.width < LEAST_MOTION:
                continue
            try:
                q = self_motion(m, cell, window, ELBOW_STEP)
            except SymgraspError:  # a joint would have to go back by a full turn
                continue
            if arm.robot.torso is not None:
                q = arm.with_torso(torso_sample(m, arm.robot.torso, cell), q)
            phi = np.linspace(window.low, window.high, len(q))
            motions.append(ElbowMotion(window.branch, phi, q))
        return ElbowMotions(request, tuple(motions))

    def _maker_for(self, scene: Scene, progress: Progress) -> MapMaker:
        """Return the present map maker if it is for the same robots, obstacles and object, else a new one."""
        old = self._maker
        if old and old.world.scene.map_sha256 == scene.map_sha256:
            return old
        self.close()
        self._maker = MapMaker(open_world(scene, progress))
        return self._maker


def _contacts(world: BulletWorld, request: MapRequest) -> tuple[str, ...]:
    """Return a phrase for each obstacle that the object is inside of, deepest first."""
    world.set_object(request.T_world_object)
    deepest: dict[str, str] = {}
    for c in world.object_contacts():
        if c.depth > RESTING_DEPTH:
            deepest.setdefault(c.b.body, f"{c.a.body} is {1e3 * c.depth:.0f} mm inside {c.b.body}")
    return tuple(deepest.values())
