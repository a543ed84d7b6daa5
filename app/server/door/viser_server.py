"""The viser server behind the front door, without console output and with a fix of its message buffer."""

from __future__ import annotations

import asyncio
import dataclasses
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import rich
import viser
from viser import _messages
from viser.infra import _infra
from viser.infra._async_message_buffer import AsyncMessageBuffer
from websockets.asyncio import server as websockets_server

from .front_door import FrontDoor

__all__ = ["AsyncMessageBuffer", "WakingBuffer", "any_port", "end_upload", "quiet_server"]


class _LoopEvent(asyncio.Event):
    """An event that can only be set on its own event loop."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        super().__init__()
        self._loop_of_event = loop

    def set(self) -> None:
        """Set the event if this is the loop's thread, else do nothing."""
        try:
            here = asyncio.get_running_loop()
        except RuntimeError:
            return
        if here is self._loop_of_event:
            super().set()


@dataclasses.dataclass
class WakingBuffer(AsyncMessageBuffer):
    """viser's buffer of messages to a browser, whose sender always wakes up.

    `AsyncMessageBuffer.push` sets the sender's event twice: at once from the calling thread, and again
    through the event loop. An asyncio event is not thread-safe: if the first call comes between the
    sender's check of the event and its registration as a waiter, the second call sees the event set and
    wakes no waiter, so that the browser gets no more messages. Here the first call does nothing.
    """

    def __post_init__(self) -> None:
        self.message_event = _LoopEvent(self.event_loop)


def any_port() -> int:
    """Return a TCP port that is free on this machine at the moment."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def quiet_server(door: FrontDoor | None = None) -> viser.ViserServer:
    """Start a viser server behind a front door, by default one that nobody passes; it prints nothing."""
    # viser has no public way to replace its buffer.
    _infra.AsyncMessageBuffer = WakingBuffer  # pyright: ignore[reportPrivateImportUsage]
    rich.get_console().quiet = True  # only viser prints to this console
    with _listening_at(door or FrontDoor("127.0.0.1", 0, lambda visit: False, max_browsers=0)):
        server = viser.ViserServer(verbose=False)
    server.scene.world_axes.visible = False
    return server


_listening = threading.Lock()


@contextmanager
def _listening_at(door: FrontDoor) -> Iterator[None]:
    """Have viser, which has no public way to be told, listen at a door while it is constructed."""

    def serve_at_door(handler: Any, host: str, port: int, **options: Any) -> websockets_server.serve:
        return door.serve(handler, **options)

    with _listening:
        listen = websockets_server.serve
        setattr(websockets_server, "serve", serve_at_door)  # noqa: B010
        try:
            yield
        finally:
            setattr(websockets_server, "serve", listen)  # noqa: B010


def end_upload(client: viser.ClientHandle, button: str, transfer: str) -> None:
    """Have a browser forget a file that is not received: end its progress bar, and free the button.

    Args:
        client: the browser.
        button: uuid of the button.
        transfer: uuid of the transfer.
    """
    # viser's client takes an upload for running until as many bytes are received as it has.
    ended = _messages.FileTransferPartAck(button, transfer, transferred_bytes=1, total_bytes=1)
    client.gui._websock_interface.queue_message(ended)
