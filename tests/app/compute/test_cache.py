"""What the page computes, and what it keeps."""

from __future__ import annotations

import numpy as np
import pytest

from app.compute import map_service as compute
from app.compute.cache import SharedCache
from app.compute.map_service import MapService
from app.compute.plan_service import PlanRequest, PlanService
from app.state.object_choice import OWN
from app.state.plan_results import PlanResults
from app.state.requests import MapRequest, MapResult
from app.state.state import State
from symgrasp.errors import Cancelled, SymgraspError
from symgrasp.feasibility.create import MapMaker, create_map
from tests.app.state.test_state import small_map
from tests.conftest import SHIPPED, load_small, write_scene


@pytest.fixture(scope="module")
def store() -> SharedCache:
    return SharedCache("bottle_on_table")


@pytest.fixture
def bench(store):
    bench = MapService(store)
    yield bench
    bench.close()


def quiet(share: float) -> None:
    """Progress that nobody watches."""


def test_the_map_is_that_of_the_library(bench):
    request = State.of(load_small("bottle_on_table"), "").move(x=0.5).request
    result = bench.map(request, quiet)
    assert np.array_equal(result.map.reason, create_map(request.moved_scene(), "panda", "pick").reason)
    assert np.allclose(result.map.T_world_object, request.T_world_object)


def test_a_known_map_is_not_computed_again(bench, monkeypatch):
    request = State.of(load_small("soda_can"), "").request
    first = bench.map(request, quiet)
    monkeypatch.setattr(MapMaker, "map", None)
    assert bench.map(request, quiet) is first
    assert MapService(bench.store).map(request, quiet) is first


def test_only_so_many_maps_are_kept(monkeypatch):
    monkeypatch.setattr(compute, "MAPS_KEPT", 3)
    store = SharedCache("bottle_on_table")
    base = small_map("bottle_on_table", "pick", "panda")
    states = [State.of(load_small("bottle_on_table"), "").move(x=x).request for x in (0.1, 0.2, 0.3, 0.4)]
    for request in states:
        store.keep(MapResult(request, base.map))
    assert [store.map(r) is None for r in states] == [True, False, False, False]


def test_a_drag_pushes_out_its_own_maps_only(monkeypatch):
    monkeypatch.setattr(compute, "POSES_KEPT", 2)
    store, base = SharedCache("bottle_on_table"), small_map("bottle_on_table", "pick", "panda")
    bottle, can = (State.of(load_small(name), name) for name in ("bottle_on_table", "soda_can"))
    drag = [bottle.move(x=x).request for x in (0.1, 0.2, 0.3, 0.4)]
    for request in [bottle.request, can.move(x=0.5).request, *drag]:
        store.keep(MapResult(request, base.map))
    assert store.map(bottle.request)  # where "put it back" leads
    assert store.map(can.move(x=0.5).request)
    assert [store.map(r) is None for r in drag] == [True, True, False, False]


def test_the_world_is_used_again_for_the_same_robots_and_obstacles_only(bench):
    bottle = load_small("bottle_on_table")
    maker = bench.maker(bottle)
    assert bench.maker(State.of(bottle, "").move(x=0.5).moved_scene()) is maker
    can = load_small("soda_can")
    assert bench.maker(can) is not maker
    maker = bench.maker(can)
    assert bench.maker(can.with_object("other", bottle.profile)) is not maker
    assert bench.maker(can.with_settings(margin=0.01)) is not maker


def test_progress_may_stop_it(bench):
    def stop(share: float) -> None:
        raise Cancelled

    with pytest.raises(Cancelled):
        bench.map(State.of(load_small("bottle_on_table"), "").move(x=0.51).request, stop)


def test_what_the_object_is_inside_of_is_named_with_the_depth(bench):
    state = State.of(load_small("bottle_on_table"), "").move(z=-0.03)
    assert bench.map(state.request, quiet).contacts == ("bottle is 30 mm inside table",)
    beside = State.of(load_small("bottle_on_table"), "").move(x=0.62, y=-0.26)
    (contact,) = bench.map(beside.request, quiet).contacts
    assert contact.startswith("bottle is ")
    assert contact.endswith(" mm inside parcel")
    assert bench.map(State.of(load_small("bottle_on_table"), "").request, quiet).contacts == ()


def test_plans_follow_the_objects_that_were_moved(bench):
    scene = load_small("pick_pour_place")
    state = State.of(scene, "").move(y=-0.3)
    order = PlanRequest(scene, "sequential", "best", "panda", state.poses)
    plans = PlanService(bench)
    result = plans.run(order, PlanResults(), quiet).plan
    plans.close()
    assert result
    assert result.plan.tasks[0].object_pose.position[1] == pytest.approx(-0.3)
    assert result.maps["pick", "panda"].request == state.request
    assert result.maps["pour", "panda"].request == MapRequest(scene, "panda", "pour")


def test_one_arm_is_not_enough_for_the_bimanual_planner(bench):
    with pytest.raises(SymgraspError, match="two or more arms"):
        PlanService(bench).run(
            PlanRequest(load_small("bottle_on_table"), "bimanual", name="pick"), PlanResults(), quiet
        )


def test_a_scene_is_loaded_once_and_checked(store, tmp_path, content):
    assert store.scene("soda_can") is store.scene("soda_can")
    content["tasks"][0]["pose"]["position"][2] = -0.02
    with pytest.raises(SymgraspError, match=r"bottle is 20\.0 mm inside table"):
        SharedCache(str(write_scene(tmp_path, content)))


def test_a_scene_with_an_object_of_the_library_is_made_once(store):
    scene, object_choice = store.scene_with("soda_can", "tennis_ball")
    assert scene.profile is object_choice.profile
    assert scene.robots is store.scene("soda_can").robots
    assert store.scene_with("soda_can", "tennis_ball") == (scene, object_choice)
    assert store.scene_with("soda_can", OWN) == (store.scene("soda_can"), None)


def test_the_first_scene_is_offered_even_if_it_is_a_file(tmp_path, content):
    path = str(write_scene(tmp_path, content))
    names = SharedCache(path).names
    assert names[0] == path
    assert set(names[1:]) == set(SHIPPED)


def test_the_first_map_is_there_before_anybody_asks(monkeypatch, tmp_path, content):
    content["map"] = {"heights": 4, "angles": 8, "redundancy": 2}
    store = SharedCache(str(write_scene(tmp_path, content)))
    request = State.of(store.scene(store.first), store.first).request
    assert store.map(request) is None
    monkeypatch.setattr(compute, "WARMING", -1.0)
    monkeypatch.setattr(MapMaker, "map", lambda self, arm, task, progress: progress(0.5))
    store.warm()  # takes too long: the page opens without it
    assert store.map(request) is None
    monkeypatch.undo()
    store.warm()
    assert store.map(request)
