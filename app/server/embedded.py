"""The live page inside a notebook, by a server in the notebook's own process."""

from __future__ import annotations

import atexit
import secrets
import tempfile
import threading
import warnings
from contextlib import ExitStack
from pathlib import Path

from symgrasp.page import LivePage
from symgrasp.scene.scene import Scene

from ..compute.cache import SharedCache
from ..files.links import Link
from ..files.scene_files import scene_yaml
from ..state.state import State
from .door.lobby import open_lobby
from .door.origins import EMBEDDED
from .door.viser_server import any_port

__all__ = ["live_page"]

HOST = "127.0.0.1"

_lock = threading.Lock()
_open: dict[str, tuple[str, str]] = {}
"""The file of a scene → the address of its server, and the key with which it may be shown in a frame."""

_servers = ExitStack()
atexit.register(_servers.close)


def live_page(state: State) -> LivePage:
    """Return the address of a page that opens with a state; a server is started for a scene seen first.

    It listens on 127.0.0.1 until this process ends. Only whoever knows its key may show it in a frame.

    Args:
        state: what to show: its scene, task, arm, poses and turn.

    Raises:
        InputError: the scene cannot be written into a file, or what is shown not into an address.
        OSError: the server cannot be started.
    """
    address, key = _server(state.scene)
    query = Link.of(state, state.scene).model_copy(update={"scene": None}).query()
    settings = "&".join(filter(None, [query, f"{EMBEDDED}={key}"]))
    return LivePage(f"{address}/?{settings}", f"{address}/{EMBEDDED}/{key}")


def _server(scene: Scene) -> tuple[str, str]:
    """Return the address of a scene's server, and its key."""
    text = scene_yaml(scene)
    with _lock:
        if text not in _open:
            folder = _servers.enter_context(tempfile.TemporaryDirectory(prefix="symgrasp_"))
            path = Path(folder, "scene.yaml")
            path.write_text(text, encoding="utf-8")
            # A browser may disconnect while something is drawn for it.
            warnings.filterwarnings("ignore", message="Queued a .* on a closed connection")
            port, key = any_port(), secrets.token_urlsafe(24)
            _servers.enter_context(open_lobby(SharedCache(str(path)), HOST, port, key=key))
            _open[text] = f"http://{HOST}:{port}", key
        return _open[text]
