"""The front door: decides who comes in, and keeps one browser from harming another.

viser accepts whatever a web page anywhere sends, as fast as it comes. It listens through `websockets`, whose
hooks are used here: every connection is one HTTP request, which is checked, and answered by viser if it
passes; those that become websockets are read at a limited rate. The door refuses

* requests from a page of another origin (the ``Origin`` header names another host),
* on a loopback address, requests for another host's name (DNS rebinding),
* to be shown inside another page,
* more browsers at once than were allowed, and connections that do not say in time what they want.

The page that is served is the project's own; it shows viser's in a frame, whose address has the setting
`VIEW`: a token that the page has made up. A websocket alone serves an empty view: a browser gets a session
after the view has loaded a picture with a secret token in its path, from a page of the same origin. The
``Referer`` of that request is the address that was opened. The page's own websocket, for the map, has its token
in its path.
"""

from __future__ import annotations

import asyncio
import contextvars
import ipaddress
import logging
import re
import socket
import sys
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from http import HTTPStatus
from typing import Any
from urllib.parse import urlsplit, urlunsplit

from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.frames import CloseCode
from websockets.http11 import Request, Response
from websockets.typing import Data

from ..shell import commands
from ..shell.files import PageFile, page_file
from .browser_messages import MESSAGES, BrowserMessage, Misuse, UploadButton, Uploads
from .inbox import Inbox, TokenBucket

__all__ = ["HELLO", "MAP", "BrowserConnection", "FrontDoor", "Visit", "current_connection", "is_foreign"]

log = logging.getLogger(__name__)

HELLO = "/hello/"
"""Path of the picture, followed by its secret token."""

FILES = "/shell/"
"""Path of the files of the page, followed by a name."""

MAP = "/map/"
"""Path of the websocket of the map, followed by the token of the page."""

VIEW = "view"
"""The setting in the address of viser's page that has the token of the page around it."""

TOKEN = re.compile(r"[\w-]{22,64}", re.ASCII)
"""A token that the page has made up: of 128 random bits at least."""

HEAD_TIMEOUT = 10.0
"""Time (s) within which the head of a request must arrive."""

ANSWER_TIMEOUT = 60.0
"""Time (s) within which it must have been answered; the page is about a megabyte."""

HELLO_TIMEOUT = 60.0
"""Time (s) within which a websocket's page must load its picture."""

GONE_TIMEOUT = 60.0
"""Time (s) after which a browser is gone whose machine does not acknowledge what it is sent."""

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

PICTURE = '<svg xmlns="http://www.w3.org/2000/svg" width="1" height="1"/>'

# The page loads its own files alone.
PAGE_POLICY = "; ".join(
    [
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self'",
        "img-src 'self' data:",
        "connect-src ws://{host} wss://{host}",
        "frame-src 'self'",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
    ]
)

# viser's page is one file, whose inline script unpacks styles, fonts, code, workers and WebAssembly.
VIEW_POLICY = "; ".join(
    [
        "default-src 'none'",
        "script-src 'unsafe-inline' 'wasm-unsafe-eval'",
        "worker-src blob: data:",
        "style-src 'unsafe-inline'",
        "font-src data:",
        "img-src 'self' data: blob:",
        "connect-src ws://{host} wss://{host} data: blob:",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'self'",
    ]
)

HOST = re.compile(r"[\w.:\[\]-]+", re.ASCII)
"""A value of the ``Host`` header."""

FRAMES = ("embed", "fencedframe", "frame", "iframe", "object")
"""Values of ``Sec-Fetch-Dest`` of a page that is shown inside another."""


@dataclass(frozen=True)
class Visit:
    """A browser that loaded its picture.

    Attributes:
        token: the secret token in the path of the picture.
        query: what stood behind the ``?`` of the address it opened.
        address: the address without that.
        page: the token of the page around the view; empty where there is none.
    """

    token: str
    query: str = ""
    address: str = "/"
    page: str = ""


def is_foreign(headers: Mapping[str, str], *, loopback: bool) -> bool:
    """Return whether a request comes from a page of another origin, or names another host.

    Args:
        headers: of the request, names in lower case.
        loopback: whether the server listens on a loopback address only.
    """
    host = headers.get("host", "")
    if not HOST.fullmatch(host):
        return True
    if loopback and not _is_loopback(urlsplit(f"//{host}").hostname or ""):
        return True
    origin = headers.get("origin")
    return origin is not None and urlsplit(origin).netloc != host


