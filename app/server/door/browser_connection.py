"""A connection from a browser that came in at the front door: read no faster than a person acts."""

from __future__ import annotations

import asyncio
import contextvars
import logging
from collections.abc import Callable
from typing import Any

from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed
from websockets.frames import CloseCode
from websockets.typing import Data

from ...shell import commands
from .browser_messages import MESSAGES, BrowserMessage, Misuse, UploadButton, Uploads
from .inbox import Inbox, TokenBucket

__all__ = ["PART_LIMIT", "BrowserConnection", "current_connection", "handled_by"]

log = logging.getLogger(__name__)

HEAD_TIMEOUT = 10.0
"""Time (s) within which the head of a request must arrive."""

HELLO_TIMEOUT = 60.0
"""Time (s) within which a websocket's page must load its picture."""

MAX_REQUESTS = 256
"""How many connections may be about to be answered; further ones are closed at once."""

PART_LIMIT = 1 << 20
"""Largest message (bytes) with a part of a file; browsers send half of it."""

MESSAGE_LIMIT = 1 << 16
"""Largest other message (bytes)."""

READ_RATE, READ_BURST = 1000.0, 1000.0
"""How many messages per second are read from one browser, and how many at once."""

MESSAGE_BYTES = 1 << 14
"""How many bytes of a message count as another message."""

HANDLE_RATE, HANDLE_BURST = 60.0, 240.0
"""How many of the values among them are handled per second, and at once; nobody drags faster."""

EVENT_TOKENS = 3.0
"""How many values an event, such as a click, counts as: what it starts takes longer."""

MAX_WAITING = 256
"""How many messages of one browser may wait to be handled; meanwhile no more are read."""


class BrowserConnection(ServerConnection):
    """A connection from a browser: one request, and what it sends afterwards if that opens a websocket.

    Attributes:
        upload_buttons: uuid → the button of its page that takes files.
    """

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.upload_buttons: dict[str, UploadButton] = {}
        self._uploads = Uploads(self.upload_buttons)
        self._inbox: Inbox[tuple[Data, float]] = Inbox()
        self._reading = TokenBucket(READ_RATE, READ_BURST)
        self._handling = TokenBucket(HANDLE_RATE, HANDLE_BURST)
        self._arrived, self._taken = asyncio.Event(), asyncio.Event()
        self._decode: Callable[[Data], BrowserMessage | commands.Command | None] = self._of_viser
        self._reader: asyncio.Task[None] | None = None
        self._timer: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Wait for the request, for `HEAD_TIMEOUT` at most; the oldest goes if there are `MAX_REQUESTS`."""
        super().connection_made(transport)
        self._close_after(HEAD_TIMEOUT)
        waiting = [connection for connection in self.server.handlers if connection.request is None]
        if len(waiting) > MAX_REQUESTS:
            waiting[0].transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        """End the reading."""
        super().connection_lost(exc)
        self.stay()
        if self._reader:
            self._reader.cancel()

    def request_received(self) -> None:
        """Wait no longer for the request, but for a websocket's greeting, for `HELLO_TIMEOUT` at most."""
        self.stay()
        self._close_after(HELLO_TIMEOUT)

    def stay(self) -> None:
        """Keep the connection open from now on: the page of this websocket has loaded its picture."""
        if self._timer:
            self._timer.cancel()

    def expect_commands(self) -> None:
        """Let no messages of viser's through, but those about the map."""
        self._decode = _command

    def _close_after(self, timeout: float) -> None:
        self._timer = self.loop.call_later(timeout, self.transport.abort)

    async def recv(self, decode: bool | None = None) -> Any:
        """Return the next message to be handled, as soon as it is this browser's turn.

        Raises:
            ConnectionClosed: the connection is closed.
        """
        if self._reader is None:
            self._reader = self.loop.create_task(self._read())
            self._reader.add_done_callback(lambda _: self._arrived.set())
        await asyncio.sleep(self._handling.take())  # meanwhile newer values replace older ones
        while not self._inbox:
            if self._reader.done():
                raise self.protocol.close_exc
            self._arrived.clear()
            await self._arrived.wait()
        message, tokens = self._inbox.take()
        self._taken.set()
        self._handling.take(tokens - 1.0)
        return message

    async def _read(self) -> None:
        """Read until the connection is closed: no faster than allowed, and only while there is room."""
        try:
            while True:
                data = await super().recv()
                await asyncio.sleep(self._reading.take(1.0 + len(data) / MESSAGE_BYTES))
                message = self._decode(data)
                if message is None:
                    continue
                while len(self._inbox) >= MAX_WAITING:
                    self._taken.clear()
                    await self._taken.wait()
                key = message.key
                self._inbox.put((data, 1.0 if key else EVENT_TOKENS), key)
                self._arrived.set()
        except ConnectionClosed:
            return
        except Misuse as misuse:
            log.info("a browser is sent away: %s", misuse)
            await self.close(CloseCode.POLICY_VIOLATION, "not a message of this page")

    def _of_viser(self, data: Data) -> BrowserMessage | None:
        """Decode a message for viser; None if it is not to reach it."""
        message = BrowserMessage.decode(data)
        if len(data) > MESSAGE_LIMIT and message.type != "FileTransferPart":
            raise Misuse("a message that is too long")
        if message.type not in MESSAGES:
            return None
        if message.type.startswith("FileTransfer") and not self._uploads.accepts(message):
            return None
        return message


def _command(data: Data) -> commands.Command:
    """Decode a message about the map."""
    try:
        return commands.decode(data)
    except ValueError as error:
        raise Misuse(str(error)) from error


_connection: contextvars.ContextVar[BrowserConnection] = contextvars.ContextVar("connection")


def current_connection() -> BrowserConnection:
    """Return the connection whose message is being handled, on viser's event loop."""
    return _connection.get()


def handled_by(connection: BrowserConnection) -> None:
    """Make a connection the current one of the running task."""
    _connection.set(connection)
