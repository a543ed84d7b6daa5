"""The map follows while the object is dragged about with its handles."""

from __future__ import annotations

import logging
import time
from pathlib import Path

import numpy as np

from symgrasp.scene.scene import Scene
from tests.e2e.page import GraspPage

BOTTLE = Scene.load("bottle_on_table")
SHOTS = Path(__file__).parent / "screenshots"

HANDLE = np.array([0.0389, 0.0389, 0.0])
"""Where (m) the handle that slides the object over the table is, from the object's origin."""

log = logging.getLogger(__name__)


def test_the_map_follows_a_circle_on_the_table(open_page):
    page: GraspPage = open_page(size=(1280, 720))
    page.frame.get_by_label("Drag handles").check()
    page.settled_view()
    bottle = BOTTLE.task().T_world_object[:3, 3]
    turns = np.linspace(0, 2 * np.pi, 61)
    radius = 0.06
    centre = bottle + HANDLE - [radius, 0, 0]
    path = [page.at(BOTTLE, centre + radius * np.array([np.cos(a), np.sin(a), 0])) for a in turns]
    mouse = page.page.mouse
    mouse.move(path[0][0] - 3, path[0][1])
    page.settled_view()
    mouse.move(*path[0])
    page.settled_view()
    times: list[float] = []
    page.shown_map.on_cells = lambda: times.append(time.monotonic())
    mouse.down()
    for quarter in np.array_split(np.array(path), 4):
        seen = len(times)
        for x, y in quarter:
            mouse.move(x, y)
        page.wait_for_picture(lambda _, seen=seen: len(times) > seen)  # while the handle is held
    page.page.screenshot(path=SHOTS / "drag.png")
    mouse.up()
    page.expect_title("pick")
    rate = (len(times) - 1) / (times[-1] - times[0])
    log.info("%d maps for %d positions while dragging, %.1f a second", len(times), len(path), rate)
    pose = page.slider_box("x (cm)").input_value(), page.slider_box("y (cm)").input_value()
    assert pose == ("55", "0")  # full circle
