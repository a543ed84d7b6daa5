"""A page being served to visitors without browsers, and what is read in what they are sent."""

from __future__ import annotations

import multiprocessing
import os
import re
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from html import unescape
from multiprocessing.connection import wait

from app.compute.cache import SharedCache
from app.compute.warm_up import compute_first_map
from app.server.door.lobby import Lobby, open_lobby
from app.server.door.viser_server import any_port
from tests.app.wire import WAIT, Wire


@dataclass
class Server:
    """The page being served: its maps, its lobby and the port of its front door."""

    cache: SharedCache
    lobby: Lobby
    port: int

    def visit(self, query: str = "") -> Wire:
        return Wire(self.port, query)

    def wait_until_empty(self) -> None:
        """Wait until every session has been closed, with its threads."""
        for thread in threading.enumerate():
            if thread.name.startswith(("jobs", "draw")):
                thread.join(30)
        assert self.lobby.wait_until_empty(30)


@contextmanager
def start_server(scene: str = "bottle_on_table") -> Iterator[Server]:
    cache = SharedCache(scene)
    compute_first_map(cache)
    port = any_port()
    with open_lobby(cache, "127.0.0.1", port) as lobby:
        yield Server(cache, lobby, port)


def picture(html: str) -> str:
    """The map that is shown, as it is sent."""
    found = re.search(r'<img alt="map" src="([^"]+)"', html)
    return found[1] if found else ""


def ready(html: str) -> bool:
    """Whether the newest map is shown and nothing is being done."""
    outdated = "earlier pose" in html or "preliminary" in html
    return bool(picture(html)) and "Ready." in html and not outdated


def entered(visitor: Wire, label: str) -> list[object]:
    """What stands in the inputs of that label."""
    return [w["value"] for w in visitor.widgets.values() if w.get("label") == label]


def processes() -> list[int]:
    """The processes that compute for somebody, or are kept for it, oldest first."""
    return sorted(process.pid or 0 for process in multiprocessing.active_children())


def signal_processes(number: int) -> None:
    for pid in processes():
        os.kill(pid, number)


def kill_processes() -> None:
    """Kill them all, and wait until that can be known: the spare one must not be taken for alive."""
    ends = [os.dup(process.sentinel) for process in multiprocessing.active_children()]
    signal_processes(signal.SIGKILL)
    for end in ends:
        assert wait([end], timeout=WAIT)
        os.close(end)


def wait_until_alike(one: Wire, other: Wire, *parts: Callable[[str], str]) -> None:
    """Read on until both show the same: each part comes when it is drawn, the map for itself."""
    end = time.monotonic() + WAIT
    while differing := [part.__name__ for part in parts if part(one.html()) != part(other.html())]:
        assert time.monotonic() < end, f"{differing} differ"
        one.wait_for_quiet(0.1)
        other.wait_for_quiet(0.1)


def link_in(html: str) -> str:
    """What stands behind the ? of the link that was made."""
    return unescape(re.findall(r'class="sg-link" href="[^"?]*\?([^"]*)"', html)[-1])


def tasks(html: str) -> str:
    """Return the list of tasks, nothing where it has not come yet."""
    return "".join(re.findall(r'<div class="sg sg-tasks">(.*?)</small></div>', html))


def title(html: str) -> str:
    return re.findall(r"<h1>(.*?)</h1>", html)[0]


def legend(html: str) -> str:
    return re.findall(r"<ul>(.*?)</ul>", html)[-1]
