"""A browser without a browser: speaks the page's own protocol, so that many may come and go."""

from __future__ import annotations

import http.client
import re
from collections.abc import Callable
from contextlib import suppress
from types import TracebackType
from typing import Any, Self

import msgspec
import viser
import zstandard
from websockets.sync.client import connect
from websockets.typing import Origin, Subprotocol

from app.server.front_door import HELLO

WAIT = 60.0

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
    """

    def __init__(self, port: int, query: str = "") -> None:
        self.port, self.query = port, query
        self.widgets: dict[str, dict[str, Any]] = {}
        self.commands: dict[str, str] = {}
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

    def html(self) -> str:
        """Everything that is written in the panels."""
        return "\n".join(w["content"] for w in self.widgets.values() if isinstance(w.get("content"), str))

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
        data = self.socket.recv(timeout)
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
        page = f"http://127.0.0.1:{self.port}/" + (f"?{self.query}" if self.query else "")
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=WAIT)
        connection.request("GET", path, headers={"Referer": page})
        assert connection.getresponse().status == 200
        connection.close()


def _is_input(widget: dict[str, Any], label: str) -> bool:
    """Return whether a widget has that label and a value; folders have none."""
    return widget.get("label") == label and widget["value"] is not None
