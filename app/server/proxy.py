"""The proxy between browsers and viser: it passes on only what comes from this server's own page.

viser accepts a websocket from any web page and does not say which address a browser has opened.
So viser listens on a port of its own on this machine, and this proxy, the server's front door,
listens on the public port and passes connections on to it. It refuses

* websockets that a page of another origin opens (the ``Origin`` header names another host),
* on a loopback address, requests for another host's name (DNS rebinding).

viser's own port alone serves an empty page: a browser gets a session after it has loaded a picture
with a secret token in its path through the proxy, from a page of the same origin. The ``Referer``
of that request is the address that was opened.
"""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from urllib.parse import urlsplit, urlunsplit

__all__ = ["HELLO", "Proxy", "Visit", "is_foreign"]

HELLO = "/hello/"
"""Path of the picture, followed by its secret token."""

HEAD_LIMIT = 1 << 16
"""Largest head of a request (bytes)."""

HEAD_TIMEOUT = 20.0
"""Time (s) within which the head of a request must arrive."""

CHUNK = 1 << 16
"""Most bytes that are copied at a time."""

PICTURE = b'<svg xmlns="http://www.w3.org/2000/svg" width="1" height="1"/>'


@dataclass(frozen=True)
class Visit:
    """A browser that loaded its picture through the proxy.

    Attributes:
        token: the secret token in the path of the picture.
        query: what stood behind the ``?`` of the address it opened.
        address: the address without that.
    """

    token: str
    query: str = ""
    address: str = "/"


@dataclass(frozen=True)
class _Request:
    path: str
    headers: Mapping[str, str]

    @staticmethod
    def parse(head: bytes) -> _Request:
        """Parse the head of a request; names of headers become lower case."""
        first, *lines = head.decode("latin-1").split("\r\n")
        _, path, _ = first.split(" ", 2)
        pairs = (line.partition(":") for line in lines if line)
        return _Request(path, {name.strip().lower(): value.strip() for name, _, value in pairs})


def is_foreign(headers: Mapping[str, str], *, loopback: bool) -> bool:
    """Return whether a request comes from a page of another origin, or names another host.

    Args:
        headers: of the request, names in lower case.
        loopback: whether the proxy listens on a loopback address only.
    """
    host = headers.get("host", "")
    if loopback and not _is_loopback(urlsplit(f"//{host}").hostname or ""):
        return True
    origin = headers.get("origin")
    return origin is not None and urlsplit(origin).netloc != host


def _is_own_picture(headers: Mapping[str, str]) -> bool:
    """Return whether a page of the same origin loads the picture, by one of two headers of browsers."""
    if "sec-fetch-site" in headers:
        return headers["sec-fetch-site"] == "same-origin"
    return urlsplit(headers.get("referer", "")).netloc == headers.get("host")


def _is_loopback(name: str) -> bool:
    if name == "localhost":
        return True
    try:
        return ipaddress.ip_address(name).is_loopback
    except ValueError:
        return False


class Proxy:
    """A reverse proxy for viser; runs on a thread of its own until closed.

    Args:
        host, port: the public address to listen on.
        viser_port: port that viser listens on, on 127.0.0.1.
        on_visit: called when a browser loads its picture; returns whether its token is valid.

    Raises:
        OSError: the port cannot be listened on.
    """

    def __init__(self, host: str, port: int, viser_port: int, on_visit: Callable[[Visit], bool]) -> None:
        self._viser_port, self._on_visit = viser_port, on_visit
        self._loopback = _is_loopback(host)
        self._loop = asyncio.new_event_loop()
        try:
            self._server = self._loop.run_until_complete(
                asyncio.start_server(self._answer, host, port, limit=HEAD_LIMIT)
            )
        except OSError:
            self._loop.close()
            raise
        self._thread = threading.Thread(target=self._loop.run_forever, name="proxy", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop listening and close every connection."""

        async def end() -> None:
            self._server.close()
            tasks = asyncio.all_tasks() - {asyncio.current_task()}
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

        asyncio.run_coroutine_threadsafe(end(), self._loop).result()
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()

    async def _answer(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            head = await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), HEAD_TIMEOUT)
            request = _Request.parse(head)
            if is_foreign(request.headers, loopback=self._loopback):
                _reply(writer, "403 Forbidden", b"this page may only be opened by its own address\n")
            elif request.path.startswith(HELLO):
                self._serve_picture(request, writer)
            else:
                await self._pass_on(head, reader, writer)
            await writer.drain()
        except (OSError, ValueError, TimeoutError, asyncio.IncompleteReadError, asyncio.LimitOverrunError):
            pass  # the browser disconnected, or it is no HTTP
        finally:
            writer.close()

    def _serve_picture(self, request: _Request, writer: asyncio.StreamWriter) -> None:
        opened = urlsplit(request.headers.get("referer", "/"))
        address = urlunsplit((opened.scheme, opened.netloc, opened.path, "", ""))
        visit = Visit(request.path.removeprefix(HELLO), opened.query, address)
        if _is_own_picture(request.headers) and self._on_visit(visit):
            _reply(writer, "200 OK", PICTURE, "image/svg+xml")
        else:
            _reply(writer, "404 Not Found", b"")

    async def _pass_on(self, head: bytes, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Connect to viser and copy in both directions until either side closes."""
        viser_reader, viser_writer = await asyncio.open_connection("127.0.0.1", self._viser_port)
        try:
            viser_writer.write(head)
            copies = [_copy(reader, viser_writer), _copy(viser_reader, writer)]
            tasks = [asyncio.create_task(copy) for copy in copies]
            try:
                await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            finally:
                for task in tasks:
                    task.cancel()
                await asyncio.gather(*tasks, return_exceptions=True)
        finally:
            viser_writer.close()


async def _copy(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    while data := await reader.read(CHUNK):
        writer.write(data)
        await writer.drain()


def _reply(writer: asyncio.StreamWriter, status: str, body: bytes, kind: str = "text/plain") -> None:
    lines = [
        f"HTTP/1.1 {status}",
        f"Content-Type: {kind}",
        f"Content-Length: {len(body)}",
        "Cache-Control: no-store",
        "Connection: close",
    ]
    with contextlib.suppress(OSError):
        writer.write("\r\n".join([*lines, "", ""]).encode() + body)
