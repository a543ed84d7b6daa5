"""The server's main function."""

from __future__ import annotations

import errno
import socket
import threading
import warnings

from symgrasp.errors import InputError
from symgrasp.feasibility.creation.coarse import is_map_compiled

from ..compute.cache import SharedCache
from ..compute.warm_up import compute_first_map
from .door.lobby import open_lobby
from .kept_pages.stored_pages import stored_pages_folder
from .session.tour import STORY

__all__ = ["serve"]

SIGNAL_INTERVAL = 0.5
"""Time (s) after which Ctrl-C is noticed at the latest: the system may hand the signal to any thread, but
only the main thread acts on it, once it runs."""


def serve(scene: str | None, host: str, port: int, max_sessions: int = 16) -> None:
    """Serve the page until interrupted; the address is printed once it listens.

    Args:
        scene: the scene to open with, a shipped name or a file; None for `STORY`, with the arm at a grasp.
        host: address to listen on.
        port: port to listen on; never another one.
        max_sessions: how many browsers may use it at the same time.

    Raises:
        InputError: the scene is unusable, the port is not free, or no browser may use it.
    """
    if max_sessions < 1:
        raise InputError("command line", "--max-sessions", max_sessions, "a whole number of at least 1")
    _check_free(host, port)
    cache = _warm_cache(scene)
    # A browser may disconnect while something is drawn for it.
    warnings.filterwarnings("ignore", message="Queued a .* on a closed connection")
    try:
        with open_lobby(cache, host, port, max_sessions, stored_pages_folder()):
            shown = f"[{host}]" if ":" in host else host
            print(f"symgrasp: http://{shown}:{port}", flush=True)
            forever = threading.Event()
            while not forever.wait(SIGNAL_INTERVAL):
                pass
    except OSError as error:  # the port was taken since the check
        raise _busy(port, (error.strerror or str(error)).lower()) from error
    except KeyboardInterrupt:
        print("\nsymgrasp: stopped", flush=True)


def _warm_cache(scene: str | None) -> SharedCache:
    """Return the cache with the first map in it, so that the page opens with its map.

    Where code has to be compiled for it, the page is there sooner, and begins with a coarse map.
    """
    cache = SharedCache(scene or STORY, holds_first=scene is None)
    first = cache.scene(cache.first)
    if is_map_compiled(first, first.arm(first.task().arms[0])):
        compute_first_map(cache)
    return cache


def _check_free(host: str, port: int) -> None:
    if not 0 < port < 65536:
        raise InputError("command line", "--port", port, "a port from 1 to 65535")
    try:
        family, kind, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
    except (socket.gaierror, UnicodeError) as error:
        raise InputError("command line", "--host", host, "an address of this machine") from error
    with socket.socket(family, kind) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(address)
        except OSError as error:
            if error.errno == errno.EADDRNOTAVAIL:
                raise InputError("command line", "--host", host, "an address of this machine") from error
            raise _busy(port, (error.strerror or str(error)).lower()) from error


def _busy(port: int, reason: str) -> InputError:
    return InputError("command line", "--port", port, f"a free port ({reason}); choose another with --port")
