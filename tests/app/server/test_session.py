"""Many sessions on one server, without browsers: what they share and leave, what breaks and is mended."""

from __future__ import annotations

import asyncio
import ctypes
import gc
import logging
import multiprocessing
import os
import random
import re
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from html import escape, unescape
from multiprocessing.connection import wait
from pathlib import Path

import pytest

from app.compute import compute_process, process_pool
from app.compute.cache import SharedCache
from app.compute.job_queue import Job, JobQueue
from app.compute.warm_up import compute_first_map
from app.panels.pose_panel import PosePanel
from app.panels.status_panel import StatusPanel
from app.scene3d.scene_view import SceneView
from app.server.actions import Actions
from app.server.lobby import Lobby, open_lobby
from app.server.session import Session
from app.server.viser_server import any_port
from symgrasp.world import BulletWorld
from tests.app import failures
from tests.app.wire import WAIT, Wire
from tests.conftest import write_scene

pytestmark = pytest.mark.filterwarnings("ignore:Queued a .* on a closed connection")


@dataclass
class Server:
    """The page being served: its maps, its lobby and the port of its front door."""

    cache: SharedCache
    lobby: Lobby
    port: int

    def visit(self, query: str = "") -> Wire:
        return Wire(self.port, query)

    def wait_until_empty(self) -> None:
        """Wait until every session has been closed, with its threads."""
        for thread in threading.enumerate():
            if thread.name.startswith(("jobs", "draw")):
                thread.join(30)
        assert self.lobby.wait_until_empty(30)


@contextmanager
def start_server(scene: str = "bottle_on_table") -> Iterator[Server]:
    cache = SharedCache(scene)
    compute_first_map(cache)
    port = any_port()
    with open_lobby(cache, "127.0.0.1", port) as lobby:
        yield Server(cache, lobby, port)


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    with start_server() as server:
        yield server


def picture(html: str) -> str:
    """The map that is shown, as it is sent."""
    found = re.search(r'<img alt="map" src="([^"]+)"', html)
    return found[1] if found else ""


def ready(html: str) -> bool:
    """Whether the newest map is shown and nothing is being done."""
    return bool(picture(html)) and "Ready." in html and "earlier pose" not in html


def entered(visitor: Wire, label: str) -> list[object]:
    """What stands in the inputs of that label."""
    return [w["value"] for w in visitor.widgets.values() if w.get("label") == label]


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


def before_and_after_a_hundred_sessions() -> tuple[Left, Left]:
    """Run in a process of its own: what other tests leave would blur the memory."""
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
        for round_ in range(1, 11):
            ten_at_once(round_)
        return before, Left.now()


@pytest.mark.soak
def test_a_hundred_sessions_come_and_go_and_leave_nothing():
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as alone:
        before, after = alone.submit(before_and_after_a_hundred_sessions).result()
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
        rotations = [w["value"] for w in other.widgets.values() if w.get("label") == "Rotation (°)"]
        assert rotations == [0.0]


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


def processes() -> list[int]:
    """The processes that compute for somebody, or are kept for it, oldest first."""
    return sorted(process.pid or 0 for process in multiprocessing.active_children())


def signal_processes(number: int) -> None:
    for pid in processes():
        os.kill(pid, number)


def kill_processes() -> None:
    """Kill them all, and wait until that can be known: the spare one must not be taken for alive."""
    ends = [os.dup(process.sentinel) for process in multiprocessing.active_children()]
    signal_processes(signal.SIGKILL)
    for end in ends:
        assert wait([end], timeout=WAIT)
        os.close(end)


@pytest.mark.parametrize("restart", ["Restart", "the next change"])
def test_a_killed_process_is_reported_loses_nothing_and_can_be_restarted(server, restart):
    with server.visit() as visitor:
        first = picture(visitor.wait_for(ready))
        visitor.set("y (cm)", 1.0 if restart == "Restart" else 2.0)
        visitor.wait_for(lambda html: picture(html) != first and ready(html))
        visitor.set("Rotation (°)", 20.0)
        signal_processes(signal.SIGSTOP)  # so that it cannot be done before it is killed
        visitor.set("x (cm)", 51.5 if restart == "Restart" else 51.0)
        visitor.wait_for("Computing the map of pick")
        kill_processes()
        visitor.wait_for("the process that computes ended unexpectedly (SIGKILL); what you set is kept")
        visitor.wait_for(lambda _: any(w.get("label") == "Restart" for w in visitor.widgets.values()))
        if restart == "Restart":
            visitor.set("Restart", True)
            query = "at.pick=51.5,1,0,0,0,0&turn=20"
        else:
            visitor.set("x (cm)", 53.0)
            query = "at.pick=53,2,0,0,0,0&turn=20"
        with server.visit(query) as fresh:
            right = picture(fresh.wait_for(ready))
        visitor.wait_for(lambda html: picture(html) == right and "SIGKILL" not in html)


