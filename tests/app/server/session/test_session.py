"""Many sessions on one server, without browsers: what they share, and what they leave."""

from __future__ import annotations

import ctypes
import gc
import multiprocessing
import sys
import threading
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import pytest

from app.compute import process_pool
from app.compute.cache import SharedCache
from app.compute.job_queue import Job, JobQueue
from app.scene3d.scene_view import SceneView
from app.server.door.lobby import open_lobby
from app.server.door.viser_server import any_port
from app.server.session.session import Session
from symgrasp.world import BulletWorld
from tests.app import failures
from tests.app.server.session.served import entered, picture, processes, ready, start_server
from tests.app.wire import Wire

pytestmark = pytest.mark.filterwarnings("ignore:Queued a .* on a closed connection")


def alive(*kinds: type) -> list[int]:
    gc.collect()
    return [sum(isinstance(found, kind) for found in gc.get_objects()) for kind in kinds]


def megabytes() -> float:
    """Memory of this process, without what the C library keeps for later."""
    if sys.platform != "linux":
        return 0.0
    gc.collect()
    ctypes.CDLL(None).malloc_trim(0)
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6


@dataclass(frozen=True)
class Left:
    """What there is in a process of a server that nobody visits.

    Attributes:
        objects: how many sessions, views and physics worlds.
        threads: how many threads.
        processes: how many processes that compute.
        memory: of it (MB).
    """

    objects: list[int]
    threads: int
    processes: int
    memory: float

    @classmethod
    def now(cls) -> Left:
        objects = alive(Session, SceneView, BulletWorld)
        return cls(objects, threading.active_count(), len(processes()), megabytes())


def before_and_after_sessions(rounds: int) -> tuple[Left, Left]:
    """Let ten at once come and go, so many times; in a process of its own: other tests blur the memory."""
    with start_server() as server, ThreadPoolExecutor(10) as people:

        def come_and_go(k: int) -> None:
            with server.visit() as visitor:
                first = picture(visitor.wait_for(ready))
                if k % 5 == 0:  # needs a physics world
                    visitor.set("x (cm)", 40 + 0.1 * k)
                    visitor.wait_for(lambda html: picture(html) != first and ready(html))

        def ten_at_once(round_: int) -> None:
            list(people.map(come_and_go, range(10 * round_, 10 * round_ + 10)))
            server.wait_until_empty()

        ten_at_once(0)
        before = Left.now()
        for round_ in range(1, 1 + rounds):
            ten_at_once(round_)
        return before, Left.now()


@pytest.mark.soak
def test_sessions_come_and_go_and_leave_nothing(thorough):
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as alone:
        before, after = alone.submit(before_and_after_sessions, 10 if thorough else 3).result()
    assert after.objects == before.objects == [0, 0, 0]
    assert after.threads <= before.threads + 32  # viser's pool grows up to this many
    assert after.processes == 1  # the one that is kept for the next
    assert after.memory - before.memory < 60  # maps that the cache keeps; a world alone takes some 10


def test_nobody_sees_the_drags_of_others(server):
    with server.visit() as one, server.visit("scene=soda_can") as other:
        first = picture(one.wait_for(ready))
        can = other.wait_for(lambda html: ready(html) and "soda_can" in html)
        for degrees in range(0, 90, 3):
            one.set("Rotation (°)", float(degrees))
        turned = one.wait_for(lambda html: picture(html) != first and ready(html))
        other.set("Flat map", False)
        other.trigger("Next roll")
        seen = other.wait_for(lambda html: picture(html) != picture(can) and ready(html))
        assert "soda_can" in seen
        assert "soda_can" not in turned
        assert entered(other, "Rotation (°)") == [0.0]


def test_a_change_looks_a_map_up_once_and_computes_it_only_if_it_is_not_known(server, monkeypatch):
    look_up, submit = SharedCache.map, JobQueue.submit
    looked_up: list[bool] = []
    submitted: list[Job] = []

    def counted(cache, request):
        known = look_up(cache, request)
        looked_up.append(known is not None)
        return known

    def noted(queue, job):
        submitted.append(job)
        submit(queue, job)

    with server.visit() as visitor:
        first = picture(visitor.wait_for(ready))
        monkeypatch.setattr(SharedCache, "map", counted)
        monkeypatch.setattr(JobQueue, "submit", noted)
        visitor.set("x (cm)", 56.5)
        moved = picture(visitor.wait_for(lambda html: picture(html) != first and ready(html)))
        assert (looked_up, len(submitted)) == ([False], 1)
        visitor.set("x (cm)", 55.0)
        visitor.wait_for(lambda html: picture(html) != moved and ready(html))
        assert (looked_up, len(submitted)) == ([False, True], 1)


def test_whoever_has_not_loaded_the_picture_gets_no_session(server):
    class Stranger(Wire):
        def greet(self, path: str) -> None:
            self.met = path

    server.wait_until_empty()
    with Stranger(server.port) as stranger:
        assert "Loading" in stranger.wait_for("Loading")
        assert server.lobby.wait_until_empty(0.0)
        assert [w for w in stranger.widgets.values() if w.get("label")] == []


def test_the_page_says_that_it_waits_for_code_to_be_compiled(server, monkeypatch):
    monkeypatch.setattr(process_pool, "serve", failures.serve_compiling)
    port = any_port()
    with open_lobby(server.cache, "127.0.0.1", port), Wire(port) as visitor:
        visitor.wait_for(ready)
        visitor.set("x (cm)", 54.5)
        visitor.wait_for(lambda _: any(w.get("value") == 50.0 for w in visitor.widgets.values()))
        visitor.wait_for("Compiling, once on this machine: half a minute …")
        visitor.set("Cancel", True)
        assert "Compiling" not in visitor.wait_for("Stopped: no map for this pose yet.")


def test_the_page_shows_a_coarse_map_and_says_so_until_the_exact_one_is_compiled(server, monkeypatch):
    monkeypatch.setattr(process_pool, "serve", failures.serve_coarse)
    port = any_port()
    with open_lobby(server.cache, "127.0.0.1", port), Wire(port) as visitor:
        assert "preliminary" not in visitor.wait_for(ready)
        visitor.set("x (cm)", 50.0)
        visitor.wait_for("this map is coarse")
        visitor.wait_for(lambda _: "coarse and preliminary" in visitor.map.title)
        visitor.trigger("Put the object back")  # where its map is known
        visitor.wait_for(lambda html: "Ready." in html and "preliminary" not in visitor.map.title)
