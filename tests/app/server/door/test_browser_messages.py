"""What a browser may send, and which files."""

from __future__ import annotations

import msgspec
import pytest
from viser import _messages

from app.server.door.browser_messages import MESSAGES, BrowserMessage, Misuse, UploadButton, Uploads

BUTTON = "button"


def message(kind: str, **fields: object) -> BrowserMessage:
    return BrowserMessage.decode(msgspec.msgpack.encode({"type": kind, **fields}))


def start(size: int, parts: int, transfer: str = "one", button: str = BUTTON) -> BrowserMessage:
    return message(
        "FileTransferStartUpload", source_component_uuid=button, transfer_uuid=transfer, filename="can.stl",
        mime_type="", size_bytes=size, part_count=parts,
    )  # fmt: skip


def part(index: int, content: bytes, transfer: str = "one") -> BrowserMessage:
    return message("FileTransferPart", transfer_uuid=transfer, part_index=index, content=content)


@pytest.fixture
def refused() -> list[tuple[str, int, str]]:
    return []


@pytest.fixture
def uploads(refused) -> Uploads:
    return Uploads({BUTTON: UploadButton(10, lambda *what: refused.append(what))})


def test_every_message_is_one_of_visers():
    assert all(hasattr(_messages, name) for name in MESSAGES)


@pytest.mark.parametrize("data", [b"", b"\xc1", b"\x80", "text", msgspec.msgpack.encode({"type": 1})])
def test_what_is_no_message_of_viser_is_misuse(data):
    with pytest.raises(Misuse):
        BrowserMessage.decode(data)


def test_values_have_keys_and_what_is_pressed_has_none():
    slider = message("GuiUpdateMessage", uuid="a", updates={"value": 1.5})
    assert slider.key == message("GuiUpdateMessage", uuid="a", updates={"value": 2}).key is not None
    assert slider.key != message("GuiUpdateMessage", uuid="b", updates={"value": 1.5}).key
    assert message("GuiUpdateMessage", uuid="a", updates={"value": True}).key is None
    assert message("GuiUpdateMessage", uuid="a", updates={"value": "Undo"}).key is None
    assert message("CommandTriggerMessage", uuid="a").key is None
    assert message("ViewerCameraMessage").key is not None
    drags = [message("TransformControlsUpdateMessage", name=name).key for name in "aab"]
    assert drags[0] == drags[1] != drags[2]


def test_a_file_passes_in_parts(uploads, refused):
    assert uploads.accepts(start(10, 2))
    assert uploads.accepts(part(0, b"12345"))
    assert uploads.accepts(part(1, b"67890"))
    assert uploads.accepts(start(0, 0, "empty"))
    assert uploads.accepts(start(1, 1, "next"))
    assert refused == []


def test_a_file_that_is_too_large_is_refused_when_it_is_announced_and_its_parts_are_dropped(uploads, refused):
    assert not uploads.accepts(start(11, 3))
    assert refused == [("can.stl", 11, "one")]
    assert not uploads.accepts(part(0, b"12345"))
    assert uploads.accepts(start(3, 1, "smaller"))


@pytest.mark.parametrize(
    "parts",
    [
        [part(0, b"12345678901")],  # more than announced
        [part(1, b"12345")],  # out of order
        [part(0, b"1"), part(0, b"1")],
        [part(0, b"")],
        [part(0, b"1"), part(1, b"2")],  # less than announced
    ],
)
def test_other_parts_than_announced_are_misuse(uploads, parts):
    uploads.accepts(start(10, 2))
    with pytest.raises(Misuse):
        for one in parts:
            uploads.accepts(one)


def test_what_the_server_would_have_to_keep_is_bounded(uploads):
    uploads.accepts(start(10, 2))
    with pytest.raises(Misuse):
        uploads.accepts(start(10, 2, "another"))
    with pytest.raises(Misuse):
        uploads.accepts(start(-1, 2))
    with pytest.raises(Misuse):
        uploads.accepts(start(1, 1, "third", button="a slider"))
