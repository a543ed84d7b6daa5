"""Draws the motions of plans as strips of pictures, to look at them: ``python -m docs.strips plan.json …``.

Each strip is written beside its plan, as PNG. The pictures are spread evenly over the segments of a motion.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from docs.figures.models import floor, object_body, obstacles, robot
from docs.figures.render import Camera, render
from symgrasp.motion.record import from_plan
from symgrasp.motion.segments import Motion
from symgrasp.plan.plan import Plan
from symgrasp.poses import Array
from symgrasp.scene.scene import Scene

__all__ = ["main", "strip"]

PICTURES = 8
SIZE = (400, 300)
COLUMNS = 4
COLOR = np.array([60, 120, 160]) / 255


def strip(plan: Plan, azimuth: float = -50.0) -> Image.Image:
    """Return pictures of the motion of a plan, each with its time and the kind of its segment.

    Args:
        plan: a plan with a motion.
        azimuth: direction (degrees) from the middle of the scene to the camera, about the vertical.
    """
    scene = Scene.from_content(plan.scene.content)
    motion = from_plan(plan, scene)
    if motion is None:
        raise SystemExit(f"{plan.scene.name}: the plan has no motion")
    shares = np.linspace(0.0, len(motion.segments), PICTURES)
    times = np.interp(shares, np.arange(len(motion.segments) + 1), motion.starts)
    camera, below = _camera(scene, motion, azimuth)
    rows = -(-PICTURES // COLUMNS)
    sheet = Image.new("RGB", (COLUMNS * SIZE[0], rows * SIZE[1]), "white")
    for k, t in enumerate(times):
        state = motion.at(float(t))
        robots = [body for name, one in scene.robots.items() for body in robot(one, state.values[name])]
        thing = object_body(scene.profile, state.T_world_object, lambda h, _: np.tile(COLOR, (len(h), 1)))
        picture = render([*robots, *obstacles(scene, without=("floor",)), thing, floor(below)], camera, SIZE)
        corner = (k % COLUMNS * SIZE[0], k // COLUMNS * SIZE[1])
        sheet.paste(Image.fromarray(picture.image), corner)
        segment = motion.segments[state.segment]
        text = f"{t:.2f} s  {segment.kind} {', '.join(segment.arms)}"
        ImageDraw.Draw(sheet).text((corner[0] + 8, corner[1] + 6), text, fill="black")
    return sheet


def _camera(scene: Scene, motion: Motion, azimuth: float) -> tuple[Camera, float]:
    """Return a camera that sees the robots and all poses of the object, and the height (m) of the floor."""
    points: list[Array] = [pose[:3, 3] for pose in motion.poses]
    for name, one in scene.robots.items():
        links = one.T_world_base @ one.model.forward(motion.at(0.0).values[name])
        points += list(links[:, :3, 3])
    low, high = np.min(points, axis=0), np.max(points, axis=0)
    middle = 0.5 * (low + high)
    width = 1.6 * max(float(np.linalg.norm(high[:2] - low[:2])), 4 / 3 * float(high[2] - low[2]), 0.9)
    x, y, z = map(float, middle)
    return Camera((x, y, z), azimuth, 22.0, width), min(float(low[2]) - 0.04, -0.04)


def main(paths: Sequence[str]) -> None:
    """Write the strips of plan files."""
    for path in map(Path, paths):
        strip(Plan.load(path)).save(path.with_suffix(".png"))
        print(path.with_suffix(".png"), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
