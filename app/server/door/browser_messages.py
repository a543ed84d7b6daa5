"""What a browser may send to viser, and what each message means for the server."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import msgspec

__all__ = ["MESSAGES", "BrowserMessage", "Misuse", "UploadButton", "Uploads"]

MESSAGES = frozenset(
    {
        "CommandTriggerMessage", "FileTransferPart", "FileTransferStartUpload", "GuiUpdateMessage",
        "SceneNodeClickMessage", "TransformControlsDragEndMessage", "TransformControlsDragStartMessage",
        "TransformControlsUpdateMessage", "ViewerCameraMessage",
    }
)  # fmt: skip
"""The messages that the page's own widgets send.

viser understands more than these. Some of them reach all browsers, and one opens a tunnel through which
anybody on the internet may come in.
"""


class Misuse(Exception):
    """A browser sent what no page of this server sends."""


class BrowserMessage(msgspec.Struct):
    """The fields of a message from a browser that decide how it is treated; see `viser._messages`."""

    type: str
    uuid: str = ""
    name: str = ""
    updates: dict[str, Any] = {}
    source_component_uuid: str | None = None
    transfer_uuid: str = ""
    filename: str = ""
    size_bytes: float = 0
    part_count: int = 0
    part_index: int = 0
    content: bytes = b""

    @staticmethod
    def decode(data: bytes | str) -> BrowserMessage:
        """Decode a message.

        Raises:
            Misuse: it is none of viser's.
        """
        try:
            return _decoder.decode(data if isinstance(data, bytes) else b"")
        except msgspec.MsgspecError as error:
            raise Misuse(str(error)) from error

    @property
    def key(self) -> str | None:
        """Key of the value that the message carries and a later message replaces; None for an event.

        Only numbers are such values: of buttons, and of what else is chosen, every press counts.
        """
        if self.type == "ViewerCameraMessage":
            return self.type
        if self.type == "TransformControlsUpdateMessage":
            return f"{self.type} {self.name}"
        if self.type == "GuiUpdateMessage" and list(self.updates) == ["value"]:
            value = self.updates["value"]
            if isinstance(value, (int, float)) and not isinstance(value, bool):
                return f"{self.type} {self.uuid}"
        return None


_decoder = msgspec.msgpack.Decoder(BrowserMessage)


@dataclass(frozen=True)
class UploadButton:
    """A button of a page to upload a file.

    Attributes:
        limit: largest file (bytes) that it takes.
        refuse: called with the name and size (bytes) of a larger one, and with the id of its transfer.
    """

    limit: int
    refuse: Callable[[str, int, str], None]


class Uploads:
    """The files that one browser is sending, each through a button and with the size it was announced with.

    Args:
        buttons: uuid → button; may grow.
    """

    def __init__(self, buttons: Mapping[str, UploadButton]) -> None:
        self._buttons = buttons
        self._open: dict[str, _Transfer] = {}

    def accepts(self, message: BrowserMessage) -> bool:
        """Return whether a message about an upload is to be passed on; a file that is too large is refused.

        Raises:
            Misuse: no browser sends this: another size than announced, or two files at once.
        """
        if message.type == "FileTransferStartUpload":
            return self._starts(message)
        transfer = self._open.get(message.transfer_uuid)
        if transfer is None:
            return False  # of a file that was refused
        transfer.add(message)
        if transfer.is_complete:
            del self._open[message.transfer_uuid]
        return True

    def _starts(self, message: BrowserMessage) -> bool:
        uuid, size = message.source_component_uuid or "", int(message.size_bytes)
        button = self._buttons.get(uuid)
        if button is None:
            raise Misuse("a file for something that takes none")
        if size > button.limit:
            button.refuse(message.filename, size, message.transfer_uuid)
            return False
        sending = {transfer.uuid for transfer in self._open.values()}
        if size < 0 or message.transfer_uuid in self._open or uuid in sending:
            raise Misuse("two files at once")
        if message.part_count:
            self._open[message.transfer_uuid] = _Transfer(uuid, size, message.part_count)
        return True


@dataclass
class _Transfer:
    """A file of which parts are still to come: bytes and parts that are missing."""

    uuid: str
    size: int
    parts: int
    received: int = 0

    @property
    def is_complete(self) -> bool:
        return self.received == self.parts

    def add(self, message: BrowserMessage) -> None:
        """Count a part; they come in order."""
        self.size -= len(message.content)
        if self.size < 0 or message.part_index != self.received or not message.content:
            raise Misuse("parts of a file that are not as announced")
        self.received += 1
        if self.is_complete and self.size:
            raise Misuse("a file smaller than announced")
