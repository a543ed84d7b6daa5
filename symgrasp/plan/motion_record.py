"""The motion in a plan file: what every arm does between the grasps, segment by segment."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

__all__ = ["MotionRecord", "SegmentRecord"]

Finite = Annotated[float, Field(allow_inf_nan=False)]
Rows = tuple[tuple[Finite, ...], ...]

MOST_SEGMENTS = 10_000
"""Most segments of a motion."""


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class SegmentRecord(_Part):
    """A part of a motion in which the same arms move, at rest at both ends; straight between two rows."""

    kind: Literal["reach", "approach", "close", "lift", "carry", "lower", "open", "retreat", "home"]
    task_from: str = Field(description="the task at whose pose the object is at the start")
    task_to: str = Field(description="the same at the end; a lift or a carry may end above that pose")
    held_by: tuple[str, ...] = Field(
        description="arms in whose hands the object is fixed, not those that let go"
    )
    gripper: dict[str, tuple[Finite | None, Finite]] = Field(
        description="arm → opening (m) at the start, null for as at home, and at the end"
    )
    clearance: Finite = Field(
        description="smallest distance (m), beyond the margin, of bodies that move apart and may not touch; "
        "in a lift or lower, the object may touch what it rests on"
    )
    times: tuple[Finite, ...] = Field(description="s from the segment's start", min_length=2)
    joints: dict[str, Rows] = Field(
        description="arm → values (rad or m) of its joints at each time", min_length=1
    )
    velocities: dict[str, Rows] = Field(description="arm → their rates (rad/s or m/s): slopes of parabolas")

    @model_validator(mode="after")
    def _same_sizes(self) -> SegmentRecord:
        if self.velocities.keys() != self.joints.keys():
            raise ValueError("velocities of the arms that have joints")
        for rows in (*self.joints.values(), *self.velocities.values()):
            if len(rows) != len(self.times):
                raise ValueError(f"a row for each of {len(self.times)} times, not {len(rows)} rows")
        return self


class MotionRecord(_Part):
    """A motion. It begins with all robots at home, and ends there unless the object is to be held."""

    joint_names: dict[str, tuple[str, ...]] = Field(description="arm → names of its joints, base to tool")
    duration: Finite = Field(description="s")
    segments: Annotated[
        tuple[SegmentRecord, ...], Field(min_length=1, max_length=MOST_SEGMENTS, fail_fast=True)
    ]

    @model_validator(mode="after")
    def _same_widths(self) -> MotionRecord:
        for segment in self.segments:
            for arm, rows in [*segment.joints.items(), *segment.velocities.items()]:
                if arm not in self.joint_names:
                    raise ValueError(f"joint_names of {arm!r}")
                width = len(self.joint_names[arm])
                if any(len(row) != width for row in rows):
                    raise ValueError(f"rows of {width} values for {arm!r}")
            if unknown := [
                arm for arm in (*segment.gripper, *segment.held_by) if arm not in self.joint_names
            ]:
                raise ValueError(f"joint_names of {unknown[0]!r}")
        return self
