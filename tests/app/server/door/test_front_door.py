"""Who is let in, and what is answered."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import ExitStack, suppress

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Origin

from app.files.links import Link
from app.server.door import browser_connection
from app.server.door.front_door import HELLO, FrontDoor, Visit
from app.server.door.origins import PAGE, is_foreign
from app.server.door.viser_server import any_port, quiet_server
from tests.app.server.door.sockets import PROTOCOL, WAIT, own


def head(path: str, **headers: str) -> bytes:
    lines = [f"GET {path} HTTP/1.1", *(f"{k.replace('_', '-')}: {v}" for k, v in headers.items())]
    return "\r\n".join([*lines, "", ""]).encode()


def read_all(s: socket.socket) -> bytes:
    """Read until the other side hangs up."""
    answer = b""
    with suppress(ConnectionResetError):
        while data := s.recv(1 << 16):
            answer += data
    return answer


def send(port: int, request: bytes) -> bytes:
    with socket.create_connection(("127.0.0.1", port), timeout=WAIT) as s:
        s.sendall(request)
        return read_all(s)


def ask(port: int, path: str, **headers: str) -> bytes:
    return send(port, head(path, **{"Host": f"127.0.0.1:{port}"} | headers))


def test_the_page_is_served(port):
    answer = ask(port, "/")
    assert answer.startswith(b"HTTP/1.1 200 ")
    assert answer.rstrip().endswith(b"</html>")


@pytest.mark.parametrize(
    ("path", "headers", "status"),
    [
        ("/", {}, 200),
        ("/shell/shell.js", {}, 200),
        ("/shell/nothing.js", {}, 404),
        ("/shell/../files.py", {}, 404),
        ("/map/short", {}, 404),
        ("/nothing", {}, 404),
        (f"{HELLO}known", {"Sec_Fetch_Site": "same-origin"}, 200),
        (f"{HELLO}guessed", {"Sec_Fetch_Site": "same-origin"}, 404),
        ("/", {"Origin": "http://evil.example"}, 403),
        ("/", {"Sec_Fetch_Dest": "iframe"}, 403),
        ("/", {"Upgrade": "websocket"}, 426),
    ],
)
def test_every_answer_keeps_other_pages_from_using_it(port, path, headers, status):
    answer = ask(port, path, **headers).partition(b"\r\n\r\n")[0].decode()
    assert answer.startswith(f"HTTP/1.1 {status} ")
    lines = answer.lower().splitlines()
    assert "x-frame-options: deny" in lines
    assert "x-content-type-options: nosniff" in lines
    assert "referrer-policy: same-origin" in lines
    (policy,) = [line for line in lines if line.startswith("content-security-policy: ")]
    assert "default-src 'none'" in policy
    assert "frame-ancestors 'none'" in policy
    assert "script-src 'self';" in policy
    assert f"connect-src ws://127.0.0.1:{port} wss://127.0.0.1:{port};" in policy
    assert "unsafe" not in policy


def test_the_view_is_shown_inside_the_page_alone(port):
    for inside, site, status in (
        ("iframe", "same-origin", 200), ("iframe", "same-site", 403), ("iframe", "cross-site", 403),
        ("embed", "same-origin", 403), ("empty", "same-origin", 200),
    ):  # fmt: skip
        answer = ask(port, "/?scene=soda_can&page=x", Sec_Fetch_Dest=inside, Sec_Fetch_Site=site)
        assert answer.startswith(f"HTTP/1.1 {status} ".encode())
        head = answer.partition(b"\r\n\r\n")[0].decode().lower()
        assert "x-frame-options: sameorigin" in head
        assert "frame-ancestors 'self'" in head
        assert f"connect-src ws://127.0.0.1:{port} wss://127.0.0.1:{port} data: blob:" in head
        assert "'unsafe-eval'" not in head


@pytest.fixture
def embedded(visits) -> Iterator[tuple[int, str]]:
    """The port of a server that notebooks may show in a frame, and the key for it."""
    key = "k" * 32
    server = quiet_server(FrontDoor("127.0.0.1", any_port(), visits, 2, key=key))
    yield server.get_port(), key
    server.stop()


def test_who_has_the_key_may_show_the_page_in_a_frame(embedded):
    port, key = embedded
    inside = {"Sec_Fetch_Dest": "iframe", "Sec_Fetch_Site": "cross-site"}
    for path in (f"/?task=pick&embedded={key}", f"/?embedded={key}&page=x"):
        answer = ask(port, path, **inside)
        head = answer.partition(b"\r\n\r\n")[0].decode().lower()
        assert head.startswith("http/1.1 200 ")
        assert "x-frame-options" not in head
        assert "frame-ancestors" not in head
        assert "default-src 'none'; script-src " in head
        assert b'<iframe id="view"' in answer  # not the view alone, with a token that another page has chosen
    own = {"Sec_Fetch_Dest": "iframe", "Sec_Fetch_Site": "same-origin"}
    view = ask(port, f"/?embedded={key}&page=x", **own).partition(b"\r\n\r\n")
    assert view[0].startswith(b"HTTP/1.1 200 ")
    assert b"frame-ancestors" not in view[0]
    assert b'<iframe id="view"' not in view[2]
    assert ask(port, f"/embedded/{key}", Sec_Fetch_Dest="image", Sec_Fetch_Site="cross-site").startswith(
        b"HTTP/1.1 200 "
    )


@pytest.mark.parametrize(
    "query",
    ["", "embedded=", "embedded=guess", "embedded={key}x", "embedded={key}&embedded={key}", "x={key}"],
)
@pytest.mark.parametrize("inside", ["iframe", "embed", "object"])
def test_who_has_not_may_not(embedded, port, query, inside):
    open_port, key = embedded
    asked = f"/?{query.format(key=key)}"
    for door in (open_port, port):  # the other has no key
        head = ask(door, asked, Sec_Fetch_Dest=inside, Sec_Fetch_Site="cross-site").lower()
        assert head.startswith(b"http/1.1 403 ")
        assert b"x-frame-options: deny" in head
        assert b"frame-ancestors 'none'" in head
    assert ask(port, f"/embedded/{key}").startswith(b"HTTP/1.1 404 ")
    assert ask(open_port, "/embedded/").startswith(b"HTTP/1.1 404 ")
    assert ask(port, "/embedded/").startswith(b"HTTP/1.1 404 ")


def test_a_link_opens_the_page_whatever_its_settings(port):
    """A link may choose what the view shows, but not the token that ties map and view together."""
    assert PAGE not in Link.model_fields
    for query in ("view=clearance", f"scene=soda_can&{PAGE}={'a' * 32}"):
        answer = ask(port, f"/?{query}", Sec_Fetch_Dest="document", Sec_Fetch_Site="none")
        assert answer.partition(b"\r\n\r\n")[2] == ask(port, "/").partition(b"\r\n\r\n")[2]
        assert b'<iframe id="view"' in answer


def test_the_token_of_the_page_is_no_part_of_the_address_that_was_opened(port, visits):
    token, address = "a" * 32, f"http://127.0.0.1:{port}/"
    page = f"{address}?scene=soda_can&page=guess&page={token}&turn=30"
    ask(port, f"{HELLO}known", Referer=page, Sec_Fetch_Site="same-origin")
    assert visits == [Visit("known", "scene=soda_can&turn=30", address, token)]
    for stacked in ("stacked", "stacked="):  # as the page writes it, and as viser may write it anew
        ask(port, f"{HELLO}known", Referer=f"{page}&{stacked}", Sec_Fetch_Site="same-origin")
        assert visits[-1] == Visit("known", "scene=soda_can&turn=30", address, token, stacked=True)


@pytest.mark.parametrize(
    ("tokens", "page", "before"),
    [
        ("{a}", "{a}", ""),
        ("{a}.{b}", "{a}", "{b}"),
        ("{a}.short", "{a}", ""),
        ("short.{b}", "", "{b}"),
        ("{a}.{b}.{b}", "{a}", ""),
        ("", "", ""),
    ],
)
def test_a_page_says_which_it_continues(port, visits, tokens, page, before):
    known = {"a": "a" * 32, "b": "b" * 32}
    address = f"http://127.0.0.1:{port}/?page={tokens.format(**known)}"
    ask(port, f"{HELLO}known", Referer=address, Sec_Fetch_Site="same-origin")
    assert [(visit.page, visit.before) for visit in visits] == [
        (page.format(**known), before.format(**known))
    ]


def test_a_host_that_is_none_does_not_get_into_the_policy(port):
    answer = ask(port, "/", Host="x;script-src *")
    assert answer.startswith(b"HTTP/1.1 403 ")
    assert b"script-src *" not in answer


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


def test_strangers_are_turned_away(port):
    for origin in ("http://evil.example", "null"):
        assert ask(port, "/", Origin=origin).startswith(b"HTTP/1.1 403 ")
    assert ask(port, "/", Host="evil.example").startswith(b"HTTP/1.1 403 ")
    assert send(port, head("/")).startswith(b"HTTP/1.1 403 ")


def test_of_headers_that_are_sent_twice_neither_counts(port):
    own_host, own_origin = f"Host: 127.0.0.1:{port}", f"Origin: http://127.0.0.1:{port}"
    for twice in (f"{own_host}\r\nHost: evil.example", f"{own_host}\r\n{own_origin}\r\nOrigin: null"):
        answer = send(port, f"GET / HTTP/1.1\r\n{twice}\r\n\r\n".encode())
        assert answer.startswith(b"HTTP/1.1 403 ")


def test_a_connection_has_no_second_request(port, visits):
    """So that none passes unseen behind one that is let in."""
    first = head("/nothing", Host=f"127.0.0.1:{port}", Connection="keep-alive")
    second = head(f"{HELLO}known", Host=f"127.0.0.1:{port}", Sec_Fetch_Site="same-origin")
    assert send(port, first + second).count(b"HTTP/1.1") <= 1
    with socket.create_connection(("127.0.0.1", port), timeout=WAIT) as s:
        s.sendall(first)
        assert b"404" in s.recv(1 << 16)
        with suppress(OSError):
            s.sendall(second)
        assert b"HTTP/1.1" not in read_all(s)
    assert visits == []


def test_nobody_is_greeted_over_a_websocket(port, visits):
    with own(port) as browser:
        with suppress(OSError):
            browser.socket.sendall(
                head(f"{HELLO}known", Host=f"127.0.0.1:{port}", Sec_Fetch_Site="same-origin")
            )
        with pytest.raises(ConnectionClosed):
            while True:
                browser.recv(WAIT)
    assert visits == []


@pytest.mark.parametrize("inside", ["iframe", "frame", "embed", "object", "fencedframe"])
def test_the_page_is_not_shown_inside_another(port, inside):
    for site in ("same-origin", "same-site", "cross-site"):
        answer = ask(port, "/", Sec_Fetch_Dest=inside, Sec_Fetch_Site=site)
        assert answer.startswith(b"HTTP/1.1 403 ")
    assert ask(port, "/", Sec_Fetch_Dest="document").startswith(b"HTTP/1.1 200 ")


def test_a_page_of_the_servers_own_is_greeted_with_the_address_it_opened(port, visits):
    host = f"127.0.0.1:{port}"
    page = f"http://{host}/?scene=soda_can&turn=30"
    answer = ask(port, f"{HELLO}known", Referer=page, Sec_Fetch_Site="same-origin")
    assert b"200 OK" in answer
    assert b"Content-Type: image/svg+xml" in answer
    assert visits == [Visit("known", "scene=soda_can&turn=30", f"http://{host}/")]
    assert b"404" in ask(port, f"{HELLO}guessed", Referer=page)
    assert visits[1:] == [Visit("guessed", "scene=soda_can&turn=30", f"http://{host}/")]


@pytest.mark.parametrize(
    "headers",
    [
        {},
        {"Referer": "http://evil.example/"},
        {"Sec_Fetch_Site": "cross-site"},
        {"Sec_Fetch_Site": "none"},
        {"Sec_Fetch_Site": "same-site"},
        {"Sec_Fetch_Site": "same-origin", "Sec_Fetch_Dest": "document"},
    ],
)
def test_a_page_from_elsewhere_is_not_greeted(port, visits, headers):
    assert ask(port, f"{HELLO}known", **headers).startswith(b"HTTP/1.1 404 ")
    assert visits == []


def test_nonsense_is_hung_up_on(port, caplog):
    for nonsense in (b"\r\n\r\n", b"x\r\n\r\n", b"GET / HTTP/1.1\r\n" + b"a" * 200_000):
        # It may hang up while the rest is still being sent.
        with socket.create_connection(("127.0.0.1", port), timeout=WAIT) as s, suppress(OSError):
            s.sendall(nonsense)
            s.shutdown(socket.SHUT_WR)
            assert b"200 OK" not in read_all(s)
    assert b"200 OK" in ask(port, "/")
    assert caplog.records == []


def test_a_taken_port_is_an_error(port, visits):
    with pytest.raises(OSError, match="in use"):
        FrontDoor("127.0.0.1", port, visits, 2)


def test_a_websocket_is_opened_from_the_own_origin_only(port):
    with own(port) as browser:
        assert browser.recv(WAIT)
    with pytest.raises(InvalidStatus) as refused:
        connect(f"ws://127.0.0.1:{port}", origin=Origin("http://evil.example"), subprotocols=[PROTOCOL])
    assert refused.value.response.status_code == 403


def test_when_it_is_full_it_says_so_and_those_who_are_in_stay(port):
    with own(port) as one:
        with own(port) as two:
            answer = ask(port, "/")
            assert answer.startswith(b"HTTP/1.1 503 ")
            assert b"in use by 2 browsers" in answer
            with pytest.raises(InvalidStatus) as refused:
                own(port)
            assert refused.value.response.status_code == 503
            assert two.recv(WAIT)
        while not ask(port, "/").startswith(b"HTTP/1.1 200 "):
            pass  # until the server has noticed that one has gone
        assert one.recv(WAIT)


def test_who_never_loads_the_picture_has_to_go(port, monkeypatch):
    with own(port) as one:
        monkeypatch.setattr(browser_connection, "HELLO_TIMEOUT", 0.1)
        with own(port) as two, pytest.raises(ConnectionClosed):
            while True:
                two.recv(WAIT)
        assert one.recv(WAIT)


def test_half_a_request_is_not_waited_for(port, monkeypatch):
    monkeypatch.setattr(browser_connection, "HEAD_TIMEOUT", 0.1)
    with socket.create_connection(("127.0.0.1", port), timeout=WAIT) as s:
        s.sendall(b"GET / HTTP/1.1\r\nHost: ")
        assert read_all(s) == b""


def test_many_who_send_their_requests_slowly_keep_nobody_out(port, monkeypatch):
    monkeypatch.setattr(browser_connection, "MAX_REQUESTS", 20)
    monkeypatch.setattr(browser_connection, "HEAD_TIMEOUT", 10 * WAIT)
    with ExitStack() as stack:
        slow = [
            stack.enter_context(socket.create_connection(("127.0.0.1", port), timeout=WAIT))
            for _ in range(60)
        ]
        for s in slow:
            with suppress(OSError):
                s.sendall(b"GET / HTTP/1.1\r\n")
        assert ask(port, "/").startswith(b"HTTP/1.1 200 ")  # while twenty of them still wait
        assert read_all(slow[0]) == b""  # the oldest had to go
        slow[-1].sendall(f"Host: 127.0.0.1:{port}\r\n\r\n".encode())
        assert read_all(slow[-1]).startswith(b"HTTP/1.1 200 ")
