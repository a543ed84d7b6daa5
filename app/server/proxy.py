"""What stands between browsers and viser: lets in only what comes from this server's own page.

viser accepts a websocket from any web page and does not tell which address a browser has opened.
So viser listens on a port of its own on this machine, and this door, on the port that people know,
passes connections on to it. It refuses

* websockets that a page of another origin opens (the ``Origin`` header names another host),
* on a loopback address, requests for another host's name (DNS rebinding).

Whoever finds viser's own port meets an empty page: a browser is served after it has loaded a
picture with a secret name through the door, from a page of the door's own. That request also
carries, as its ``Referer``, the address that was opened.
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
"""Where the picture is; its secret name comes after."""

HEAD_LIMIT = 1 << 16
"""Largest head of a request (bytes)."""

HEAD_SECONDS = 20.0
"""How long a browser may take to say what it wants."""

CHUNK = 1 << 16

PICTURE = b'<svg xmlns="http://www.w3.org/2000/svg" width="1" height="1"/>'


@dataclass(frozen=True)
class Visit:
    """A browser that came in through the door.

    Attributes:
        token: the secret name it knew.
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
        """Take the head of a request apart; names of headers in lower case."""
        first, *lines = head.decode("latin-1").split("\r\n")
        _, path, _ = first.split(" ", 2)
        pairs = (line.partition(":") for line in lines if line)
        return _Request(path, {name.strip().lower(): value.strip() for name, _, value in pairs})

    @property
    def is_websocket(self) -> bool:
        return self.headers.get("upgrade", "").lower() == "websocket"


def is_foreign(headers: Mapping[str, str], *, loopback: bool) -> bool:
    """Whether a request comes from a page of another origin, or asks for another host.

    Args:
        headers: of the request, names in lower case.
        loopback: whether the door is only open to this machine.
    """
    host = headers.get("host", "")
    if loopback and not _is_loopback(urlsplit(f"//{host}").hostname or ""):
        return True
    origin = headers.get("origin")
    return origin is not None and urlsplit(origin).netloc != host


def _is_own_picture(headers: Mapping[str, str]) -> bool:
    """Whether a picture is loaded by a page of the same origin: browsers say so in one of two headers."""
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
    """Passes connections on; runs on a thread of its own until closed.

    Args:
        host, port: where people connect to.
        inner: port that viser listens on, on 127.0.0.1.
        on_visit: told about a browser that came in; gives whether its token is known.

    Raises:
        OSError: the port cannot be listened on.
    """

    def __init__(self, host: str, port: int, inner: int, on_visit: Callable[[Visit], bool]) -> None:
        self._inner, self._on_visit = inner, on_visit
        self._loopback = _is_loopback(host)
        self._loop = asyncio.new_event_loop()
        try:
            self._server = self._loop.run_until_complete(
                asyncio.start_server(self._answer, host, port, limit=HEAD_LIMIT)
            )
        except OSError:
            self._loop.close()
            raise
        self._thread = threading.Thread(target=self._loop.run_forever, name="front door", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Close the door and every connection through it."""

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
            head = await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), HEAD_SECONDS)
            request = _Request.parse(head)
            if is_foreign(request.headers, loopback=self._loopback):
                _reply(writer, "403 Forbidden", b"this page may only be opened by its own address\n")
            elif request.path.startswith(HELLO):
                self._greet(request, writer)
            else:
                await self._pass_on(head, reader, writer)
            await writer.drain()
        except (OSError, ValueError, TimeoutError, asyncio.IncompleteReadError, asyncio.LimitOverrunError):
            pass  # a browser that went away, or something that speaks no HTTP
        finally:
            writer.close()

    def _greet(self, request: _Request, writer: asyncio.StreamWriter) -> None:
        opened = urlsplit(request.headers.get("referer", "/"))
        address = urlunsplit((opened.scheme, opened.netloc, opened.path, "", ""))
        visit = Visit(request.path.removeprefix(HELLO), opened.query, address)
        if _is_own_picture(request.headers) and self._on_visit(visit):
            _reply(writer, "200 OK", PICTURE, "image/svg+xml")
        else:
            _reply(writer, "404 Not Found", b"")

    async def _pass_on(self, head: bytes, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Connect to viser and copy both ways until either side is done."""
        inner_reader, inner_writer = await asyncio.open_connection("127.0.0.1", self._inner)
        try:
            inner_writer.write(head)
            ways = [_copy(reader, inner_writer), _copy(inner_reader, writer)]
            tasks = [asyncio.create_task(way) for way in ways]
            try:
                await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            finally:
                for task in tasks:
                    task.cancel()
                await asyncio.gather(*tasks, return_exceptions=True)
        finally:
            inner_writer.close()


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
