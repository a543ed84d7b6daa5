"""The ways of the tools in a plan's motion, as lines in the 3D view."""

from __future__ import annotations

import numpy as np
import viser

from symgrasp.motion.segments import Motion
from symgrasp.poses import Array

from ..render.clearance_colors import clearance_color
from ..state.state import State

__all__ = ["ToolPath", "tool_lines"]

MOST_LINES = 60
"""Most straight lines that the way of a tool in a segment is drawn with."""

THICKNESS = 0.004
"""Thickness (m) of the lines."""


class ToolPath:
    """The ways of all tools that move, in the colours of the clearances of their segments.

    Args:
        client: the browser.
        root: path of the node to add them under.
    """

    def __init__(self, client: viser.ClientHandle, root: str) -> None:
        self._client, self._name = client, f"{root}/tool_path"
        self._shown: Motion | None = None
        self._node: viser.SceneNodeHandle | None = None

    def show(self, state: State) -> None:
        """Show the ways of the motion that a state shows, or nothing."""
        plan = state.plan if state.step is not None else None
        motion = plan.motion if plan else None
        if motion is self._shown:
            return
        self._shown = motion
        if self._node:
            self._node.remove()
            self._node = None
        if motion:
            points, colors = tool_lines(motion)
            self._node = self._client.scene.add_line_segments(
                self._name, points, colors=colors, thickness=THICKNESS
            )


def tool_lines(motion: Motion) -> tuple[Array, np.ndarray]:
    """Return the ends (n, 2, 3) (m) of lines along the ways of all tools, and sRGB colours (n, 2, 3)."""
    points, colors = [], []
    for segment in motion.segments:
        if segment.kind in ("open", "close"):
            continue
        for name, path in segment.joints.items():
            rows = path[np.unique(np.linspace(0, len(path) - 1, MOST_LINES + 1).round().astype(int))]
            arm = motion.scene.arms[name]
            values = np.tile(arm.robot.home, (len(rows), 1))
            values[:, arm.indices] = rows
            at = arm.tool_at(values)[:, :3, 3]
            points.append(np.stack([at[:-1], at[1:]], axis=1))
            colors.append(np.tile(clearance_color(segment.clearance), (len(at) - 1, 2, 1)))
    return np.concatenate(points), np.concatenate(colors)
