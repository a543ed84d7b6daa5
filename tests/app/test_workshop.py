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

from app import workshop
from app.asking import CheckRequest, ExplainRequest
from app.compute import Store, Workbench
from app.plan_bench import PlanOrder
from app.plan_book import PlanBook
from app.shipping import Line
from app.state import State
from app.values import MapRequest, MapResult
from app.workshop import Died, Staff, Workshop
from symgrasp.errors import Cancelled, NoPlanError, PlanError
from symgrasp.feasibility import Cell, FeasibilityMap
from tests.app import troubles
from tests.app.test_state import small_map
from tests.conftest import load_small


@pytest.fixture(scope="module")
def store() -> Store:
    return Store("bottle_on_table")


@pytest.fixture(scope="module")
def staff(store):
    staff = Staff(store.folders)
    yield staff
    staff.close()
    assert multiprocessing.active_children() == []


@pytest.fixture
def shop(store, staff):
    shop = Workshop(store, staff)
    yield shop
    shop.close()


def quiet(share: float) -> None:
    """Progress that nobody watches."""


def feasible_cell(m: FeasibilityMap) -> Cell:
    roll, row, column = np.argwhere(m.feasible)[0].tolist()
    return Cell(roll, row, column)


def process_of(shop: Workshop) -> int:
    assert shop.pid
    return shop.pid


def test_what_comes_back_is_what_a_workbench_computes_of_the_same_scene(shop, store):
    scene = load_small("bottle_on_table")
    request = State.of(scene, "").move(x=0.5).request
    result = shop.map(request, quiet)
    bench = Workbench(Store("bottle_on_table"))
    right = bench.map(request, quiet)
    assert np.array_equal(result.map.reason, right.map.reason)
    assert np.array_equal(result.map.q, right.map.q, equal_nan=True)
    assert result.request.scene is scene
    assert store.map(request) is result
    with pytest.raises(ValueError, match="read-only"):
        result.map.reason[0, 0, 0] = 0
    check = shop.check(CheckRequest(request, 0.4), result.map, quiet)
    assert check.differing == 0
    asked = ExplainRequest(request, feasible_cell(result.map))
    verdicts = shop.explain(asked, quiet).explanation.verdicts
    assert verdicts
    assert [v.reason for v in verdicts] == [
        v.reason for v in bench.explain(asked, quiet).explanation.verdicts
    ]
    bench.close()


def test_plans_are_listed_on_in_the_same_process_and_not_in_another(shop, store):
    scene = load_small("pick_pour_place", heights=12, angles=24)
    book = shop.run(PlanOrder(scene, "sequential", "best", "panda"), PlanBook(), quiet)
    assert all(result.request.scene is scene for result in book.maps.values())
    assert all(store.map(result.request) is result for result in book.maps.values())
    assert shop.more(book.maps, quiet) == ((), False)
    shop.close()
    with pytest.raises(NoPlanError, match="plan again"):
        shop.more(book.maps, quiet)


def test_an_error_arrives_as_it_was_raised(shop):
    with pytest.raises(PlanError, match=r"bad\.json: ") as caught:
        shop.open(b"{", "bad.json", quiet)
    assert caught.value.source == "bad.json"


def test_whatever_a_library_raises_arrives(store, monkeypatch):
    monkeypatch.setattr(workshop, "serve", troubles.serve_broken)
    staff = Staff(store.folders)
    shop = Workshop(store, staff)
    with pytest.raises(RuntimeError, match="Strange: of this process only"):
        shop.map(State.of(load_small("bottle_on_table"), "").request, quiet)
    shop.close()
    staff.close()


def test_a_cancel_is_heard_by_the_process_which_goes_on(store, monkeypatch):
    monkeypatch.setattr(workshop, "serve", troubles.serve_endless)
    staff = Staff(store.folders)
    shop = Workshop(store, staff)
    state = State.of(load_small("bottle_on_table"), "")

    def impatient(share: float) -> None:
        if share == 0.5:
            raise Cancelled

    with pytest.raises(Cancelled):
        shop.map(state.request, impatient)
    process = process_of(shop)
    cell = feasible_cell(small_map("bottle_on_table", "pick", "panda").map)
    assert shop.explain(ExplainRequest(state.request, cell), quiet).explanation.verdicts
    assert process_of(shop) == process
    shop.close()
    staff.close()


def test_a_process_that_dies_is_told_and_followed_by_another(store, monkeypatch):
    with monkeypatch.context() as trouble:
        trouble.setattr(workshop, "serve", troubles.serve_endless)
        staff = Staff(store.folders)
        shop = Workshop(store, staff)

        def kill(share: float) -> None:
            if share == 0.5:
                os.kill(process_of(shop), signal.SIGSEGV)
                staff.close()  # the next one is not of that kind
                trouble.undo()

        state = State.of(load_small("soda_can"), "")
        with pytest.raises(Died, match=r"ended unexpectedly \(SIGSEGV\)"):
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
    one, other = Line(here, "one"), Line(there, "other")
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
