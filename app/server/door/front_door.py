"""The front door: decides who comes in, and keeps one browser from harming another.

viser accepts whatever a web page anywhere sends, as fast as it comes. It listens through `websockets`, whose
hooks are used here: every connection is one HTTP request, which is checked, and answered by viser if it
passes; those that become websockets are read at a limited rate. The door refuses

* requests from a page of another origin (the ``Origin`` header names another host),
* on a loopback address, requests for another host's name (DNS rebinding),
* to be shown inside another page, but for one that knows the key of a server in a notebook,
* more browsers at once than were allowed, and connections that do not say in time what they want.

The page that is served is the project's own; it shows viser's in a frame, whose address has the setting
`PAGE`: a token that the page has made up, and behind a dot that of the page which it continues, if any. The
setting `STACKED` says that the page is laid out for a narrow window. A websocket alone serves an empty view:
a browser gets a session after the view has loaded a picture with a secret token in its path, from a page of
the same origin. The ``Referer`` of that request is the address that was opened. The page's own websocket, for
the map, has its token in its path.
"""

from __future__ import annotations

import logging
import re
import socket
import sys
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from functools import partial
from http import HTTPStatus
from typing import Any
from urllib.parse import urlsplit, urlunsplit

from websockets.asyncio.server import ServerConnection, serve
from websockets.http11 import Request, Response

from ...shell.files import PageFile, page_file
from .browser_connection import PART_LIMIT, BrowserConnection, handled_by
from .origins import (
    EMBEDDED,
    FRAMES,
    PAGE,
    STACKED,
    add_headers,
    headers_of,
    is_embedded,
    is_foreign,
    is_loopback,
    is_own_frame,
    is_own_picture,
    is_same,
    is_view,
)

__all__ = ["HELLO", "MAP", "FrontDoor", "Visit"]

HELLO = "/hello/"
"""Path of the picture, followed by its secret token."""

FILES = "/shell/"
"""Path of the files of the page, followed by a name."""

MAP = "/map/"
"""Path of the websocket of the map, followed by the token of the page."""

TOKEN = re.compile(r"[\w-]{22,64}", re.ASCII)
"""A token that the page has made up: of 128 random bits at least."""

ANSWER_TIMEOUT = 60.0
"""Time (s) within which it must have been answered; the page is about a megabyte."""

GONE_TIMEOUT = 60.0
"""Time (s) after which a browser is gone whose machine does not acknowledge what it is sent."""

PICTURE = '<svg xmlns="http://www.w3.org/2000/svg" width="1" height="1"/>'


@dataclass(frozen=True)
class Visit:
    """A browser that loaded its picture.

    Attributes:
        token: the secret token in the path of the picture.
        query: what stood behind the ``?`` of the address it opened.
        address: the address without that.
        page: the token of the page around the view; empty where there is none.
        before: that of the page whose session it continues, such as itself before it was loaded again.
        stacked: whether map, view and panels lie one below the other there.
    """

    token: str
    query: str = ""
    address: str = "/"
    page: str = ""
    before: str = ""
    stacked: bool = False


class FrontDoor:
    """The public address, and who may come in there.

    Args:
        host, port: the address to listen on.
        on_visit: called when a browser loads its picture; returns whether its token is valid.
        max_browsers: how many browsers may be in at the same time.
        on_map: called with the websocket of a page's map and the token of the page; handles it.
        key: the secret with which other pages may show this one in a frame; none may if it is empty.

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
        key: str = "",
    ) -> None:
        self._key = key
        self._on_visit, self._max_browsers, self._on_map = on_visit, max_browsers, on_map
        self._loopback = is_loopback(host)
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
            path = connection.request.path.partition("?")[0]
            if path.startswith(MAP):
                await self._show_map(connection, path.removeprefix(MAP))
                return
            handled_by(connection)
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
            process_response=partial(add_headers, key=self._key),
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
        headers = headers_of(request)
        path = request.path.partition("?")[0]
        if is_foreign(headers, loopback=self._loopback):
            return connection.respond(HTTPStatus.FORBIDDEN, "It may only be opened by its own address.\n")
        if self._key and is_same(path, f"/{EMBEDDED}/{self._key}"):
            return _found(connection, PageFile(PICTURE, "image/svg+xml"))
        embedded = headers.get("sec-fetch-dest") == "iframe" and is_embedded(request, self._key)
        own = is_view(request) and is_own_frame(headers)
        if headers.get("sec-fetch-dest") in FRAMES and not (own or embedded):
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
        # No link may choose the token.
        alone = headers.get("sec-fetch-dest") == "document" or (embedded and not own)
        if path == "/" and (alone or not is_view(request)) and "upgrade" not in headers:
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
        query = "&".join(s for s in settings if s.partition("=")[0] not in (PAGE, STACKED, EMBEDDED))
        # The page adds its own behind those of the address that was opened.
        page = next((s.partition("=")[2] for s in reversed(settings) if s.startswith(f"{PAGE}=")), "")
        tokens = [text if TOKEN.fullmatch(text) else "" for text in page.split(".")]
        before = tokens[1] if len(tokens) == 2 else ""
        stacked = any(s.partition("=")[0] == STACKED for s in settings)  # viser may write "stacked=" instead
        visit = Visit(token, query, address, tokens[0], before, stacked)
        if not is_own_picture(headers) or not self._on_visit(visit):
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


def _quiet_logger() -> logging.Logger:
    """Return a logger that does not report every visitor who speaks no HTTP."""
    logger = logging.getLogger(f"{__name__}.websockets")
    logger.addFilter(_is_about_more_than_a_handshake)
    return logger


def _is_about_more_than_a_handshake(record: logging.LogRecord) -> bool:
    return record.getMessage() != "opening handshake failed"
