"""Nothing that is sent to a browser stays behind."""

from __future__ import annotations

import asyncio
import sys
import threading
from typing import Any

import viser
from viser._messages import GuiUpdateMessage
from viser.infra import Message
from viser.infra._async_message_buffer import AsyncMessageBuffer

from app.server.viser_server import WakingBuffer, quiet_server
from tests.app.wire import Wire


class SlyLoop(asyncio.SelectorEventLoop):
    """Lets a thread send a message at the worst instant: when the sender is about to line up and wait."""

    buffer: AsyncMessageBuffer
    sent = 0

    def create_future(self) -> asyncio.Future[object]:
        future = super().create_future()
        if hasattr(self, "buffer") and self.sent < 20:
            self.sent += 1
            message = GuiUpdateMessage(f"{self.sent}", {"value": self.sent})
            thread = threading.Thread(target=self.buffer.push, args=(message,))
            thread.start()
            thread.join()
        return future


def received(kind: type[AsyncMessageBuffer], patience: float) -> list[Message]:
    """What the sender of such a buffer sends of twenty messages within so many seconds."""
    loop = SlyLoop()
    got: list[Message] = []

    async def send() -> None:
        buffer = kind(loop, persistent_messages=False, window_duration_sec=0.0)
        windows = buffer.window_generator(0)
        loop.buffer = buffer
        try:
            async with asyncio.timeout(patience):
                while len(got) < 20:
                    got.extend(await anext(windows))
        except TimeoutError:
            pass
        finally:
            await windows.aclose()

    loop.run_until_complete(send())
    loop.close()
    return got


def test_a_message_from_another_thread_at_the_worst_instant_is_sent():
    assert len(received(WakingBuffer, 60.0)) == 20


def test_visers_own_buffer_still_needs_the_remedy():
    """When this fails, viser has mended it: `WakingBuffer` can go."""
    assert len(received(AsyncMessageBuffer, 1.0)) < 20


def test_every_browser_is_served_from_such_a_buffer():
    server = quiet_server()
    buffers: list[object] = [server._websock_server._broadcast_buffer]

    @server.on_client_connect
    def _(client: viser.ClientHandle) -> None:
        buffers.append(client._websock_connection._state.message_buffer)
        client.gui.add_html("hello")

    try:
        with Wire(server.get_port()) as visitor:
            visitor.wait_for("hello")
    finally:
        server.stop()
    assert [type(b) for b in buffers] == [WakingBuffer, WakingBuffer]


def test_servers_start_and_stop_without_a_word_and_leave_standard_output_to_others(monkeypatch, capsys):
    """Several threads may start one at once, so none may put another stream in its place meanwhile."""
    outs: list[object] = []

    class Watched(viser.ViserServer):
        def __init__(self, *args: Any, **options: Any) -> None:
            outs.append(sys.stdout)
            super().__init__(*args, **options)

        def stop(self) -> None:
            outs.append(sys.stdout)
            super().stop()

    monkeypatch.setattr(viser, "ViserServer", Watched)
    quiet_server().stop()
    assert outs == [sys.stdout, sys.stdout]
    assert capsys.readouterr().out == ""
