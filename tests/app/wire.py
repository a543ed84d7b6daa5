"""A browser without a browser: speaks the page's own protocol, so that many may come and go."""

from __future__ import annotations

import http.client
import re
import secrets
import time
from collections.abc import Callable
from contextlib import suppress
from html import escape
from types import TracebackType
from typing import Any, Self

import msgspec
import viser
import zstandard
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin, Subprotocol

from app.server.door.front_door import HELLO, MAP
from app.server.door.origins import PAGE
from tests.app.shown_map import ShownMap

WAIT = 60.0

PAUSE = 0.02
"""How long (s) one connection is waited for before the other is looked at."""

CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": (1.0, 0.0, 0.0, 0.0), "position": (1.5, 1.5, 1.0), "fov": 0.7,
    "near": 0.01, "far": 100.0, "image_height": 800, "image_width": 1280, "look_at": (0.0, 0.0, 0.0),
    "up_direction": (0.0, 0.0, 1.0),
}  # fmt: skip


class Wire:
    """One visitor; comes in at the front door and keeps what it is shown.

    Attributes:
        widgets: uuid → the properties of everything in the panels.
        commands: label → uuid of the commands in the palette.
        socket: the connection.
        map: what it is shown of the map.
        map_socket: the connection for that; None before it has its session.
        token: of its page; a new one unless it is given.
        before: that of the page that it continues.
    """

    def __init__(self, port: int, query: str = "", token: str = "", before: str = "") -> None:
        self.port, self.query, self.before = port, query, before
        self.widgets: dict[str, dict[str, Any]] = {}
        self.commands: dict[str, str] = {}
        self.map, self.map_socket = ShownMap(), None
        self.token = token or secrets.token_urlsafe(24)
        self.socket = connect(
            f"ws://127.0.0.1:{port}",
            origin=Origin(f"http://127.0.0.1:{port}"),
            subprotocols=[Subprotocol(f"viser-v{viser.__version__}")],
            max_size=None,
            open_timeout=WAIT,
        )
        self.send(CAMERA)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.socket.close()
        if self.map_socket:
            self.map_socket.close()

    def html(self) -> str:
        """Everything that is written in the panels and around the map, and the map as a picture."""
        written = [w["content"] for w in self.widgets.values() if isinstance(w.get("content"), str)]
        if self.map.digest:
            written.append(f'<img alt="map" src="{self.map.digest}">')
        written.append(f"<h1>{escape(self.map.title)}</h1><ul>{escape('; '.join(self.map.legend))}</ul>")
        return "\n".join(written)

    def wait_for(self, text: str | Callable[[str], bool]) -> str:
        """Read on until the panels say so; return what they say."""
        right = text if callable(text) else lambda html: text in html
        while not right(html := self.html()):
            self._read()
        return html

    def wait_for_quiet(self, seconds: float = 0.5) -> str:
        """Read on until nothing has come for so long: clicks are answered in any order."""
        with suppress(TimeoutError):
            while True:
                self._read(seconds)
        return self.html()

    def set(self, label: str, value: Any) -> None:
        """Change a widget as a person does, once it is there."""
        while not (found := [uuid for uuid, w in self.widgets.items() if _is_input(w, label)]):
            self._read()
        uuid = found[0]
        self.widgets[uuid]["value"] = value  # what the page sends for an instant before, it sends no more
        self.send({"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": value}})

    def uuid(self, label: str) -> str:
        """The uuid of the widget of that label, once it is there: the last may come after the first map."""
        while not (found := [uuid for uuid, w in self.widgets.items() if w.get("label") == label]):
            self._read()
        return found[0]

    def look_from(self, x: float, y: float, z: float) -> None:
        """Move the camera."""
        self.send({**CAMERA, "position": (x, y, z)})

    def trigger(self, command: str) -> None:
        """Choose a command in the palette, once it is there."""
        while command not in self.commands:
            self._read()
        self.send({"type": "CommandTriggerMessage", "uuid": self.commands[command]})

    def send(self, message: dict[str, Any]) -> None:
        """Send a message of viser's protocol."""
        self.socket.send(msgspec.msgpack.encode(message))

    def _read(self, timeout: float = WAIT) -> None:
        """Take the next message for the panels or for the map."""
        deadline = time.monotonic() + timeout
        while time.monotonic() < deadline:
            with suppress(TimeoutError, ConnectionClosed):
                if self.map_socket:
                    message = self.map_socket.recv(0)
                    assert isinstance(message, bytes)
                    self.map.take(message)
                    return
            with suppress(TimeoutError):
                self._take_all(self.socket.recv(PAUSE))
                return
        raise TimeoutError

    def _take_all(self, data: str | bytes) -> None:
        assert isinstance(data, bytes)
        size = int.from_bytes(data[8:16], "little")
        inner = zstandard.ZstdDecompressor().decompress(data[16 : 16 + size])
        for message in msgspec.msgpack.decode(inner)["messages"]:
            self._take(message)

    def _take(self, message: dict[str, Any]) -> None:
        kind = message["type"]
        if kind == "RegisterCommandMessage":
            self.commands[message["props"]["label"]] = message["uuid"]
        elif kind == "GuiUpdateMessage":
            if message["uuid"] in self.widgets:
                self.widgets[message["uuid"]].update(message["updates"])
        elif kind == "GuiRemoveMessage":
            self.widgets.pop(message["uuid"], None)
        elif kind.startswith("Gui") and "props" in message and "uuid" in message:
            self.widgets[message["uuid"]] = {"value": message.get("value"), **message["props"]}
            if found := re.search(rf'src="({HELLO}[^"]+)"', str(message["props"].get("content"))):
                self.greet(found[1])

    def greet(self, path: str) -> None:
        tokens = f"{self.token}.{self.before}" if self.before else self.token
        settings = [setting for setting in (self.query, f"{PAGE}={tokens}") if setting]
        page = f"http://127.0.0.1:{self.port}/?{'&'.join(settings)}"
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=WAIT)
        connection.request("GET", path, headers={"Referer": page})
        assert connection.getresponse().status == 200
        connection.close()
        self.map_socket = self.open_map()

    def open_map(self, token: str | None = None) -> ClientConnection:
        """Open the websocket of the map, by default that of this visitor's page."""
        return connect(
            f"ws://127.0.0.1:{self.port}{MAP}{token or self.token}",
            origin=Origin(f"http://127.0.0.1:{self.port}"),
            compression=None,
            max_size=None,
            open_timeout=WAIT,
        )


def _is_input(widget: dict[str, Any], label: str) -> bool:
    """Return whether a widget has that label and a value; folders have none."""
    return widget.get("label") == label and widget["value"] is not None