def _is_own_picture(headers: Mapping[str, str]) -> bool:
    """Return whether a page of the same origin loads the picture, by one of two headers of browsers."""
    if headers.get("sec-fetch-dest", "image") != "image":
        return False
    if "sec-fetch-site" in headers:
        return headers["sec-fetch-site"] == "same-origin"
    return urlsplit(headers.get("referer", "")).netloc == headers.get("host")


def _is_own_frame(headers: Mapping[str, str]) -> bool:
    """Return whether a page of the same origin shows it in a frame."""
    return headers["sec-fetch-dest"] == "iframe" and headers.get("sec-fetch-site") == "same-origin"


def _is_loopback(name: str) -> bool:
    if name == "localhost":
        return True
    try:
        return ipaddress.ip_address(name).is_loopback
    except ValueError:
        return False


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


class FrontDoor:
    """The public address, and who may come in there.

    Args:
        host, port: the address to listen on.
        on_visit: called when a browser loads its picture; returns whether its token is valid.
        max_browsers: how many browsers may be in at the same time.
        on_map: called with the websocket of a page's map and the token of the page; handles it.

    Raises:
        OSError: the address cannot be listened on.
    """

    def __init__(
        self,
        host: str,
        port: int,
        on_visit: Callable[[Visit], bool],
        max_browsers: int,
        on_map: Callable[[BrowserConnection, str], Awaitable[None]] | None = None,
    ) -> None:
        self._on_visit, self._max_browsers, self._on_map = on_visit, max_browsers, on_map
        self._loopback = _is_loopback(host)
        family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        self._socket = socket.create_server(address[:2], family=family)
        if sys.platform == "linux":
            # The machine acknowledges for a browser that is slowed down, whose answers to pings come late.
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, int(1000 * GONE_TIMEOUT))
        self._browsers: set[BrowserConnection] = set()
        self._maps: set[BrowserConnection] = set()

    def serve(
        self,
        handler: Callable[[ServerConnection], Awaitable[None]],
        process_request: Callable[[ServerConnection, Request], Response | None],
        **options: Any,
    ) -> serve:
        """Return a server at this door, to be used like `websockets.asyncio.server.serve`.

        Args:
            handler: handles the websockets that are let in.
            process_request: answers the requests that are let in.
            options: further ones of that function; where it listens and how fast is decided here.
        """

        async def handle(connection: ServerConnection) -> None:
            assert isinstance(connection, BrowserConnection)
            assert connection.request
            path, _ = _split(connection.request)
            if path.startswith(MAP):
                await self._show_map(connection, path.removeprefix(MAP))
                return
            _connection.set(connection)
            self._browsers.add(connection)
            try:
                await handler(connection)
            finally:
                self._browsers.discard(connection)

        def answer(connection: ServerConnection, request: Request) -> Response | None:
            assert isinstance(connection, BrowserConnection)
            connection.request_received()
            return self._answer(connection, request) or process_request(connection, request)

        options |= {"max_size": PART_LIMIT, "open_timeout": ANSWER_TIMEOUT, "ping_timeout": None}
        return serve(
            handle,
            sock=self._socket,
            process_request=answer,
            process_response=_with_headers,
            server_header=None,
            logger=_quiet_logger(),
            create_connection=BrowserConnection,
            **options,
        )

    async def _show_map(self, connection: BrowserConnection, token: str) -> None:
        assert self._on_map
        self._maps.add(connection)
        try:
            connection.expect_commands()
            await self._on_map(connection, token)
        finally:
            self._maps.discard(connection)

    def _answer(self, connection: BrowserConnection, request: Request) -> Response | None:
        """Return the answer to a request that is not for viser; None for one that is, and for websockets."""
        headers = _headers(request)
        path, settings = _split(request)
        if is_foreign(headers, loopback=self._loopback):
            return connection.respond(HTTPStatus.FORBIDDEN, "It may only be opened by its own address.\n")
        is_view = path == "/" and VIEW in settings
        if headers.get("sec-fetch-dest") in FRAMES and not (is_view and _is_own_frame(headers)):
            return connection.respond(HTTPStatus.FORBIDDEN, "It may not be shown inside another page.\n")
        if path.startswith(FILES):
            return _found(connection, page_file(path.removeprefix(FILES)))
        if path.startswith(HELLO):
            return self._picture(connection, path.removeprefix(HELLO), headers)
        if path.startswith(MAP):
            return self._map_refusal(connection, path.removeprefix(MAP))
        if len(self._browsers) >= self._max_browsers:
            return connection.respond(
                HTTPStatus.SERVICE_UNAVAILABLE,
                f"This server is in use by {self._max_browsers} browsers, which is all it takes at a time "
                "(symgrasp app --max-sessions). Close one of them, or load this page again later.\n",
            )
        if path == "/" and not is_view and "upgrade" not in headers:
            return _found(connection, page_file("index.html"))
        return None

    def _map_refusal(self, connection: BrowserConnection, token: str) -> Response | None:
        """Return why a page gets no websocket for its map; None if it does."""
        if self._on_map is None or not TOKEN.fullmatch(token):
            return connection.respond(HTTPStatus.NOT_FOUND, "")
        if len(self._maps) >= 2 * self._max_browsers:  # some may not have noticed that their page has gone
            return connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, "")
        return None

    def _picture(self, connection: BrowserConnection, token: str, headers: Mapping[str, str]) -> Response:
        opened = urlsplit(headers.get("referer", "/"))
        address = urlunsplit((opened.scheme, opened.netloc, opened.path, "", ""))
        settings = opened.query.split("&")
        query = "&".join(s for s in settings if s.partition("=")[0] != VIEW)
        page = next((s.partition("=")[2] for s in settings if s.startswith(f"{VIEW}=")), "")
        visit = Visit(token, query, address, page if TOKEN.fullmatch(page) else "")
        if not _is_own_picture(headers) or not self._on_visit(visit):
            return connection.respond(HTTPStatus.NOT_FOUND, "")
        return _found(connection, PageFile(PICTURE, "image/svg+xml"))


