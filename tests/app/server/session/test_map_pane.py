"""The websocket of the map: who gets one, what it shows, and what becomes of what it is sent."""

from __future__ import annotations

import json
import secrets
from collections.abc import Iterator
from contextlib import ExitStack

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

from app.compute.cache import SharedCache
from app.compute.warm_up import compute_first_map
from app.server.door.front_door import MAP
from app.server.door.lobby import open_lobby
from app.server.door.viser_server import any_port
from tests.app.server.session.served import entered, picture, ready
from tests.app.shown_map import ShownMap
from tests.app.wire import WAIT, Wire

pytestmark = pytest.mark.filterwarnings("ignore:Queued a .* on a closed connection")

BROWSERS = 4


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    cache, port = SharedCache("bottle_on_table"), any_port()
    compute_first_map(cache)
    with open_lobby(cache, "127.0.0.1", port, BROWSERS):
        yield port


@pytest.fixture
def visitor(port) -> Iterator[Wire]:
    with Wire(port) as visitor:
        visitor.wait_for(ready)
        yield visitor


def do(visitor: Wire, **command: object) -> None:
    assert visitor.map_socket
    visitor.map_socket.send(json.dumps(command))


def test_a_turn_of_the_map_turns_the_object_and_moves_the_slider(visitor):
    before = visitor.map.picture()
    assert before is not None
    do(visitor, do="turn", delta=np.deg2rad(30.0))
    visitor.wait_for(lambda _: entered(visitor, "Rotation (°)") == [30.0] and visitor.map.look["delta"] != 0)
    assert np.array_equal(visitor.map.picture(), np.roll(before, -120, axis=1))


def test_a_turn_of_the_slider_turns_the_map(visitor):
    visitor.set("Rotation (°)", -45.0)
    visitor.wait_for(lambda _: visitor.map.look["delta"] == np.deg2rad(-45.0))


def test_a_pick_on_the_map_is_read_out(visitor):
    do(visitor, do="pick", row=5, column=20)
    visitor.wait_for(lambda _: visitor.map.look["picked"] == [5, 20])
    html = visitor.wait_for(lambda html: "holds it" in html or "cannot hold it" in html)
    assert "h = " in html


def test_of_a_flood_of_turns_the_last_one_is_shown(visitor):
    for k in range(3000):
        do(visitor, do="turn", delta=k / 1000)
    do(visitor, do="pick", row=1, column=1)
    visitor.wait_for(lambda _: visitor.map.look["picked"] == [1, 1])
    assert visitor.map.look["delta"] == 2.999


@pytest.mark.parametrize(
    "message", ["nonsense", '{"do":"quit"}', '{"do":"turn","delta":1e99}', "x" * 300, "x" * 2_000_000, b"x"]
)
def test_who_sends_nonsense_is_sent_away_and_the_view_stays(visitor, message):
    assert visitor.map_socket
    with pytest.raises(ConnectionClosed):
        visitor.map_socket.send(message)
        while True:
            visitor.map_socket.recv(WAIT)
    visitor.map_socket = visitor.open_map()
    visitor.set("Rotation (°)", 15.0)
    visitor.wait_for(lambda _: visitor.map.look["delta"] == np.deg2rad(15.0))


def test_a_connection_that_was_dropped_comes_back_with_the_map(visitor):
    do(visitor, do="turn", delta=1.0)
    visitor.wait_for(lambda _: visitor.map.look["delta"] == 1.0)
    seen = picture(visitor.html())
    assert visitor.map_socket
    visitor.map_socket.close()
    visitor.map, visitor.map_socket = ShownMap(), visitor.open_map()
    assert picture(visitor.wait_for(lambda html: bool(picture(html)))) == seen


def test_a_connection_that_is_dropped_before_the_page_has_a_session_keeps_no_other_waiting(port, monkeypatch):
    with Wire(port) as visitor:
        first, second = visitor.open_map(), visitor.open_map()
        first.close()
        monkeypatch.setattr(visitor, "open_map", lambda: second)
        visitor.wait_for(ready)


def test_two_pages_do_not_see_each_other(port, visitor):
    with Wire(port) as other:
        other.wait_for(ready)
        do(visitor, do="turn", delta=1.0)
        visitor.wait_for(lambda _: visitor.map.look["delta"] == 1.0)
        other.wait_for_quiet()
        assert other.map.look["delta"] == 0.0


def test_a_token_of_no_page_shows_nothing(port, visitor):
    stranger = visitor.open_map(secrets.token_urlsafe(24))
    try:
        with pytest.raises(TimeoutError):
            stranger.recv(0.5)
        visitor.set("Rotation (°)", 10.0)
        visitor.wait_for(lambda _: visitor.map.look["delta"] != 0)
        with pytest.raises(TimeoutError):
            stranger.recv(0.5)
    finally:
        stranger.close()


def map_of(port: int, token: str, origin: str | None = None, host: str | None = None) -> ClientConnection:
    headers = {"Host": host} if host else {}
    return connect(
        f"ws://127.0.0.1:{port}{MAP}{token}",
        origin=Origin(origin or f"http://127.0.0.1:{port}"),
        additional_headers=headers,
        compression=None,
        open_timeout=WAIT,
    )


def refused(port: int, token: str, **more: str) -> int:
    with pytest.raises(InvalidStatus) as refusal:
        map_of(port, token, **more)
    return refusal.value.response.status_code


def test_strangers_get_no_map_though_they_know_the_token(port, visitor):
    assert refused(port, visitor.token, origin="http://evil.example") == 403
    assert refused(port, visitor.token, origin="null") == 403
    assert refused(port, visitor.token, host="evil.example") == 403


@pytest.mark.parametrize("token", ["", "short", "a" * 65, "a" * 30 + "/", "a" * 30 + "%20"])
def test_what_is_no_token_is_not_found(port, token):
    assert refused(port, token) == 404


def test_many_that_wait_keep_no_others_from_their_views(port):
    with ExitStack() as stack:
        while True:
            try:
                stack.enter_context(map_of(port, secrets.token_urlsafe(24)))
            except InvalidStatus as full:
                assert full.response.status_code == 503
                break
        with Wire(port) as visitor, pytest.raises(InvalidStatus):
            visitor.wait_for("Ready.")
