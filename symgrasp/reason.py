"""The reasons why a cell of a feasibility map is feasible or not."""

from __future__ import annotations

from enum import IntEnum

__all__ = ["Reason"]


class Reason(IntEnum):
    """The furthest stage of the checks that any candidate configuration of a cell reached, in their order.

    A candidate that passes all checks makes the cell `FEASIBLE`; otherwise the cell carries the check that
    its most successful candidate failed. Without a candidate it is `UNREACHABLE` where the inverse kinematics
    finds every configuration, and `NOT_FOUND` where it searches for them and may miss one.

    The numbers are in the order of the checks, and change when a reason is added: files name the reasons.
    """

    HAND_TOO_SMALL = 0
    SURFACE_TOO_STEEP = 1
    UNREACHABLE = 2
    NOT_FOUND = 3
    JOINT_LIMITS = 4
    OUT_OF_BALANCE = 5
    SELF_COLLISION = 6
    OBJECT_COLLISION = 7
    SCENE_COLLISION = 8
    ROBOT_COLLISION = 9
    APPROACH_BLOCKED = 10
    FEASIBLE = 11

    @property
    def label(self) -> str:
        """The reason in a few words."""
        return _LABELS[self]

    @property
    def legend(self) -> str:
        """The reason as legends have it, with what it rests on where that is no proof."""
        return f"{self.label} by the search, no proof" if self is Reason.NOT_FOUND else self.label

    @property
    def color(self) -> str:
        """Its colour on every map, as #rrggbb; colour-blind readers can tell the colours apart."""
        return _COLORS[self]


_LABELS = {
    Reason.HAND_TOO_SMALL: "hand too small",
    Reason.SURFACE_TOO_STEEP: "surface too steep",
    Reason.UNREACHABLE: "out of reach",
    Reason.NOT_FOUND: "not found",
    Reason.JOINT_LIMITS: "joint limits",
    Reason.OUT_OF_BALANCE: "out of balance",
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
    Reason.NOT_FOUND: "#c3a596",
    Reason.JOINT_LIMITS: "#b9a7d6",
    Reason.OUT_OF_BALANCE: "#9c18f0",
    Reason.SELF_COLLISION: "#3f007d",
    Reason.OBJECT_COLLISION: "#2171b5",
    Reason.SCENE_COLLISION: "#cb3b2c",
    Reason.ROBOT_COLLISION: "#f58518",
    Reason.APPROACH_BLOCKED: "#ffd24d",
    Reason.FEASIBLE: "#2ca25f",
}
