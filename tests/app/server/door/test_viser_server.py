"""Nothing that is sent to a browser stays behind."""

from __future__ import annotations

import asyncio
import dataclasses
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
import viser
from viser.infra import Message
from websockets.exceptions import InvalidStatus

from app.server.door import viser_server
from app.server.door.front_door import FrontDoor
from app.server.door.viser_server import AsyncMessageBuffer, WakingBuffer, any_port, quiet_server
from tests.app.wire import Wire


def a_door(port: int = 0) -> FrontDoor:
    return FrontDoor("127.0.0.1", port or any_port(), lambda visit: True, 16)


@dataclasses.dataclass
class Numbered(Message):
    """A message unlike any other."""

    number: int

    def redundancy_key(self) -> str:
        """Return a key of its own, as a message replaces earlier ones of its key."""
        return str(self.number)


class SlyLoop(asyncio.SelectorEventLoop):
    """Lets a thread send a message at the worst instant: when the sender is about to line up and wait."""

    buffer: AsyncMessageBuffer
    sent = 0

    def create_future(self) -> asyncio.Future[object]:
        future = super().create_future()
        if hasattr(self, "buffer") and self.sent < 20:
            self.sent += 1
            thread = threading.Thread(target=self.buffer.push, args=(Numbered(self.sent),))
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


def test_every_browser_is_served_from_such_a_buffer(monkeypatch):
    pushed: list[tuple[WakingBuffer, Message]] = []

    class Watched(WakingBuffer):
        def push(self, message: Message) -> None:
            pushed.append((self, message))
            super().push(message)

    monkeypatch.setattr(viser_server, "WakingBuffer", Watched)
    server = quiet_server(a_door())
    server.scene.add_frame("/everybody")

    @server.on_client_connect
    def _(client: viser.ClientHandle) -> None:
        client.gui.add_html("hello")

    try:
        with Wire(server.get_port()) as visitor:
            visitor.wait_for("hello")
    finally:
        server.stop()
    monkeypatch.undo()
    quiet_server(a_door()).stop()  # the next one has viser make the buffers of the application again
    to_all = {id(buffer) for buffer, message in pushed if "/everybody" in str(message)}
    to_one = {id(buffer) for buffer, message in pushed if "hello" in str(message)}
    assert len(to_all) == len(to_one) == 1
    assert to_all != to_one


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
    quiet_server(a_door()).stop()
    assert outs == [sys.stdout, sys.stdout]
    assert capsys.readouterr().out == ""


def test_servers_that_are_started_at_once_each_listen_at_their_own_door():
    doors = {port: a_door(port) for port in (any_port() for _ in range(4))}
    with ThreadPoolExecutor(4) as pool:
        servers = list(pool.map(quiet_server, doors.values()))
    try:
        assert [server.get_port() for server in servers] == list(doors)
    finally:
        for server in servers:
            server.stop()


def test_without_a_door_nobody_comes_in():
    server = quiet_server()
    try:
        with pytest.raises(InvalidStatus, match="503"), Wire(server.get_port()):
            raise AssertionError
    finally:
        server.stop()
