"""The process that computes for one browser: same results, same objects, no harm when it dies, no orphans."""

from __future__ import annotations

import math
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
from subprocess import PIPE

import numpy as np
import pytest

from app.compute import compute_process, process_pool
from app.compute.cache import SharedCache
from app.compute.channel import Channel
from app.compute.compute_process import ComputeProcess, ProcessDied
from app.compute.map_service import MapService
from app.compute.plan_service import PlanRequest
from app.compute.process_pool import ProcessPool
from app.state import changes
from app.state.requests import CompareRequest, ExplainRequest
from app.state.state import State
from symgrasp.errors import Cancelled, NoPlanError, PlanError, SceneError
from symgrasp.feasibility.cell import Cell
from symgrasp.feasibility.map import FeasibilityMap
from tests.app import failures
from tests.app.choices.test_object_choice import stl
from tests.app.state.states import small_map
from tests.conftest import load_small


@pytest.fixture(scope="module")
def cache() -> SharedCache:
    return SharedCache("bottle_on_table")


@pytest.fixture(scope="module")
def pool(cache):
    pool = ProcessPool(cache.folders)
    yield pool
    pool.close()
    assert multiprocessing.active_children() == []


@pytest.fixture
def process(cache, pool):
    process = ComputeProcess(pool, cache.keep)
    yield process
    process.close()


def quiet(share: float) -> None:
    """Progress that nobody watches."""


def feasible_cell(m: FeasibilityMap) -> Cell:
    roll, row, column = np.argwhere(m.feasible)[0].tolist()
    return Cell(roll, row, column)


def pid_of(process: ComputeProcess) -> int:
    assert process.pid
    return process.pid


def test_a_coarse_map_comes_first_where_code_has_to_be_compiled(cache, monkeypatch):
    monkeypatch.setattr(process_pool, "serve", failures.serve_uncompiled)
    pool, shown, kept = ProcessPool(cache.folders), [], []
    process = ComputeProcess(pool, kept.append, preliminary=shown.append)
    try:
        request = changes.moved(State.of(load_small("bottle_on_table"), ""), x=0.52).request
        result = process.map(request, quiet)
    finally:
        process.close()
        pool.close()
    (coarse,) = shown
    assert coarse.map.preliminary
    assert coarse.request == request
    assert [computed.map for computed in kept] == [result.map]
    assert not result.map.preliminary
    assert np.isfinite(result.map.q[result.map.feasible]).all()


def test_what_samples_show_comes_first_where_all_of_the_redundancy_is_searched(cache):
    pool, shown, kept = ProcessPool(cache.folders), [], []
    process = ComputeProcess(pool, kept.append, preliminary=shown.append)
    auto = load_small("bottle_on_table").with_settings(redundancy="auto")
    try:
        for scene in (auto, auto.with_settings(redundancy=32)):
            result = process.map(State.of(scene, "").request, quiet)
    finally:
        process.close()
        pool.close()
    (sampled,) = (result for result in shown if not result.map.preliminary)  # every cell has its witness
    assert sampled.preliminary
    assert np.array_equal(sampled.map.reason, result.map.reason)
    assert [computed.preliminary for computed in kept] == [False, False]


def test_what_comes_back_is_what_the_service_computes_of_the_same_scene(process, cache):
    scene = load_small("bottle_on_table")
    request = changes.moved(State.of(scene, ""), x=0.5).request
    result = process.map(request, quiet)
    service = MapService()
    right = service.map(request, quiet)
    assert np.array_equal(result.map.reason, right.map.reason)
    assert np.array_equal(result.map.q, right.map.q, equal_nan=True)
    assert result.request.scene is scene
    found = cache.map(request)
    assert found
    assert found.map is result.map
    with pytest.raises(ValueError, match="read-only"):
        result.map.reason[0, 0, 0] = 0
    check = process.compare(CompareRequest(request, 0.4), result.map, quiet)
    assert check.differing == 0
    asked = ExplainRequest(request, feasible_cell(result.map))
    candidates = process.explain(asked, quiet).explanation.candidates
    assert candidates
    assert [c.reason for c in candidates] == [
        c.reason for c in service.explain(asked, quiet).explanation.candidates
    ]
    service.close()