def test_cancelling_takes_effect_though_the_process_hears_nothing(server, monkeypatch):
    with server.visit() as visitor:
        first = picture(visitor.wait_for(ready))
        visitor.set("y (cm)", 3.0)
        visitor.wait_for(lambda html: picture(html) != first and ready(html))
        signal_processes(signal.SIGSTOP)
        visitor.set("x (cm)", 52.5)
        visitor.wait_for("Computing the map of pick … 0 %")
        visitor.set("Rotation (°)", 10.0)  # the page lives meanwhile
        visitor.set("Cancel", True)
        visitor.wait_for("Stopped: no map for this pose yet.")
        monkeypatch.setattr(compute_process, "CANCEL_TIMEOUT", 0.0)
        os.kill(processes()[-1], signal.SIGCONT)  # the one that is kept; the other one never answers
        visitor.set("Compute the map", True)
        visitor.wait_for(ready)


def test_what_is_entered_while_the_page_writes_its_inputs_stays_entered(server, monkeypatch):
    begun, moved = threading.Event(), threading.Event()
    show, change = StatusPanel.show, Session.change

    def noted(session, *arguments):
        change(session, *arguments)
        if session.state and session.state.base.x == 0.53:
            moved.set()

    def slow(panel, state):
        """Draw the object that was put back only when it has been moved once more."""
        if state.base.x == 0.55:
            begun.set()
            assert moved.wait(30)
        show(panel, state)

    monkeypatch.setattr(Session, "change", noted)
    with server.visit() as visitor:
        visitor.wait_for(ready)
        visitor.set("x (cm)", 51.0)
        visitor.wait_for_quiet()
        monkeypatch.setattr(StatusPanel, "show", slow)
        visitor.trigger("Put the object back")
        assert begun.wait(30)
        visitor.set("x (cm)", 53.0)
        assert moved.wait(30)
        visitor.wait_for_quiet()
        visitor.wait_for(ready)
        assert entered(visitor, "x (cm)") == [53.0]


def test_what_a_person_asks_for_in_two_ways_at_once_leaves_nothing_half_begun(server, monkeypatch):
    """A button is heard in a thread of viser's pool, a slider on its loop."""
    submit, asked, overtaken = JobQueue.submit, threading.Event(), threading.Event()

    def slow(queue, job):
        """Give the plan to the queue only when the map has overtaken it, if it can."""
        in_pool = threading.current_thread().name.startswith("ThreadPool")
        if in_pool and not asked.is_set():
            asked.set()
            overtaken.wait(1)
        submit(queue, job)
        if not in_pool:
            overtaken.set()

    with server.visit() as visitor:
        first = picture(visitor.wait_for(ready))
        monkeypatch.setattr(JobQueue, "submit", slow)
        visitor.trigger("Plan one grasp for all tasks")
        assert asked.wait(30)
        visitor.set("x (cm)", 47.5)
        visitor.wait_for(lambda html: picture(html) != first and ready(html))


def test_a_command_before_the_first_scene_stands_does_not_keep_it_away(server, monkeypatch):
    linked, open_scene, asked = SharedCache.linked, Actions.open_scene, threading.Event()

    def slow(*args):
        """Load the first scene only when another has been asked for."""
        assert asked.wait(30)
        return linked(*args)

    def opened(actions, name):
        open_scene(actions, name)
        asked.set()

    monkeypatch.setattr(SharedCache, "linked", slow)
    monkeypatch.setattr(Actions, "open_scene", opened)
    with server.visit("scene=soda_can") as visitor:
        visitor.trigger("Next scene")
        assert "soda_can" in title(visitor.wait_for(ready))


