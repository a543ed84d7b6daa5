"""Values on their way between this process and a child of it: what both know already is sent by number."""

from __future__ import annotations

import io
import pickle
from collections.abc import Iterator
from typing import Any, Protocol

from app.values import MapResult
from symgrasp.scene import Scene

__all__ = ["Line", "Pipe"]

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


class Line:
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

    def _enter(self, key: Key, thing: Any) -> None:
        self._things[key], self._keys[id(thing)] = thing, key
        if isinstance(thing, MapResult):
            self._passing.append(key)

    def _pack(self, thing: object, news: list[tuple[Key, bytes]], known: object = None) -> bytes:
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
        Packer(buffer, protocol=5).dump(thing)
        return buffer.getvalue()

    def _key(self, thing: object, news: list[tuple[Key, bytes]]) -> Key | None:
        """Return the number of a thing, a new one if it is worth keeping and was not sent before."""
        if (key := self._keys.get(id(thing))) is not None:
            return key
        if not isinstance(thing, (Scene, MapResult)):
            return None
        for part in _shared(thing):
            if id(part) not in self._keys:
                self._add(part, news)
        return self._add(thing, news)

    def _add(self, thing: object, news: list[tuple[Key, bytes]]) -> Key:
        content = self._pack(thing, news, thing)
        self._count += 1
        key = self._end, self._count
        news.append((key, content))
        self._enter(key, thing)
        return key

    def _unpack(self, content: bytes) -> Any:
        things = self._things

        class Unpacker(pickle.Unpickler):
            def persistent_load(self, pid: Any) -> Any:
                return things[pid]

        return Unpacker(io.BytesIO(content)).load()


def _shared(thing: Scene | MapResult) -> Iterator[object]:
    """Yield the parts that scenes share with scenes made from them, those that others refer to first."""
    if isinstance(thing, Scene):
        yield from thing.arms.values()
        yield from thing.robots.values()
        yield from (thing.robots, thing.arms, thing.obstacles, thing.profile, thing.settings)