def test_plans_are_listed_on_in_the_same_process_and_not_in_another(process, cache):
    scene = load_small("pick_pour_place", heights=12, angles=24)
    request = PlanRequest(scene, "sequential", "best", "panda")
    outcome, maps = process.plan(request, {}, quiet)
    assert outcome.plans
    assert set(maps) == {(task, "panda") for task in scene.tasks}
    assert all(result.request.scene is scene for result in maps.values())
    assert all(cache.map(result.request).map is result.map for result in maps.values())
    again, known = process.plan(request, maps, quiet)
    assert known == maps  # nothing was computed again
    assert [p.plan for p in again.plans] == [p.plan for p in outcome.plans]
    assert process.more(quiet) == ((), False)
    process.close()
    with pytest.raises(NoPlanError, match="plan again"):
        process.more(quiet)


def test_an_error_arrives_as_it_was_raised(process):
    with pytest.raises(PlanError, match=r"bad\.json: ") as caught:
        process.open(b"{", "bad.json", quiet)
    assert caught.value.source == "bad.json"


def test_whatever_a_library_raises_arrives(cache, monkeypatch):
    monkeypatch.setattr(process_pool, "serve", failures.serve_broken)
    pool = ProcessPool(cache.folders)
    process = ComputeProcess(pool, cache.keep)
    with pytest.raises(RuntimeError, match="Strange: of this process only"):
        process.map(State.of(load_small("bottle_on_table"), "").request, quiet)
    process.close()
    pool.close()


def test_a_cancel_is_heard_by_the_process_which_goes_on(cache, monkeypatch):
    monkeypatch.setattr(process_pool, "serve", failures.serve_endless)
    pool = ProcessPool(cache.folders)
    process = ComputeProcess(pool, cache.keep)
    state = State.of(load_small("bottle_on_table"), "")

    def impatient(share: float) -> None:
        if share == 0.5:
            raise Cancelled

    with pytest.raises(Cancelled):
        process.map(state.request, impatient)
    pid = pid_of(process)
    cell = feasible_cell(small_map("bottle_on_table", "pick", "panda").map)
    assert process.explain(ExplainRequest(state.request, cell), quiet).explanation.candidates
    assert pid_of(process) == pid
    process.close()
    pool.close()


def test_what_is_compiled_is_compiled_to_the_end_though_nobody_waits_for_it(tmp_path, monkeypatch):
    monkeypatch.setattr(process_pool, "serve", failures.serve_slow_compiler)
    os.mkfifo(tmp_path / "go on")
    pool = ProcessPool((tmp_path,))
    pids = []
    try:
        for _ in range(2):
            compiling = threading.Event()
            process = ComputeProcess(pool, compiling=compiling.set)

            def leave(_: float, compiling: threading.Event = compiling) -> None:
                if compiling.is_set():
                    raise Cancelled

            with pytest.raises(Cancelled):
                process.map(State.of(load_small("bottle_on_table"), "").request, leave)
            pids.append(process.pid)
            process.close()
        left = {child.pid: child for child in multiprocessing.active_children() if child.pid in pids}
        assert list(left) == pids[:1]  # the other one would compile the same
        (tmp_path / "go on").write_text("")
        left[pids[0]].join()
        assert (tmp_path / "compiled").is_dir()
    finally:
        pool.close()


def test_a_process_that_dies_is_reported_and_followed_by_another(cache, monkeypatch):
    with monkeypatch.context() as trouble:
        trouble.setattr(process_pool, "serve", failures.serve_endless)
        pool = ProcessPool(cache.folders)
        process = ComputeProcess(pool, cache.keep)

        def kill(share: float) -> None:
            if share == 0.5:
                os.kill(pid_of(process), signal.SIGSEGV)
                pool.close()  # the next one is not of that kind
                trouble.undo()

        state = State.of(load_small("soda_can"), "")
        with pytest.raises(ProcessDied, match=r"ended unexpectedly \(SIGSEGV\)"):
            process.map(state.request, kill)
    process.map(state.request, quiet)
    idle = next(p for p in multiprocessing.active_children() if p.pid == process.pid)
    idle.kill()  # nobody needs to know
    idle.join()
    process.map(changes.moved(state, x=0.43).request, quiet)
    process.close()


