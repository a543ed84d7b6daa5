"""Websockets as browsers open them."""

from __future__ import annotations

import viser
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin, Subprotocol

PROTOCOL = Subprotocol(f"viser-v{viser.__version__}")
WAIT = 30.0


def own(port: int) -> ClientConnection:
    """A websocket from a page of this server."""
    origin = Origin(f"http://127.0.0.1:{port}")
    return connect(f"ws://127.0.0.1:{port}", origin=origin, subprotocols=[PROTOCOL], open_timeout=WAIT)