def test_a_first_scene_that_breaks_in_an_unexpected_way_leaves_no_empty_page(server, monkeypatch):
    def broken(*_):
        raise RuntimeError("of this test")

    monkeypatch.setattr(SharedCache, "linked", broken)
    with server.visit("scene=soda_can") as visitor:
        visitor.wait_for("unexpected RuntimeError: of this test")
        assert "bottle_on_table" in title(visitor.wait_for(ready))


def test_a_page_that_cannot_be_built_says_so_and_leaves_nothing(server, monkeypatch):
    def broken(*_: object, **__: object) -> None:
        raise RuntimeError("of <this> test")

    server.wait_until_empty()
    before = set(threading.enumerate())
    monkeypatch.setattr(SceneView, "__init__", broken)
    with server.visit() as visitor:
        html = visitor.wait_for("This page could not be opened (RuntimeError: of &lt;this&gt; test)")
        assert "Loading" not in html
        for thread in set(threading.enumerate()) - before:
            if thread.name.startswith(("jobs", "draw")):
                thread.join(30)
                assert not thread.is_alive()
        assert server.lobby.wait_until_empty(0.0)


@pytest.mark.parametrize(
    ("broken", "command"),
    [
        ("app.server.actions.scene_yaml", "Save the scene (YAML)"),
        ("app.server.actions.Link.of", "Make a link"),
        ("app.server.actions.snapshot_html", "Save the 3D view (HTML)"),
        ("app.state.changes.clear_pick", "Let go of the grasp"),
    ],
)
def test_what_breaks_in_an_unexpected_way_is_said_on_the_page_and_traced_in_the_log(
    server, monkeypatch, caplog, broken, command
):
    def breaks(*_: object, **__: object) -> None:
        raise RuntimeError("of\x1b this <test>")

    with server.visit() as visitor:
        visitor.wait_for(ready)
        monkeypatch.setattr(broken, breaks)
        visitor.trigger(command)
        html = visitor.wait_for("unexpected RuntimeError: of")
        assert r"of\x1b this &lt;test&gt;" in html
        assert "Traceback" not in html
        visitor.set("Rotation (°)", 20.0)  # and all goes on
        visitor.wait_for(ready)
    (record,) = [r for r in caplog.records if r.exc_info]
    assert isinstance(record.exc_info[1], RuntimeError)


def test_inputs_that_a_broken_picture_left_unwritten_are_written_with_the_next(server, monkeypatch):
    show, broke = StatusPanel.show, threading.Event()

    def breaks_once(panel, state):
        if state.base.x == 0.55 and not broke.is_set():
            broke.set()
            raise RuntimeError("of this test")
        show(panel, state)

    with server.visit() as visitor:
        visitor.wait_for(ready)
        visitor.set("x (cm)", 51.0)
        visitor.wait_for_quiet()
        monkeypatch.setattr(StatusPanel, "show", breaks_once)
        visitor.trigger("Put the object back")
        visitor.wait_for("the picture could not be drawn: RuntimeError: of this test")
        visitor.wait_for(lambda _: entered(visitor, "x (cm)") == [55.0])


def test_what_a_person_enters_is_never_overwritten_before_it_is_read(server, monkeypatch):
    """viser stores an entered value and reads it in one step of its event loop; inputs are written there."""
    write, loops = PosePanel.write_inputs, []

    def recorded(panel, state):
        loops.append(asyncio.get_running_loop())  # raises on any other thread
        write(panel, state)

    monkeypatch.setattr(PosePanel, "write_inputs", recorded)
    with server.visit() as visitor:
        visitor.wait_for(ready)
        visitor.trigger("Put the object back")
        visitor.wait_for_quiet()
    assert loops
    assert set(loops) == {loops[0]}


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


CHOICES = {
    "Rotation (°)": [-120.0, 0.0, 15.25, 90.0],
    "x (cm)": [40.0, 50.0, 55.0],
    "z (cm)": [0.0, 10.0],
    "Lean (°)": [0.0, 20.0],
    "h (cm)": [2.0, 10.0, 99.0],
    "θ (°)": [-170.0, 0.0, 60.0],
    "Roll": ["either", "0°", "180°"],
    "Flat map": [True, False],
    "Drag handles": [True, False],
    "Colours show": ["reason", "feasible", "clearance"],
    "Dark": [True, False],
    "Object": ["the scene's own", "wine_bottle"],
    "Task": ["pick", "pour", "place"],
    "Undo": None,
    "Redo": None,
    "Put it back": [True],
    "Let go": [True],
    "Cancel": [True],
    "One grasp for all tasks": [True],
    "Scene": ["bottle_on_table", "pick_pour_place"],
}


