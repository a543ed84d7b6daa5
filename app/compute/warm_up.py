"""The first map of a server, computed before anybody asks for it."""

from __future__ import annotations

import logging
import time

from symgrasp.errors import Cancelled, SymgraspError

from ..state.requests import MapRequest
from .cache import SharedCache
from .map_service import MapService

__all__ = ["compute_first_map"]

log = logging.getLogger(__name__)

PATIENCE = 5.0
"""How long (s) people wait for the first map before the page opens without it."""


def compute_first_map(cache: SharedCache) -> None:
    """Compute the first map of the first scene, unless that takes too long to wait for.

    What goes wrong is left for the page to say.
    """
    scene = cache.scene(cache.first)
    task = scene.task()
    begun: list[float] = []

    def progress(share: float) -> None:
        begun.append(time.monotonic())  # first called when everything is compiled
        if begun[-1] - begun[0] > PATIENCE and share < 1:
            raise Cancelled

    maps = MapService(cache.keep)
    try:
        maps.map(MapRequest(scene, task.arms[0], task.name), progress)
    except SymgraspError as error:  # also when cancelled
        log.info("no first map: %s", error)
    finally:
        maps.close()
