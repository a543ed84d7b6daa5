"""Maps and plans as the page computes them."""

from __future__ import annotations

import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from app.compute import map_service
from app.compute.map_service import MapService
from app.compute.plan_service import PlanRequest
from app.state import changes
from app.state.requests import ExplainRequest, MapRequest, ProbabilityRequest, WindowsRequest
from app.state.state import State
from symgrasp.errors import Cancelled, SymgraspError
from symgrasp.feasibility.cell import Cell
from symgrasp.feasibility.create import MapMaker, create_map
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.progress import Progress
from symgrasp.scene.parts import Task
from symgrasp.scene.scene import Scene
from symgrasp.survey.success import PoseNoise
from symgrasp.world import BulletWorld, open_world
from tests.app.state.states import results_of, small_map
from tests.conftest import load_small


@pytest.fixture
def maps():
    maps = MapService()
    yield maps
    maps.close()


def quiet(share: float) -> None:
    """Progress that nobody watches."""


def test_the_map_is_that_of_the_library(maps):
    request = changes.moved(State.of(load_small("bottle_on_table"), ""), x=0.5).request
    result = maps.map(request, quiet)
    assert np.array_equal(
        result.map.reason, create_map(request.moved_scene(), task="pick", arm="panda").reason
    )
    assert np.allclose(result.map.T_world_object, request.T_world_object)


def test_the_world_is_used_again_for_the_same_robots_and_obstacles_only(maps, monkeypatch):
    worlds: list[Scene] = []

    def counted(scene: Scene, progress: Progress) -> BulletWorld:
        worlds.append(scene)
        return open_world(scene, progress)

    monkeypatch.setattr(map_service, "open_world", counted)
    bottle, can = load_small("bottle_on_table"), load_small("soda_can")
    moved = changes.moved(State.of(bottle, ""), x=0.5)
    for scene in (bottle, moved.moved_scene(), pickle.loads(pickle.dumps(bottle))):
        maps.map(State.of(scene, "").request, quiet)
    assert worlds == [bottle]
    others = [can, can.with_object("other", bottle.profile), can.with_settings(margin=0.01)]
    for scene in others:
        maps.map(State.of(scene, "").request, quiet)
    assert worlds == [bottle, *others]


def test_probabilities_go_on_after_a_cell_was_explained(maps, monkeypatch):
    """What interrupts them does not restart them; with another noise they begin anew."""
    monkeypatch.setattr(map_service, "DRAWS", 6)
    request = State.of(load_small("bottle_on_table"), "").request
    noise = PoseNoise(0.02, 0.05)
    asked = ProbabilityRequest(request, noise)
    whole = maps.probability(asked, quiet)
    computed: list[Task] = []
    compute = MapMaker.map

    def counted(maker: MapMaker, arm: str, task: Task, **keys: Any) -> FeasibilityMap:
        computed.append(task)
        return compute(maker, arm, task, **keys)

    monkeypatch.setattr(MapMaker, "map", counted)

    def stop(share: float) -> None:
        if share > 0.7:
            raise Cancelled

    with pytest.raises(Cancelled):
        maps.probability(asked, stop)
    before = len(computed)  # of the expected pose, of four draws, and the one that was cancelled
    assert before == 6
    maps.explain(ExplainRequest(request, Cell(0, 2, 3)), quiet)
    del computed[:]
    shares: list[float] = []
    again = maps.probability(pickle.loads(pickle.dumps(asked)), shares.append)
    assert len(computed) == 3  # of the expected pose, and of the two draws that are left
    assert shares[0] > 0.65
    assert again.draws == whole.draws == 6
    assert np.array_equal(again.feasible, whole.feasible)
    assert (whole.feasible % 6 > 0).any()  # the draws differ

    with pytest.raises(Cancelled):
        maps.probability(asked, stop)
    other = ProbabilityRequest(request, replace(noise, position=0.0))
    found = maps.probability(other, quiet)
    monkeypatch.undo()
    monkeypatch.setattr(map_service, "DRAWS", 6)
    assert np.array_equal(found.feasible, MapService().probability(other, quiet).feasible)


def test_windows_of_a_shown_map(maps):
    request = State.of(load_small("bottle_on_table"), "").request
    shown = maps.map(request, quiet).map
    found = maps.windows(WindowsRequest(request), shown, quiet)
    assert np.array_equal(np.isnan(found.widest), ~shown.feasible)
    assert np.nanmax(found.widest) > 0.1
    rigid = State.of(load_small("ur5_bottle"), "").request  # whose arm has six joints
    shown = maps.map(rigid, quiet).map
    assert np.isnan(maps.windows(WindowsRequest(rigid), shown, quiet).widest).all()


def test_progress_may_stop_it(maps):
    def stop(share: float) -> None:
        raise Cancelled

    with pytest.raises(Cancelled):
        maps.map(changes.moved(State.of(load_small("bottle_on_table"), ""), x=0.51).request, stop)


def test_what_the_object_is_inside_of_is_named_with_the_depth(maps):
    state = changes.moved(State.of(load_small("bottle_on_table"), ""), z=-0.03)
    assert maps.map(state.request, quiet).contacts == ("bottle is 30 mm inside table",)
    beside = changes.moved(State.of(load_small("bottle_on_table"), ""), x=0.62, y=-0.26)
    (contact,) = maps.map(beside.request, quiet).contacts
    assert contact.startswith("bottle is ")
    assert contact.endswith(" mm inside parcel")
    assert maps.map(State.of(load_small("bottle_on_table"), "").request, quiet).contacts == ()


def test_plans_follow_the_objects_that_were_moved():
    scene = load_small("pick_pour_place")
    state = changes.moved(State.of(scene, ""), y=-0.3)
    results = results_of(PlanRequest(scene, "sequential", "best", "panda", state.poses))
    result = results.plan
    assert result
    assert result.plan.tasks[0].object_pose.position[1] == pytest.approx(-0.3)
    assert results.maps["pick", "panda"].request == state.request
    assert results.maps["pour", "panda"].request == MapRequest(scene, "panda", "pour")


def test_one_arm_is_not_enough_for_the_bimanual_planner():
    with pytest.raises(SymgraspError, match="two or more arms"):
        results_of(PlanRequest(load_small("bottle_on_table"), "bimanual", name="pick"))


def test_a_known_map_is_not_computed_again(maps, monkeypatch):
    known = small_map("soda_can", "pick", "panda")
    monkeypatch.setattr(MapMaker, "map", None)
    found, _ = maps.maps([known.request], {("pick", "panda"): known}, quiet)
    assert found == {("pick", "panda"): known}


def test_a_map_bears_the_name_of_the_scene_it_was_asked_for(maps):
    """Also where the world of another scene with the same content is used again."""
    scene = load_small("soda_can", heights=4, angles=8, redundancy=2)
    other = replace(scene, file=scene.file.model_copy(update={"name": "other"}))
    names = [maps.map(State.of(s, "").request, quiet).map.scene for s in (scene, other)]
    assert names == ["soda_can", "other"]
