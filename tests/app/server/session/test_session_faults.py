"""What breaks in a session is said, loses nothing and leaves nothing; names may be hostile."""

from __future__ import annotations

import os
import signal
import threading

import pytest

from app.compute import compute_process
from app.compute.cache import SharedCache
from app.panels.status_panel import StatusPanel
from app.scene3d.scene_view import SceneView
from app.server.door.lobby import open_lobby
from app.server.door.viser_server import any_port
from app.server.session.actions import Actions
from tests.app.server.session.served import (
    entered,
    kill_processes,
    picture,
    processes,
    ready,
    signal_processes,
    title,
)
from tests.app.wire import Wire
from tests.conftest import write_scene

pytestmark = pytest.mark.filterwarnings("ignore:Queued a .* on a closed connection")


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
        ("app.server.session.actions.scene_yaml", "Save the scene (YAML)"),
        ("app.server.session.actions.Link.of", "Make a link"),
        ("app.server.session.actions.snapshot_html", "Save the 3D view (HTML)"),
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


def test_a_scene_from_a_file_may_be_hostile_in_every_name(server, content, tmp_path):
    content["name"] = "<script>"
    port = any_port()
    with (
        open_lobby(SharedCache(str(write_scene(tmp_path, content))), "127.0.0.1", port),
        Wire(port) as visitor,
    ):
        assert "<script>" not in visitor.wait_for(ready)
