"""Values on their way between this process and a child of it: what both know already is sent by number."""

from __future__ import annotations

import io
import pickle
from collections.abc import Iterator
from typing import Any, Protocol

from app.state.requests import MapResult
from symgrasp.scene.scene import Scene

__all__ = ["Channel", "Pipe"]

Key = tuple[str, int]
"""Which end numbered a thing, and its number there."""


class Pipe(Protocol):
    """What a line needs of a connection, as `multiprocessing` makes them."""

    def send_bytes(self, buf: bytes, /) -> None:
        """Send a message."""

    def recv_bytes(self) -> bytes:
        """Wait for a message."""
        ...

    def poll(self, timeout: float | None = 0.0, /) -> bool:
        """Wait for a message for so long (s); return whether there is one, or the end."""
        ...

    def close(self) -> None:
        """Hang up."""


class Channel:
    """One end of a connection; used by one thread at a time.

    Scenes and the parts that they share cross once, so that what is the same object on one side is
    the same object on the other: physics worlds and maps are kept by identity. So do computed maps
    within one errand. Arrays that cannot be written to arrive as such.

    Both ends must belong to one program: what arrives is unpickled.

    Args:
        connection: to the other end.
        end: name of this end.
    """

    def __init__(self, connection: Pipe, end: str) -> None:
        self.connection = connection
        self._end, self._count = end, 0
        self._things: dict[Key, Any] = {}
        self._keys: dict[int, Key] = {}
        self._passing: list[Key] = []

    @property
    def known(self) -> int:
        """How many things both ends keep for each other."""
        return len(self._things)

    def forget_maps(self) -> None:
        """Keep the maps of the last errand no longer; the other end must do so between the same messages."""
        for key in self._passing:
            del self._keys[id(self._things.pop(key))]
        self._passing.clear()

    def send(self, message: object) -> None:
        """Send a message.

        Raises:
            OSError: the other end is gone.
        """
        news: list[tuple[Key, bytes]] = []
        body = self._pack(message, news)
        self.connection.send_bytes(pickle.dumps((news, body), protocol=5))

    def receive(self) -> Any:
        """Wait for a message.

        Raises:
            EOFError, OSError: the other end is gone.
        """
        news, body = pickle.loads(self.connection.recv_bytes())
        for key, content in news:
            self._enter(key, self._unpack(content))
        return self._unpack(body)

    def _enter(self, key: Key, object_choice: Any) -> None:
        self._things[key], self._keys[id(object_choice)] = object_choice, key
        if isinstance(object_choice, MapResult):
            self._passing.append(key)

    def _pack(self, object_choice: object, news: list[tuple[Key, bytes]], known: object = None) -> bytes:
        """Pickle a thing, after what it refers to that is worth keeping.

        Args:
            thing: the thing.
            news: what the other end does not know yet is added here, what others refer to first.
            known: not to be replaced by its number, as it is what the number will stand for.
        """
        line = self

        class Packer(pickle.Pickler):
            def persistent_id(self, obj: Any) -> Key | None:
                return None if obj is known else line._key(obj, news)

        buffer = io.BytesIO()
        Packer(buffer, protocol=5).dump(object_choice)
        return buffer.getvalue()

    def _key(self, object_choice: object, news: list[tuple[Key, bytes]]) -> Key | None:
        """Return the number of a thing, a new one if it is worth keeping and was not sent before."""
        if (key := self._keys.get(id(object_choice))) is not None:
            return key
        if not isinstance(object_choice, (Scene, MapResult)):
            return None
        for part in _shared(object_choice):
            if id(part) not in self._keys:
                self._add(part, news)
        return self._add(object_choice, news)

    def _add(self, object_choice: object, news: list[tuple[Key, bytes]]) -> Key:
        content = self._pack(object_choice, news, object_choice)
        self._count += 1
        key = self._end, self._count
        news.append((key, content))
        self._enter(key, object_choice)
        return key

    def _unpack(self, content: bytes) -> Any:
        things = self._things

        class Unpacker(pickle.Unpickler):
            def persistent_load(self, pid: Any) -> Any:
                return things[pid]

        return Unpacker(io.BytesIO(content)).load()


def _shared(object_choice: Scene | MapResult) -> Iterator[object]:
    """Yield the parts that scenes share with scenes made from them, those that others refer to first."""
    if isinstance(object_choice, Scene):
        yield from object_choice.arms.values()
        yield from object_choice.robots.values()
        yield from (
            object_choice.robots,
            object_choice.arms,
            object_choice.obstacles,
            object_choice.profile,
            object_choice.settings,
        )
