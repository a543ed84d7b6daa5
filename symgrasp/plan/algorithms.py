"""The kinds of plans, and the algorithms that make them."""

from __future__ import annotations

from collections.abc import Mapping

__all__ = ["ALGORITHMS"]

ALGORITHMS: Mapping[str, tuple[str, ...]] = {
    "sequential": ("best", "first", "regrasp"),
    "bimanual": ("exact", "hill_climb"),
    "handover": ("exact",),
}
"""Kind of plan → the algorithms that make it, the default first."""
