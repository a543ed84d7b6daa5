"""Who is let in, and that what is let in passes unchanged."""

from __future__ import annotations

import socket
import socketserver
import threading
from collections.abc import Iterator
from contextlib import suppress

import pytest
import viser
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Origin, Subprotocol

from app.server.proxy import HELLO, Proxy, Visit, is_foreign

PROTOCOL = Subprotocol(f"viser-v{viser.__version__}")


class Echo(socketserver.BaseRequestHandler):
    """Answers with what it was sent, and hangs up after the word "bye"."""

    def handle(self) -> None:
        while data := self.request.recv(1 << 16):
            self.request.sendall(data)
            if data.endswith(b"bye"):
                return


def a_free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Visits(list[Visit]):
    def __call__(self, visit: Visit) -> bool:
        self.append(visit)
        return visit.token == "known"


@pytest.fixture
def visits() -> Visits:
    return Visits()


@pytest.fixture
def port(visits) -> Iterator[int]:
    """A proxy in front of the echo."""
    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), Echo) as echo:
        threading.Thread(target=echo.serve_forever, daemon=True).start()
        port = a_free_port()
        proxy = Proxy("127.0.0.1", port, echo.server_address[1], visits)
        yield port
        proxy.close()
        echo.shutdown()


def ask(port: int, path: str, body: bytes = b"", **headers: str) -> bytes:
    """Send a request and read until the other side hangs up."""
    lines = [f"GET {path} HTTP/1.1", *(f"{k.replace('_', '-')}: {v}" for k, v in headers.items())]
    with socket.create_connection(("127.0.0.1", port)) as s:
        s.sendall("\r\n".join([*lines, "", ""]).encode() + body)
        answer = b""
        while data := s.recv(1 << 16):
            answer += data
    return answer


def test_what_is_let_in_passes_unchanged_both_ways(port):
    body = bytes(range(256)) * 4000 + b"bye"
    answer = ask(port, "/x?y", body, Host=f"localhost:{port}", Origin=f"http://localhost:{port}")
    head, _, rest = answer.partition(b"\r\n\r\n")
    assert head.startswith(b"GET /x?y HTTP/1.1\r\nHost: localhost:")
    assert rest == body


@pytest.mark.parametrize(
    ("host", "origin", "loopback", "foreign"),
    [
        ("127.0.0.1:8080", None, True, False),
        ("localhost:8080", "http://localhost:8080", True, False),
        ("[::1]:8080", "http://[::1]:8080", True, False),
        ("127.0.0.1:8080", "http://evil.example", True, True),
        ("127.0.0.1:8080", "http://127.0.0.1:9090", True, True),
        ("127.0.0.1:8080", "http://localhost:8080", True, True),
        ("127.0.0.1:8080", "null", True, True),
        ("evil.example:8080", "http://evil.example:8080", True, True),
        ("", None, True, True),
        ("robots.example", "https://robots.example", False, False),
        ("robots.example", "https://evil.example", False, True),
    ],
)
def test_who_is_foreign(host, origin, loopback, foreign):
    headers = {"host": host} | ({"origin": origin} if origin else {})
    assert is_foreign(headers, loopback=loopback) is foreign


def test_strangers_are_turned_away_before_anything_passes(port):
    for origin in ("http://evil.example", "null"):
        answer = ask(port, "/", b"bye", Host=f"127.0.0.1:{port}", Origin=origin)
        assert answer.startswith(b"HTTP/1.1 403 ")
        assert b"bye" not in answer
    assert ask(port, "/", Host="evil.example").startswith(b"HTTP/1.1 403 ")
    assert ask(port, "/").startswith(b"HTTP/1.1 403 ")


def test_a_page_of_the_proxys_own_is_greeted_with_the_address_it_opened(port, visits):
    host = f"127.0.0.1:{port}"
    page = f"http://{host}/?scene=soda_can&turn=30"
    assert b"200 OK" in ask(port, f"{HELLO}known", Host=host, Referer=page, Sec_Fetch_Site="same-origin")
    assert visits == [Visit("known", "scene=soda_can&turn=30", f"http://{host}/")]
    assert b"404" in ask(port, f"{HELLO}guessed", Host=host, Referer=page)
    assert visits[1:] == [Visit("guessed", "scene=soda_can&turn=30", f"http://{host}/")]


@pytest.mark.parametrize(
    "headers",
    [
        {},
        {"Referer": "http://evil.example/"},
        {"Sec_Fetch_Site": "cross-site"},
        {"Sec_Fetch_Site": "none"},
        {"Sec_Fetch_Site": "same-site"},
    ],
)
def test_a_page_from_elsewhere_is_not_greeted(port, visits, headers):
    answer = ask(port, f"{HELLO}known", Host=f"127.0.0.1:{port}", **headers)
    assert answer.startswith(b"HTTP/1.1 404 ")
    assert visits == []


def test_nonsense_is_hung_up_on(port):
    for nonsense in (b"\r\n\r\n", b"x\r\n\r\n", b"GET / HTTP/1.1\r\n" + b"a" * 200_000):
        answer = b""
        # It may hang up while the rest is still being sent.
        with socket.create_connection(("127.0.0.1", port)) as s, suppress(OSError):
            s.sendall(nonsense)
            s.shutdown(socket.SHUT_WR)
            answer = s.recv(1000)
        assert not answer or answer.startswith(b"HTTP/1.1 403 ")
    assert ask(port, "/", b"bye", Host="localhost").endswith(b"bye")  # and lives on


def test_a_taken_port_is_an_error(port, visits):
    with pytest.raises(OSError, match="in use"):
        Proxy("127.0.0.1", port, 1, visits)


def test_viser_is_reached_from_the_own_origin_only(visits):
    server = viser.ViserServer(host="127.0.0.1", port=a_free_port(), verbose=False)
    port = a_free_port()
    proxy = Proxy("127.0.0.1", port, server.get_port(), visits)
    try:
        own = Origin(f"http://127.0.0.1:{port}")
        with connect(f"ws://127.0.0.1:{port}", origin=own, subprotocols=[PROTOCOL]) as socket_:
            assert socket_.recv()
        with pytest.raises(InvalidStatus) as refused:
            connect(f"ws://127.0.0.1:{port}", origin=Origin("http://evil.example"), subprotocols=[PROTOCOL])
        assert refused.value.response.status_code == 403
    finally:
        proxy.close()
        server.stop()
