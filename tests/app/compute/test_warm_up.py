"""The first map of a server."""

from __future__ import annotations

from app.compute import warm_up
from app.compute.cache import SharedCache
from app.state.state import State
from symgrasp.feasibility.create import MapMaker
from tests.conftest import write_scene


def test_the_first_map_is_there_before_anybody_asks(monkeypatch, tmp_path, content):
    content["map"] = {"heights": 4, "angles": 8, "redundancy": 2}
    cache = SharedCache(str(write_scene(tmp_path, content)))
    request = State.of(cache.scene(cache.first), cache.first).request
    assert cache.map(request) is None
    monkeypatch.setattr(warm_up, "TIME_LIMIT", -1.0)
    monkeypatch.setattr(MapMaker, "map", lambda self, arm, task, progress: progress(0.5))
    warm_up.compute_first_map(cache)  # takes too long: the page opens without it
    assert cache.map(request) is None
    monkeypatch.undo()
    warm_up.compute_first_map(cache)
    assert cache.map(request)
