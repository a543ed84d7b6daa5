"""The patterns over the colours of cells, which tell them apart without colour; the page draws them."""

from __future__ import annotations

from symgrasp.feasibility.color_by import ColorBy
from symgrasp.reason import Reason

__all__ = ["PLAIN", "cell_patterns"]

PLAIN = ""
"""No pattern."""

_OF_REASONS = {
    Reason.HAND_TOO_SMALL: "upright",
    Reason.SURFACE_TOO_STEEP: "level",
    Reason.UNREACHABLE: "dots",
    Reason.NOT_FOUND: "rings",
    Reason.JOINT_LIMITS: "waves",
    Reason.OUT_OF_BALANCE: "zigzag",
    Reason.SELF_COLLISION: "crossed",
    Reason.OBJECT_COLLISION: "falling",
    Reason.SCENE_COLLISION: "rising",
    Reason.ROBOT_COLLISION: "squares",
    Reason.APPROACH_BLOCKED: "dashes",
    Reason.FEASIBLE: PLAIN,
}


def cell_patterns(color_by: ColorBy, *, lighter: bool = False) -> list[str]:
    """Return the names of the patterns of the first indices of a `ColoredMap`; any further index has none.

    Args:
        color_by: what its colours stand for.
        lighter: whether lighter colours for what is not proven follow, which have the same patterns.
    """
    if lighter and color_by in (ColorBy.REASON, ColorBy.FEASIBLE):
        return 2 * cell_patterns(color_by)
    if color_by is ColorBy.REASON:
        return [_OF_REASONS[reason] for reason in Reason]
    return ["rising", PLAIN]  # what is not feasible
