"""Nobody at a server is harmed by what others do there; the measured times are printed, not judged."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from statistics import median

import msgspec
import pytest
from websockets.exceptions import ConnectionClosed

from app.compute.cache import SharedCache
from app.compute.warm_up import compute_first_map
from app.server.door.browser_connection import READ_BURST
from app.server.door.lobby import open_lobby
from app.server.door.viser_server import any_port
from tests.app.server.session.served import picture, processes, ready
from tests.app.wire import Wire

pytestmark = pytest.mark.filterwarnings("ignore:Queued a .* on a closed connection")

BROWSERS = 20
TURNS = 10


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    """The page, with room for more browsers than come: it takes a while to notice that one has gone."""
    cache, port = SharedCache("bottle_on_table"), any_port()
    compute_first_map(cache)
    with open_lobby(cache, "127.0.0.1", port, BROWSERS + 10):
        yield port


class Turner(Wire):
    """A browser whose object was turned so many times."""

    turned = 0.0


def turns(browser: Turner, count: int = TURNS) -> list[float]:
    """How long (s) each of so many turns of the object takes to be shown."""
    times = []
    for k in range(count):
        before, since = picture(browser.html()), time.monotonic()
        browser.set("Rotation (°)", 5.0 + 15.0 * k + browser.turned)
        browser.wait_for(lambda html, before=before: picture(html) not in ("", before))
        times.append(time.monotonic() - since)
    browser.turned += 1.0
    return times


class Flooder(Wire):
    """Sends one message after the other, as fast as it is let."""

    sent = 0
    closed = False

    def flood(self, messages: list[bytes], stop: threading.Event) -> None:
        try:
            while not stop.is_set():
                for message in messages:
                    self.socket.send(message)
                self.sent += len(messages)
        except (ConnectionClosed, OSError):
            self.closed = not stop.is_set()


@contextmanager
def flooding(browser: Flooder, messages: list[bytes]) -> Iterator[None]:
    stop = threading.Event()
    threads = [
        threading.Thread(target=browser.flood, args=(messages, stop), daemon=True),
        threading.Thread(target=read_on, args=(browser,), daemon=True),
    ]
    for thread in threads:
        thread.start()
    try:
        yield
    finally:
        stop.set()
        browser.socket.socket.shutdown(socket.SHUT_RDWR)
        for thread in threads:
            thread.join(60)


def read_on(browser: Wire) -> None:
    try:
        while True:
            browser.socket.recv()
    except (ConnectionClosed, OSError):
        pass


def slide(browser: Wire, label: str) -> list[bytes]:
    uuid = browser.uuid(label)
    return [
        msgspec.msgpack.encode({"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": float(value)}})
        for value in range(1000)
    ]


def press(browser: Wire, command: str) -> list[bytes]:
    return [
        msgspec.msgpack.encode({"type": "CommandTriggerMessage", "uuid": browser.commands[command]})
    ] * 1000


@pytest.mark.soak
@pytest.mark.parametrize("what", ["slider", "command", "camera"])
def test_others_are_answered_while_one_floods(port, what):
    with Turner(port) as other, Flooder(port) as flooder:
        other.wait_for(ready)
        flooder.wait_for(ready)
        alone = turns(other)
        messages = {
            "slider": lambda: slide(flooder, "Rotation (°)"),
            "command": lambda: press(flooder, "Next roll"),
            "camera": lambda: [msgspec.msgpack.encode({"type": "NoMessage", "x": "x" * 200})] * 1000,
        }[what]()
        with flooding(flooder, messages):
            while flooder.sent < 5 * READ_BURST:
                turns(other, 1)
            during = turns(other)
            assert not flooder.closed  # it is slowed down, not sent away
        print(
            f"{what}: {flooder.sent} messages in the flood; a turn took {median(alone):.3f} s alone, "
            f"{median(during):.3f} s during it, {max(during):.3f} s at most"
        )


@pytest.mark.soak
@pytest.mark.thorough
def test_a_turn_is_answered_while_twenty_drag(port):
    """A turn needs no computing; those who drag get their maps in turn."""
    stop = threading.Event()
    shown = [0] * BROWSERS

    def drag(k: int, browser: Wire) -> None:
        x = 40.0 + k / 2
        while not stop.is_set():
            x = 40.0 + (x - 39.5) % 30.0
            before = picture(browser.html())
            browser.set("x (cm)", x)
            browser.wait_for_quiet(0.05)
            shown[k] += picture(browser.html()) != before

    with ExitStack() as stack:
        other = stack.enter_context(Turner(port))
        browsers = [stack.enter_context(Wire(port)) for _ in range(BROWSERS)]
        for browser in (other, *browsers):
            browser.wait_for(ready)
        alone = turns(other)
        threads = [threading.Thread(target=drag, args=pair, daemon=True) for pair in enumerate(browsers)]
        for thread in threads:
            thread.start()
        while not all(shown):  # everybody gets a map
            turns(other, 1)
        during = turns(other)
        print(
            f"a turn took {median(alone):.3f} s alone, {median(during):.3f} s while {BROWSERS} dragged, "
            f"{max(during):.3f} s at most; {len(processes())} processes; maps shown: {sorted(shown)}"
        )
        stop.set()
        for thread in threads:
            thread.join(60)


def test_the_browser_after_the_last_is_told_so():
    cache, port = SharedCache("bottle_on_table"), any_port()
    with open_lobby(cache, "127.0.0.1", port, 1), Wire(port) as browser:
        browser.wait_for(ready)
        with pytest.raises(Exception, match="503"), Wire(port):
            pass
        assert turns_of(browser)


def turns_of(browser: Wire) -> str:
    """Turn the object once, and return the map."""
    before = picture(browser.html())
    browser.set("Rotation (°)", 45.0)
    return picture(browser.wait_for(lambda html: picture(html) not in ("", before)))


def test_a_file_that_is_too_large_is_refused_when_it_is_announced(port):
    with Wire(port) as browser:
        browser.wait_for(ready)
        archives = {"Open a plan": 50, "Open a scene (YAML or ZIP)": 50, "Upload a robot": 50}
        for label, limit in {"Upload a mesh": 20, **archives}.items():
            browser.send(
                {
                    "type": "FileTransferStartUpload", "source_component_uuid": browser.uuid(label),
                    "transfer_uuid": label, "filename": f"large {limit}", "mime_type": "", "part_count": 1000,
                    "size_bytes": 1_000_000 * limit + 1,
                }
            )  # fmt: skip
            browser.wait_for(f"large {limit}: size of the file")
            browser.wait_for(f"expected a file of at most {limit} MB")
