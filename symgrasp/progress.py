"""The type of the callbacks that long computations report their progress to."""

from __future__ import annotations

from collections.abc import Callable

__all__ = ["Progress"]

Progress = Callable[[float], None]
"""Called with the finished share (0 to 1) of a computation; may raise `Cancelled` to stop it."""
