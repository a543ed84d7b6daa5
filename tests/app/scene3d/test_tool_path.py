"""The line of a tool in space has the colour of the clearance of each segment, where that segment is."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np

from app.render.clearance_colors import CLEAR, clearance_color
from app.scene3d.tool_path import MOST_LINES, tool_lines
from tests.motion.recorded import recorded_motion


def test_lines_follow_the_tool_in_the_colour_of_the_clearance_of_their_segment():
    motion = recorded_motion()
    points, colors = tool_lines(motion)
    assert len(points) == len(colors)
    at, told = 0, set()
    for segment in motion.segments:
        if segment.kind in ("open", "close"):
            continue
        for name, path in segment.joints.items():
            arm = motion.scene.arms[name]
            ends = []
            for q in (path[0], path[-1]):
                values = arm.robot.home.copy()
                values[arm.indices] = q
                pose = arm.robot.T_world_base @ arm.robot.model.forward(values)
                ends.append(pose[arm.robot.model.link_index(arm.tool)][:3, 3])
            count = min(len(np.unique(np.linspace(0, len(path) - 1, MOST_LINES + 1).round())) - 1, len(path))
            assert np.allclose(points[at, 0], ends[0])
            assert np.allclose(points[at + count - 1, 1], ends[1])
            # Yellow (0.9 of plasma) at no clearance, its dark end from CLEAR on, straight in between.
            share = 0.9 - 0.9 * min(segment.clearance, CLEAR) / CLEAR
            expected = 255 * np.array(mpl.colormaps["plasma"](share)[:3])
            assert np.abs(colors[at : at + count] - expected).max() <= 1
            told.add(round(segment.clearance, 6))
            at += count
    assert at == len(points)
    assert len(told) > 2  # so a line in the colour of another segment would be found


def test_smaller_clearances_are_lighter():
    weights = np.array([0.2126, 0.7152, 0.0722])  # of sRGB channels, roughly the luminance
    light = [float(weights @ clearance_color(c)) for c in np.linspace(0.0, CLEAR, 7)]
    assert light == sorted(light, reverse=True)
    assert len(set(light)) == len(light)
    assert np.array_equal(clearance_color(CLEAR), clearance_color(1.0))
