"""The process that computes for one browser: same results, same objects, no harm when it dies, no orphans."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
from subprocess import PIPE

import numpy as np
import pytest

from app.compute import process_pool
from app.compute.cache import SharedCache
from app.compute.channel import Channel
from app.compute.compute_process import ComputeProcess, ProcessDied
from app.compute.map_service import MapService
from app.compute.plan_service import PlanRequest
from app.compute.process_pool import ProcessPool
from app.state.plan_results import PlanResults
from app.state.requests import CompareRequest, ExplainRequest, MapRequest, MapResult
from app.state.state import State
from symgrasp.errors import Cancelled, NoPlanError, PlanError
from symgrasp.feasibility.cell import Cell
from symgrasp.feasibility.map import FeasibilityMap
from tests.app import failures
from tests.app.state.test_state import small_map
from tests.conftest import load_small


@pytest.fixture(scope="module")
def store() -> SharedCache:
    return SharedCache("bottle_on_table")


@pytest.fixture(scope="module")
def pool(store):
    pool = ProcessPool(store.folders)
    yield pool
    pool.close()
    assert multiprocessing.active_children() == []


@pytest.fixture
def shop(store, pool):
    shop = ComputeProcess(store, pool)
    yield shop
    shop.close()


def quiet(share: float) -> None:
    """Progress that nobody watches."""


def feasible_cell(m: FeasibilityMap) -> Cell:
    roll, row, column = np.argwhere(m.feasible)[0].tolist()
    return Cell(roll, row, column)


def process_of(shop: ComputeProcess) -> int:
    assert shop.pid
    return shop.pid


def test_what_comes_back_is_what_a_workbench_computes_of_the_same_scene(shop, store):
    scene = load_small("bottle_on_table")
    request = State.of(scene, "").move(x=0.5).request
    result = shop.map(request, quiet)
    bench = MapService(SharedCache("bottle_on_table"))
    right = bench.map(request, quiet)
    assert np.array_equal(result.map.reason, right.map.reason)
    assert np.array_equal(result.map.q, right.map.q, equal_nan=True)
    assert result.request.scene is scene
    assert store.map(request) is result
    with pytest.raises(ValueError, match="read-only"):
        result.map.reason[0, 0, 0] = 0
    check = shop.check(CompareRequest(request, 0.4), result.map, quiet)
    assert check.differing == 0
    asked = ExplainRequest(request, feasible_cell(result.map))
    candidates = shop.explain(asked, quiet).explanation.candidates
    assert candidates
    assert [v.reason for v in candidates] == [
        v.reason for v in bench.explain(asked, quiet).explanation.candidates
    ]
    bench.close()


def test_plans_are_listed_on_in_the_same_process_and_not_in_another(shop, store):
    scene = load_small("pick_pour_place", heights=12, angles=24)
    plan_results = shop.run(PlanRequest(scene, "sequential", "best", "panda"), PlanResults(), quiet)
    assert all(result.request.scene is scene for result in plan_results.maps.values())
    assert all(store.map(result.request) is result for result in plan_results.maps.values())
    assert shop.more(plan_results.maps, quiet) == ((), False)
    shop.close()
    with pytest.raises(NoPlanError, match="plan again"):
        shop.more(plan_results.maps, quiet)


def test_an_error_arrives_as_it_was_raised(shop):
    with pytest.raises(PlanError, match=r"bad\.json: ") as caught:
        shop.open(b"{", "bad.json", quiet)
    assert caught.value.source == "bad.json"


def test_whatever_a_library_raises_arrives(store, monkeypatch):
    monkeypatch.setattr(process_pool, "serve", failures.serve_broken)
    pool = ProcessPool(store.folders)
    shop = ComputeProcess(store, pool)
    with pytest.raises(RuntimeError, match="Strange: of this process only"):
        shop.map(State.of(load_small("bottle_on_table"), "").request, quiet)
    shop.close()
    pool.close()


def test_a_cancel_is_heard_by_the_process_which_goes_on(store, monkeypatch):
    monkeypatch.setattr(process_pool, "serve", failures.serve_endless)
    pool = ProcessPool(store.folders)
    shop = ComputeProcess(store, pool)
    state = State.of(load_small("bottle_on_table"), "")

    def impatient(share: float) -> None:
        if share == 0.5:
            raise Cancelled

    with pytest.raises(Cancelled):
        shop.map(state.request, impatient)
    process = process_of(shop)
    cell = feasible_cell(small_map("bottle_on_table", "pick", "panda").map)
    assert shop.explain(ExplainRequest(state.request, cell), quiet).explanation.candidates
    assert process_of(shop) == process
    shop.close()
    pool.close()


def test_a_process_that_dies_is_told_and_followed_by_another(store, monkeypatch):
    with monkeypatch.context() as trouble:
        trouble.setattr(process_pool, "serve", failures.serve_endless)
        pool = ProcessPool(store.folders)
        shop = ComputeProcess(store, pool)

        def kill(share: float) -> None:
            if share == 0.5:
                os.kill(process_of(shop), signal.SIGSEGV)
                pool.close()  # the next one is not of that kind
                trouble.undo()

        state = State.of(load_small("soda_can"), "")
        with pytest.raises(ProcessDied, match=r"ended unexpectedly \(SIGSEGV\)"):
            shop.map(state.request, kill)
    shop.map(state.request, quiet)
    idle = next(p for p in multiprocessing.active_children() if p.pid == shop.pid)
    idle.kill()  # nobody needs to know
    idle.join()
    shop.map(state.move(x=0.43).request, quiet)
    shop.close()


SERVER = """
import multiprocessing, sys
from app.compute import Store
from app.state import State
from app.workshop import Staff, Workshop
store = Store("bottle_on_table")
staff = Staff(store.folders)
staff.prepare()
shop = Workshop(store, staff)
shop.map(State.of(store.scene("bottle_on_table"), "").move(x=0.5).request, lambda share: None)
print(len(multiprocessing.active_children()), flush=True)
sys.stdin.read()
"""


def test_a_server_that_is_killed_leaves_no_process_behind():
    with subprocess.Popen([sys.executable, "-c", SERVER], stdin=PIPE, stdout=PIPE, text=True) as server:
        assert server.stdout
        assert server.stdout.readline() == "2\n"
        server.kill()
        server.communicate(timeout=60)  # ends when the last one who could write is gone


def test_what_both_ends_know_crosses_once_and_maps_are_forgotten_on_both():
    here, there = multiprocessing.Pipe()
    one, other = Channel(here, "one"), Channel(there, "other")
    scene = load_small("bottle_on_table")
    moved = State.of(scene, "").move(x=0.5).request.moved_scene()
    one.send((scene, moved))
    first, second = other.receive()
    for part in ("robots", "obstacles", "profile", "settings"):
        assert getattr(first, part) is getattr(second, part)
    request = MapRequest(first, "panda", "pick")
    other.send((request, MapResult(request, small_map("bottle_on_table", "pick", "panda").map)))
    back, result = one.receive()
    assert back.scene is result.request.scene is scene
    assert back.place == MapRequest(scene, "panda", "pick").place
    one.send(result)
    again = other.receive()
    known = one.known
    assert known == other.known
    one.forget_maps()
    other.forget_maps()
    assert one.known == other.known == known - 1
    one.send(result)
    assert other.receive() is not again
