"""The viser server behind the proxy, without console output and with a fix of its message buffer."""

from __future__ import annotations

import asyncio
import dataclasses
import socket

import rich
import viser
from viser.infra import _infra
from viser.infra._async_message_buffer import AsyncMessageBuffer

__all__ = ["AsyncMessageBuffer", "WakingBuffer", "any_port", "quiet_server"]


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


def quiet_server() -> viser.ViserServer:
    """Start a viser server on a loopback address that prints nothing."""
    # viser has no public way to replace its buffer.
    _infra.AsyncMessageBuffer = WakingBuffer  # pyright: ignore[reportPrivateImportUsage]
    rich.get_console().quiet = True  # only viser prints to this console
    server = viser.ViserServer(host="127.0.0.1", port=any_port(), verbose=False)
    server.scene.world_axes.visible = False
    return server
