"""The map on the page of one session: sends it to the browser, and does what is done with it there."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field

from websockets.exceptions import ConnectionClosed
from websockets.frames import CloseCode

from ...shell import commands
from ...shell.map_parts import map_parts
from ...state.state import State
from ..door.browser_connection import BrowserConnection

__all__ = ["MapPane"]

Change = Callable[[State], State]


@dataclass(eq=False)
class _Link:
    """A connection, and the newest messages that it has not been sent yet, by their kind."""

    connection: BrowserConnection
    unsent: dict[str, bytes] = field(default_factory=dict)
    some: asyncio.Event = field(default_factory=asyncio.Event)

    def put(self, parts: dict[str, bytes]) -> None:
        """Add messages, on the event loop; those of their kinds that were not sent are dropped."""
        self.unsent |= parts
        self.unsent["look"] = self.unsent.pop("look")  # it comes last
        self.some.set()

    async def send(self) -> None:
        """Send what is put, as fast as the browser takes it, until the connection is closed."""
        with suppress(ConnectionClosed):
            while True:
                await self.some.wait()
                self.some.clear()
                parts, self.unsent = self.unsent, {}
                for part in parts.values():
                    await self.connection.send(part)


class MapPane:
    """Shows the newest state on the connection of the page, whenever there is one.

    Args:
        change: applies a change to the state of the session, see `SessionApi`.
        act: does what a `commands.Act` of that name asks for.
    """

    def __init__(self, change: Callable[[Change, str], None], act: Callable[[str], None]) -> None:
        self._change, self._act = change, act
        self._lock = threading.Lock()
        self._parts: dict[str, bytes] = {}
        self._link: _Link | None = None
        self._closed = False

    def show(self, state: State) -> None:
        """Send what is different in a state; called by one thread."""
        parts = map_parts(state)
        with self._lock:
            changed = {kind: part for kind, part in parts.items() if part != self._parts.get(kind)}
            self._parts = parts
            if self._link and changed:
                changed["look"] = parts["look"]
                self._link.connection.loop.call_soon_threadsafe(self._link.put, changed)

    async def serve(self, connection: BrowserConnection) -> None:
        """Show the map on a connection until it is closed; an earlier one is closed."""
        link = _Link(connection)
        with self._lock:
            closed, earlier, self._link = self._closed, self._link, link
            if self._parts:
                link.put(self._parts)
        if closed:
            return
        if earlier:
            await earlier.connection.close(CloseCode.GOING_AWAY)
        sending = asyncio.create_task(link.send())
        try:
            with suppress(ConnectionClosed):
                while True:
                    command = commands.decode(await connection.recv())
                    if isinstance(command, commands.Act):
                        self._act(command.name)
                    else:
                        self._change(command.applied, command.origin)
        finally:
            sending.cancel()
            with self._lock:
                ended = self._link is link
                if ended:
                    self._link = None
            if ended:  # nobody will tell of the release any more
                self._change(commands.Release().applied, "")

    def close(self) -> None:
        """Close the connection: the page then opens another."""
        with self._lock:
            link, self._link, self._closed = self._link, None, True
        if link:
            connection = link.connection
            with suppress(RuntimeError):  # the event loop has ended
                asyncio.run_coroutine_threadsafe(connection.close(CloseCode.GOING_AWAY), connection.loop)
