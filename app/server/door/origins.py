"""What a browser's requests say of where they come from, and what answers say against use by other pages."""

from __future__ import annotations

import ipaddress
import re
import secrets
from collections.abc import Mapping
from urllib.parse import urlsplit

from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

__all__ = [
    "EMBEDDED",
    "FRAMES",
    "PAGE",
    "STACKED",
    "add_headers",
    "headers_of",
    "is_embedded",
    "is_foreign",
    "is_loopback",
    "is_own_frame",
    "is_own_picture",
    "is_same",
    "is_view",
]

PAGE = "page"
"""The setting in the address of viser's page that has the token of the page around it."""

STACKED = "stacked"
"""The setting there that says that map, view and panels lie one below the other in the window."""

EMBEDDED = "embedded"
"""The setting in an address that has the key with which a notebook may show the page in a frame."""

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


def is_foreign(headers: Mapping[str, str], *, loopback: bool) -> bool:
    """Return whether a request comes from a page of another origin, or names another host.

    Args:
        headers: of the request, names in lower case.
        loopback: whether the server listens on a loopback address only.
    """
    host = headers.get("host", "")
    if not HOST.fullmatch(host):
        return True
    if loopback and not is_loopback(urlsplit(f"//{host}").hostname or ""):
        return True
    origin = headers.get("origin")
    return origin is not None and urlsplit(origin).netloc != host


def is_own_picture(headers: Mapping[str, str]) -> bool:
    """Return whether a page of the same origin loads the picture, by one of two headers of browsers."""
    if headers.get("sec-fetch-dest", "image") != "image":
        return False
    if "sec-fetch-site" in headers:
        return headers["sec-fetch-site"] == "same-origin"
    return urlsplit(headers.get("referer", "")).netloc == headers.get("host")


def is_own_frame(headers: Mapping[str, str]) -> bool:
    """Return whether a page of the same origin shows it in a frame."""
    return headers["sec-fetch-dest"] == "iframe" and headers.get("sec-fetch-site") == "same-origin"


def is_loopback(name: str) -> bool:
    """Return whether a name is that of this machine, for itself."""
    if name == "localhost":
        return True
    try:
        return ipaddress.ip_address(name).is_loopback
    except ValueError:
        return False


def is_view(request: Request) -> bool:
    """Return whether a request is for viser's page, which the page around it shows in a frame."""
    path, _, query = request.path.partition("?")
    return path == "/" and any(setting.partition("=")[0] == PAGE for setting in query.split("&"))


def is_same(given: str, secret: str) -> bool:
    """Return whether a text is a secret one, in a time that does not tell how much of it is."""
    return secrets.compare_digest(given.encode(errors="replace"), secret.encode())


def is_embedded(request: Request, key: str) -> bool:
    """Return whether a request is for the page or its view, and has the key; never where the key is empty."""
    path, _, query = request.path.partition("?")
    given = [value for name, _, value in (s.partition("=") for s in query.split("&")) if name == EMBEDDED]
    return path == "/" and bool(key) and len(given) == 1 and is_same(given[0], key)


def headers_of(request: Request) -> dict[str, str]:
    """Return the headers of a request, names in lower case; repeated ones become one that no page sends."""
    headers: dict[str, str] = {}
    for name, value in request.headers.raw_items():
        name = name.lower()
        headers[name] = f"{headers[name]}, {value}" if name in headers else value
    return headers


def add_headers(_: ServerConnection, request: Request, response: Response, key: str = "") -> None:
    """Add to a response what keeps other pages from using it; whoever has the key may frame the page."""
    host = headers_of(request).get("host", "")
    framed = is_view(request)
    policy = VIEW_POLICY if framed else PAGE_POLICY
    embedded = is_embedded(request, key)
    if embedded:
        policy = policy.rpartition("; frame-ancestors")[0]
    response.headers["Content-Security-Policy"] = policy.format(
        host=host if HOST.fullmatch(host) else "invalid"
    )
    if not embedded:
        response.headers["X-Frame-Options"] = "SAMEORIGIN" if framed else "DENY"
    response.headers["X-Content-Type-Options"] = "nosniff"
    response.headers["Referrer-Policy"] = "same-origin"
