"""What a page showed comes back when it is loaded again, or its connection was dropped."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from websockets.protocol import State as SocketState

from app.server.kept_pages.left_pages import MOST, LeftPage, LeftPages
from app.state.state import State
from symgrasp.scene.scene import Scene
from tests.app.server.session.served import Server, picture, ready, start_server
from tests.app.wire import Wire

pytestmark = pytest.mark.filterwarnings("ignore:Queued a .* on a closed connection")


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    with start_server() as server:
        yield server


def values(wire: Wire) -> dict[str, object]:
    """What the inputs show that are changed here, by their labels."""
    return {
        w["label"]: w["value"] for w in wire.widgets.values() if w.get("label") in ("Rotation (°)", "x (cm)")
    }


def put(wire: Wire, label: str, value: float) -> str:
    """Change an input that changes the map; return the picture of the map then."""
    before = picture(wire.wait_for(ready))
    wire.set(label, value)
    return picture(wire.wait_for(lambda html: picture(html) != before and ready(html)))


def change(wire: Wire) -> str:
    put(wire, "x (cm)", 57.0)
    return put(wire, "Rotation (°)", 40.0)


def expect(wire: Wire, rotation: float, x: float, shown: str = "") -> None:
    wire.wait_for(
        lambda html: (
            ready(html)
            and values(wire) == {"Rotation (°)": rotation, "x (cm)": x}
            and shown in ("", picture(html))
        )
    )


def test_a_page_that_is_loaded_again_shows_what_it_showed(server):
    with server.visit() as first:
        shown = change(first)
    server.wait_until_empty()
    with Wire(server.port, before=first.token) as again:
        expect(again, 40.0, 57.0, shown)
        again.trigger("Undo")
        expect(again, 0.0, 57.0)
        again.trigger("Undo")
        expect(again, 0.0, 55.0)


def test_a_page_whose_connection_is_dropped_goes_on_even_before_that_is_noticed(server):
    with server.visit("scene=bottle_on_table") as first:
        shown = change(first)
        with Wire(server.port, first.query, token=first.token) as same:
            expect(same, 40.0, 57.0, shown)
        assert first.socket.state is SocketState.OPEN  # a machine that went to sleep closes nothing


def test_two_tabs_of_one_page_do_not_overwrite_one_another(server):
    with server.visit() as first:
        shown = change(first)
        with Wire(server.port, before=first.token) as copy:  # as a duplicated tab
            expect(copy, 40.0, 57.0, shown)
            put(copy, "Rotation (°)", -30.0)
        put(first, "x (cm)", 52.0)
    server.wait_until_empty()
    with Wire(server.port, before=copy.token) as again:
        expect(again, -30.0, 57.0)
    with Wire(server.port, before=first.token) as again:
        expect(again, 40.0, 52.0)


def test_an_unknown_page_begins_anew(server):
    with Wire(server.port, before="u" * 32) as fresh:
        expect(fresh, 0.0, 55.0)


def test_the_latest_pages_are_kept():
    scene = Scene.load("bottle_on_table")
    pages, left = LeftPages(), LeftPage(State.of(scene, "bottle_on_table"))
    for k in range(MOST):
        pages.keep(f"page {k}", left)
    later = LeftPage(left.state)
    pages.keep("page 0", later)
    pages.keep("another", left)
    assert pages.find("page 0") is later
    assert pages.find("page 1") is None
    assert pages.find("another") is left
