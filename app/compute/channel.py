"""Messages between the server and a process that computes for it.

Messages are pickled, as both ends belong to one program. Read-only arrays stay read-only.
"""

from __future__ import annotations

import pickle
from dataclasses import dataclass
from typing import Any, Protocol

from symgrasp.feasibility.map import FeasibilityMap

__all__ = [
    "Call",
    "Cancel",
    "Channel",
    "Compiling",
    "ComputedMap",
    "Failure",
    "Part",
    "Pipe",
    "ProgressReport",
    "Result",
]


@dataclass(frozen=True)
class Call:
    """To the process: call a method of its services.

    Attributes:
        job_id: by which a `Cancel` refers to the call.
        method: its name.
        args: its arguments, besides the progress.
        cores: how many cores it may use.
    """

    job_id: int
    method: str
    args: tuple[Any, ...]
    cores: int


@dataclass(frozen=True)
class Cancel:
    """To the process: end the call of that job id with `Cancelled`."""

    job_id: int


@dataclass(frozen=True)
class ProgressReport:
    """From the process: the finished share of the call."""

    share: float


@dataclass(frozen=True)
class Compiling:
    """From the process: it compiles code that is not in the cache of this machine."""


@dataclass(frozen=True, eq=False)
class ComputedMap:
    """From the process: a map is computed; see `MapResult`, whose request the server knows."""

    map: FeasibilityMap
    contacts: tuple[str, ...]
    preliminary: bool


@dataclass(frozen=True, eq=False)
class Part:
    """From the process: what the call has found so far."""

    value: Any


@dataclass(frozen=True, eq=False)
class Result:
    """From the process: the call returned a value."""

    value: Any


@dataclass(frozen=True, eq=False)
class Failure:
    """From the process: the call raised an error."""

    error: Exception


class Pipe(Protocol):
    """The interface of a `multiprocessing` connection that a channel uses."""

    def send_bytes(self, buf: bytes, /) -> None:
        """Send a message."""

    def recv_bytes(self) -> bytes:
        """Wait for a message and return it."""
        ...

    def poll(self, timeout: float | None = 0.0, /) -> bool:
        """Wait at most a timeout (s); return whether there is a message or the other end is closed."""
        ...

    def close(self) -> None:
        """Close the connection."""


class Channel:
    """One end of a connection; used by one thread at a time.

    Args:
        pipe: to the other end.
    """

    def __init__(self, pipe: Pipe) -> None:
        self._pipe = pipe

    def send(self, message: object) -> None:
        """Send a message.

        Raises:
            OSError: the other end is closed.
        """
        self._pipe.send_bytes(pickle.dumps(message, protocol=5))

    def receive(self) -> Any:
        """Wait for a message and return it.

        Raises:
            EOFError, OSError: the other end is closed.
        """
        return pickle.loads(self._pipe.recv_bytes())

    def poll(self, timeout: float = 0.0) -> bool:
        """Wait at most a timeout (s); return whether there is a message or the other end is closed."""
        return self._pipe.poll(timeout)

    def close(self) -> None:
        """Close the connection."""
        self._pipe.close()