@pytest.fixture
def misbehaving(cache, monkeypatch):
    """Calls into a process whose parser of meshes does what the name of a file says."""
    monkeypatch.setattr(process_pool, "serve", failures.serve_parsers)
    pool = ProcessPool(cache.folders)
    process = ComputeProcess(pool, cache.keep)
    yield process
    process.close()
    pool.close()


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("hangs.stl", r"^hangs\.stl takes longer to read than 1 s$"),
        ("eats", r"^eats needs more memory than a session may use \(4 GB\)$"),
        ("aborts", r"ended unexpectedly \(SIGABRT\), perhaps because it needs more memory .* \(4 GB\)$"),
    ],
)
def test_a_parser_that_misbehaves_is_reported_and_the_next_file_is_read(
    misbehaving, name, message, monkeypatch
):
    def impatient(share: float) -> None:
        if share == 0.5:  # it has begun
            monkeypatch.setattr(compute_process, "READING_TIMEOUT", 1.0)

    with pytest.raises(ProcessDied, match=message):
        misbehaving.measure(name, b"", 1.0, None, impatient)
    assert misbehaving.pid is None
    monkeypatch.setattr(compute_process, "READING_TIMEOUT", 60.0)
    assert misbehaving.measure("a.stl", stl(), 1.0, None, quiet).name == "a"


def test_a_read_that_does_not_hear_a_cancel_ends_with_its_process(misbehaving, monkeypatch):
    monkeypatch.setattr(compute_process, "CANCEL_TIMEOUT", math.inf)  # of all else

    def impatient(share: float) -> None:
        if share == 0.5:  # it has begun
            raise Cancelled

    with pytest.raises(Cancelled):
        misbehaving.measure("hangs.stl", b"", 1.0, None, impatient)
    hanging = pid_of(misbehaving)
    assert misbehaving.measure("a.stl", stl(), 1.0, None, quiet).name == "a"
    assert pid_of(misbehaving) != hanging


def test_a_mounted_hand_is_that_of_the_scene_here(process):
    scene = load_small("log_iiwa_and_panda")
    mounted = process.mount(scene, "iiwa", "pr2", quiet)
    assert mounted.scene.map_sha256 == scene.with_hand("iiwa", "pr2").map_sha256
    with pytest.raises(SceneError, match="did you mean 'wsg50'"):
        process.mount(scene, "iiwa", "wsg5", quiet)


SERVER = """
import multiprocessing, sys
from app.compute.cache import SharedCache
from app.compute.compute_process import ComputeProcess
from app.compute.process_pool import ProcessPool
from app.state.requests import MapRequest
cache = SharedCache("bottle_on_table")
pool = ProcessPool(cache.folders)
pool.prepare()
process = ComputeProcess(pool)
process.map(MapRequest(cache.scene("bottle_on_table"), "panda", "pick"), lambda share: None)
print(len(multiprocessing.active_children()), flush=True)
sys.stdin.read()
"""


def test_a_server_that_is_killed_leaves_no_process_behind():
    with subprocess.Popen([sys.executable, "-c", SERVER], stdin=PIPE, stdout=PIPE, text=True) as server:
        assert server.stdout
        assert server.stdout.readline() == "2\n"
        server.kill()
        server.communicate(timeout=60)  # ends when the last one who could write is gone


def test_messages_arrive_as_they_were_sent_and_arrays_stay_read_only():
    here, there = multiprocessing.Pipe()
    one, other = Channel(here), Channel(there)
    scene = load_small("bottle_on_table")
    moved = changes.moved(State.of(scene, ""), x=0.5).request
    m = small_map("bottle_on_table", "pick", "panda").map
    one.send((moved, m))
    request, arrived = other.receive()
    assert request == moved
    assert request.scene.map_sha256 == scene.map_sha256
    assert np.array_equal(arrived.reason, m.reason)
    with pytest.raises(ValueError, match="read-only"):
        arrived.reason[0, 0, 0] = 0
    assert not other.poll()
    one.close()
    with pytest.raises(EOFError):
        other.receive()
