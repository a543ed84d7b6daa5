"""The reasons why a cell of a feasibility map is feasible or not."""

from __future__ import annotations

from enum import IntEnum

__all__ = ["Reason"]


class Reason(IntEnum):
    """The furthest stage of the checks that any candidate configuration of a cell reached, in their order.

    A candidate that passes all checks makes the cell `FEASIBLE`; otherwise the cell carries the check that
    its most successful candidate failed.
    """

    HAND_TOO_SMALL = 0
    SURFACE_TOO_STEEP = 1
    UNREACHABLE = 2
    JOINT_LIMITS = 3
    SELF_COLLISION = 4
    OBJECT_COLLISION = 5
    SCENE_COLLISION = 6
    ROBOT_COLLISION = 7
    APPROACH_BLOCKED = 8
    FEASIBLE = 9

    @property
    def label(self) -> str:
        """The reason in a few words."""
        return _LABELS[self]

    @property
    def color(self) -> str:
        """Its colour on every map, as #rrggbb; colour-blind readers can tell the colours apart."""
        return _COLORS[self]


_LABELS = {
    Reason.HAND_TOO_SMALL: "hand too small",
    Reason.SURFACE_TOO_STEEP: "surface too steep",
    Reason.UNREACHABLE: "out of reach",
    Reason.JOINT_LIMITS: "joint limits",
    Reason.SELF_COLLISION: "hits itself",
    Reason.OBJECT_COLLISION: "hits the object",
    Reason.SCENE_COLLISION: "hits an obstacle",
    Reason.ROBOT_COLLISION: "hits another robot",
    Reason.APPROACH_BLOCKED: "approach blocked",
    Reason.FEASIBLE: "feasible",
}

_COLORS = {
    Reason.HAND_TOO_SMALL: "#3b3b3b",
    Reason.SURFACE_TOO_STEEP: "#7f7f7f",
    Reason.UNREACHABLE: "#d4d4d4",
    Reason.JOINT_LIMITS: "#b9a7d6",
    Reason.SELF_COLLISION: "#6a3d9a",
    Reason.OBJECT_COLLISION: "#2171b5",
    Reason.SCENE_COLLISION: "#cb3b2c",
    Reason.ROBOT_COLLISION: "#f58518",
    Reason.APPROACH_BLOCKED: "#ffd24d",
    Reason.FEASIBLE: "#2ca25f",
}