@pytest.mark.random_walk
@pytest.mark.parametrize("seed", range(3))
def test_hundreds_of_random_actions_end_in_the_picture_that_a_fresh_page_shows(server, caplog, seed):
    caplog.set_level(logging.ERROR)
    chance = random.Random(seed)
    with server.visit() as visitor:
        visitor.wait_for(ready)
        for _ in range(150):
            label = chance.choice(list(CHOICES))
            if CHOICES[label] is None:
                visitor.trigger(label)
            elif any(w.get("label") == label for w in visitor.widgets.values()):
                visitor.set(label, chance.choice(CHOICES[label]))
            if chance.random() < 0.2:
                visitor.wait_for(lambda html: bool(picture(html)))
        visitor.wait_for_quiet()
        visitor.set("x (cm)", 53.0)  # also ends whatever is being planned or was cancelled
        visitor.wait_for_quiet()
        visitor.set("h (cm)", 10.0)
        visitor.wait_for(lambda html: ready(html) and "h = 10 cm" in html)
        visitor.trigger("Make a link")
        made = visitor.wait_for('class="sg-link"')
        with server.visit(link_in(made)) as fresh:
            fresh.wait_for(lambda html: ready(html) and "h = 10 cm" in html)
            wait_until_alike(visitor, fresh, picture, title, legend)
    assert caplog.records == []


def test_a_link_opens_the_tasks_that_a_person_made(server):
    name = "<b>tilt</b>, pour & ✓"
    with server.visit() as visitor:
        visitor.wait_for(ready)
        visitor.set("Rotation (°)", 20.0)
        visitor.trigger("Add a task with the object here")
        visitor.wait_for(lambda _: any(w.get("value") == "task 2" for w in visitor.widgets.values()))
        visitor.set("Task name", name)
        visitor.set("Chosen task", "Rename")
        visitor.wait_for(escape(name))
        visitor.set("Chosen task", "Earlier")
        visitor.wait_for(f"1 · {escape(name)}")
        visitor.set("x (cm)", 52.0)
        visitor.set("Object", "wine_bottle")  # the tasks stay
        visitor.wait_for(lambda html: ready(html) and "the wine" in html)
        visitor.trigger("Make a link")
        made = visitor.wait_for('class="sg-link"')
        assert "has changed since" not in made
        assert escape(name) in tasks(made)
        with server.visit(link_in(made)) as fresh:
            fresh.wait_for(lambda html: ready(html) and escape(name) in tasks(html))
            wait_until_alike(visitor, fresh, tasks, title, picture)
        visitor.look_from(2.0, 1.5, 1.0)
        visitor.wait_for("The page has changed since")


def wait_until_alike(one: Wire, other: Wire, *parts: Callable[[str], str]) -> None:
    """Read on until both show the same: each part comes when it is drawn, the map for itself."""
    end = time.monotonic() + WAIT
    while differing := [part.__name__ for part in parts if part(one.html()) != part(other.html())]:
        assert time.monotonic() < end, f"{differing} differ"
        one.wait_for_quiet(0.1)
        other.wait_for_quiet(0.1)


def link_in(html: str) -> str:
    """What stands behind the ? of the link that was made."""
    return unescape(re.findall(r'class="sg-link" href="[^"?]*\?([^"]*)"', html)[-1])


def tasks(html: str) -> str:
    """Return the list of tasks, nothing where it has not come yet."""
    return "".join(re.findall(r'<div class="sg sg-tasks">(.*?)</small></div>', html))


def title(html: str) -> str:
    return re.findall(r"<h1>(.*?)</h1>", html)[0]


def legend(html: str) -> str:
    return re.findall(r"<ul>(.*?)</ul>", html)[-1]


def test_a_scene_from_a_file_may_be_hostile_in_every_name(server, content, tmp_path):
    content["name"] = "<script>"
    port = any_port()
    with (
        open_lobby(SharedCache(str(write_scene(tmp_path, content))), "127.0.0.1", port),
        Wire(port) as visitor,
    ):
        assert "<script>" not in visitor.wait_for(ready)
