"""How long computations report progress and are cancelled."""

from __future__ import annotations

from collections.abc import Callable

__all__ = ["Progress"]

Progress = Callable[[float], None]
"""Called with the finished share (0 to 1) of a long computation; may raise `Cancelled` to stop it."""
