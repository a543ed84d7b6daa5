"""Where all robots and the object are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from symgrasp.poses import Array
from symgrasp.robot.robot import Arm

__all__ = ["State"]


@dataclass(frozen=True, eq=False)
class State:
    """Where everything is.

    Attributes:
        values: robot → values (N,) of all its joints.
        T_world_object: pose (4, 4) of the object.
    """

    values: Mapping[str, Array]
    T_world_object: Array

    def with_arm(self, arm: Arm, q: Array, opening: float | None = None) -> State:
        """Return the state with an arm at joint values (dof,), and its hand at an opening (m) if given."""
        values = self.values[arm.robot.name].copy()
        values[arm.indices] = q
        for joint, value in (arm.hand.joint_values(opening) if opening is not None else {}).items():
            values[arm.robot.model.joint_names.index(joint)] = value
        return State({**self.values, arm.robot.name: values}, self.T_world_object)

    def with_object(self, T_world_object: Array) -> State:
        """Return the state with the object at a pose (4, 4)."""
        return State(self.values, T_world_object)

    def joints(self, arm: Arm) -> Array:
        """Return the joint values (dof,) of an arm."""
        return self.values[arm.robot.name][arm.indices]

    def tool(self, arm: Arm) -> Array:
        """Return ``T_world_tool`` (4, 4) of an arm."""
        return arm.tool_at(self.values[arm.robot.name])
