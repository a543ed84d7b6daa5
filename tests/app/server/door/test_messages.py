"""What of what a browser sends reaches viser."""

from __future__ import annotations

from collections.abc import Iterator

import msgspec
import pytest
import viser
from websockets.exceptions import ConnectionClosed

from tests.app.server.door.sockets import WAIT, own
from tests.app.wire import CAMERA, Wire


def pack(**message: object) -> bytes:
    return msgspec.msgpack.encode(message)


@pytest.fixture
def arrived(server) -> list[str]:
    """Labels of the buttons that were pressed and of the sliders that were moved, in that order."""
    arrived: list[str] = []

    @server.on_client_connect
    async def _(client: viser.ClientHandle) -> None:
        slider, button = client.gui.add_slider("slider", 0, 100_000, 1, 0), client.gui.add_button("button")

        @slider.on_update
        async def _(_: object) -> None:
            arrived.append(f"slider {slider.value}")

        @button.on_click
        async def _(_: object) -> None:
            arrived.append("button")
            client.gui.add_html(f"pressed {arrived.count('button')} times")

    return arrived


class Presser(Wire):
    """A browser that presses the button after what else it sends, and waits until that has arrived."""

    def press_after(self, *messages: bytes, presses: int = 1) -> None:
        for message in messages:
            self.socket.send(message)
        self.set("button", True)
        self.wait_for(f"pressed {presses} times")


@pytest.fixture
def presser(port, arrived) -> Iterator[Presser]:
    with Presser(port) as presser:
        yield presser


def test_messages_that_no_widget_sends_do_not_reach_viser(server, presser, arrived, monkeypatch):
    tunnels: list[object] = []
    monkeypatch.setattr(viser.ViserServer, "request_share_url", lambda server: tunnels.append(server))
    presser.uuid("button")
    before = server._websock_server._broadcast_buffer.message_counter
    presser.press_after(
        pack(type="ShareUrlRequest"),
        *(pack(type="GuiFormDirtyMessage", uuid=str(k)) for k in range(100)),
        pack(type="NoMessage"),
    )
    assert tunnels == []
    assert server._websock_server._broadcast_buffer.message_counter == before
    assert arrived == ["button"]


def test_of_a_flood_of_values_the_newest_arrives_and_no_press_is_lost(presser, arrived):
    slider, button = presser.uuid("slider"), presser.uuid("button")
    values = [pack(type="GuiUpdateMessage", uuid=slider, updates={"value": k}) for k in range(1, 5001)]
    press = pack(type="GuiUpdateMessage", uuid=button, updates={"value": True})
    presser.press_after(*values[:4000], *[press] * 20, *values[4000:], presses=21)
    print(f"5000 values and 21 presses were sent at once, {len(arrived)} arrived")
    assert arrived[-2:] == ["slider 5000", "button"]
    assert arrived[arrived.index("button") - 1] == "slider 4000"
    assert arrived.count("button") == 21
    assert len(arrived) < 1000


@pytest.mark.parametrize("data", [b"\xc1", pack(no="type"), pack(type="x" * 100_000), b"x" * 2_000_000])
def test_who_sends_nonsense_is_sent_away_alone(port, data):
    with own(port) as other, own(port) as browser:
        browser.send(pack(**CAMERA))
        with pytest.raises(ConnectionClosed):
            browser.send(data)
            while True:
                browser.recv(WAIT)
        assert other.recv(WAIT)
