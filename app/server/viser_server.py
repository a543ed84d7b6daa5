"""The viser server that the front door stands before, quiet and sure to send what it is given."""

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
    """An event that only its own loop sets."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        super().__init__()
        self._home = loop

    def set(self) -> None:
        """Set it, if this is the loop's thread; elsewhere do nothing."""
        try:
            here = asyncio.get_running_loop()
        except RuntimeError:
            return
        if here is self._home:
            super().set()


@dataclasses.dataclass
class WakingBuffer(AsyncMessageBuffer):
    """viser's buffer of messages to a browser, whose sender always wakes up.

    `AsyncMessageBuffer.push` sets the sender's event twice: at once from the calling thread, and once more
    through the loop. An asyncio event is not made for the first. Where it falls between the moment in
    which the sender finds the event unset and the moment in which it lines up to wait, the second finds
    the event set already and wakes nobody: the browser gets no message any more. Here the first does
    nothing.
    """

    def __post_init__(self) -> None:
        self.message_event = _LoopEvent(self.event_loop)


def any_port() -> int:
    """Return a port of this machine that is free now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def quiet_server() -> viser.ViserServer:
    """Start a viser server that only this machine reaches, without its banner and farewell."""
    # viser offers no place to hand it in.
    _infra.AsyncMessageBuffer = WakingBuffer  # pyright: ignore[reportPrivateImportUsage]
    rich.get_console().quiet = True  # what viser prints its banner and farewell on, and nobody else here
    server = viser.ViserServer(host="127.0.0.1", port=any_port(), verbose=False)
    server.scene.world_axes.visible = False
    return server