def _found(connection: BrowserConnection, file: PageFile | None) -> Response:
    """Return the answer with a file of the page."""
    if file is None:
        return connection.respond(HTTPStatus.NOT_FOUND, "")
    response = connection.respond(HTTPStatus.OK, file.text)
    response.headers["Cache-Control"] = "no-store"
    del response.headers["Content-Type"]
    response.headers["Content-Type"] = file.media_type
    return response


def _split(request: Request) -> tuple[str, frozenset[str]]:
    """Return the path of a request, and the names of the settings behind it."""
    path, _, query = request.path.partition("?")
    return path, frozenset(setting.partition("=")[0] for setting in query.split("&"))


def _headers(request: Request) -> dict[str, str]:
    """Return the headers of a request, names in lower case; repeated ones become one that no page sends."""
    headers: dict[str, str] = {}
    for name, value in request.headers.raw_items():
        name = name.lower()
        headers[name] = f"{headers[name]}, {value}" if name in headers else value
    return headers


def _with_headers(_: ServerConnection, request: Request, response: Response) -> None:
    """Add to a response what keeps other pages from using it."""
    host = _headers(request).get("host", "")
    path, settings = _split(request)
    is_view = path == "/" and VIEW in settings
    policy = VIEW_POLICY if is_view else PAGE_POLICY
    response.headers["Content-Security-Policy"] = policy.format(
        host=host if HOST.fullmatch(host) else "invalid"
    )
    response.headers["X-Frame-Options"] = "SAMEORIGIN" if is_view else "DENY"
    response.headers["X-Content-Type-Options"] = "nosniff"
    response.headers["Referrer-Policy"] = "same-origin"


def _quiet_logger() -> logging.Logger:
    """Return a logger that does not report every visitor who speaks no HTTP."""
    logger = logging.getLogger(f"{__name__}.websockets")
    logger.addFilter(_is_about_more_than_a_handshake)
    return logger


def _is_about_more_than_a_handshake(record: logging.LogRecord) -> bool:
    return record.getMessage() != "opening handshake failed"
