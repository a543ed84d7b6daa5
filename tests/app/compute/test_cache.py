"""The cache that all sessions share: scenes by name, maps by content."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.choices.object_choice import OWN
from app.compute import cache as cache_module
from app.compute.cache import SharedCache
from app.state import changes
from app.state.requests import MapRequest, MapResult
from app.state.state import State
from symgrasp.errors import SymgraspError
from symgrasp.scene.parts import Task
from symgrasp.scene.scene import Scene
from tests.app.state.states import small_map
from tests.conftest import SHIPPED, load_small, write_scene


@pytest.fixture(scope="module")
def cache() -> SharedCache:
    return SharedCache("bottle_on_table")


def test_only_so_many_maps_are_kept(monkeypatch):
    monkeypatch.setattr(cache_module, "MAX_MAPS", 3)
    cache = SharedCache("bottle_on_table")
    base = small_map("bottle_on_table", "pick", "panda")
    states = [
        changes.moved(State.of(load_small("bottle_on_table"), ""), x=x).request for x in (0.1, 0.2, 0.3, 0.4)
    ]
    for request in states:
        cache.keep(MapResult(request, base.map))
    assert [cache.map(r) is None for r in states] == [True, False, False, False]


def test_a_drag_pushes_out_its_own_maps_only(monkeypatch):
    monkeypatch.setattr(cache_module, "MAX_POSES", 2)
    cache, base = SharedCache("bottle_on_table"), small_map("bottle_on_table", "pick", "panda")
    bottle, can = (State.of(load_small(name), name) for name in ("bottle_on_table", "soda_can"))
    drag = [changes.moved(bottle, x=x).request for x in (0.1, 0.2, 0.3, 0.4)]
    for request in [bottle.request, changes.moved(can, x=0.5).request, *drag]:
        cache.keep(MapResult(request, base.map))
    assert cache.map(bottle.request)  # where "put it back" leads
    assert cache.map(changes.moved(can, x=0.5).request)
    assert [cache.map(r) is None for r in drag] == [True, True, False, False]


def test_a_scene_is_loaded_once_and_checked(cache, tmp_path, content):
    assert cache.scene("soda_can") is cache.scene("soda_can")
    content["tasks"][0]["pose"]["position"][2] = -0.02
    with pytest.raises(SymgraspError, match=r"bottle is 20\.0 mm inside table"):
        SharedCache(str(write_scene(tmp_path, content)))


def test_a_scene_with_an_object_of_the_library_is_made_once(cache):
    scene, object_choice = cache.scene_with("soda_can", "tennis_ball")
    assert scene.profile is object_choice.profile
    assert scene.robots is cache.scene("soda_can").robots
    assert cache.scene_with("soda_can", "tennis_ball") == (scene, object_choice)
    assert cache.scene_with("soda_can", OWN) == (cache.scene("soda_can"), None)


def test_the_first_scene_is_offered_even_if_it_is_a_file(tmp_path, content):
    path = str(write_scene(tmp_path, content))
    names = SharedCache(path).names
    assert names[0] == path
    assert set(names[1:]) == set(SHIPPED)


def test_a_known_map_answers_any_request_of_the_same_content(cache):
    """Of a scene that is loaded again, under the names of that scene and of its task."""
    computed = small_map("soda_can", "pick", "panda")
    cache.keep(computed)
    again = Scene.load("soda_can").with_settings(heights=8, angles=16, redundancy=6)
    task = again.task("pick")
    renamed = replace(again, file=again.file.model_copy(update={"name": "other"})).with_tasks(
        [Task("lift", task.arms, task.T_world_object)]
    )
    found = cache.map(MapRequest(renamed, "panda", "lift"))
    assert found.map.reason is computed.map.reason or np.array_equal(found.map.reason, computed.map.reason)
    assert (found.map.scene, found.map.task, found.request.scene) == ("other", "lift", renamed)
    assert cache.map(MapRequest(again.with_settings(margin=0.01), "panda", "pick")) is None
