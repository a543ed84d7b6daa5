"""Computes the first map of a server before the first browser connects."""

from __future__ import annotations

import logging
import time

from symgrasp.errors import Cancelled, SymgraspError

from ..state.requests import MapRequest
from .cache import SharedCache
from .map_service import MapService

__all__ = ["compute_first_map"]

log = logging.getLogger(__name__)

TIME_LIMIT = 5.0
"""Time (s) after which the server starts without the first map."""


def compute_first_map(cache: SharedCache) -> None:
    """Compute the first map of the first scene, unless that takes longer than `TIME_LIMIT`.

    Errors are only logged: the page computes the map again and shows them.
    """
    scene = cache.scene(cache.first)
    task = scene.task()
    times: list[float] = []

    def progress(share: float) -> None:
        times.append(time.monotonic())
        if times[-1] - times[0] > TIME_LIMIT and share < 1:
            raise Cancelled

    maps = MapService(cache.keep)
    try:
        maps.map(MapRequest(scene, task.arms[0], task.name), progress)
    except SymgraspError as error:  # also when cancelled
        log.info("no first map: %s", error)
    finally:
        maps.close()
