"""What the page shows in 3D at first: all of the arm and the object, beside the panels."""

from __future__ import annotations

import re

import numpy as np
import pytest
from playwright.sync_api import expect

from app.files.links import Link
from app.scene3d.viewpoint import FIELD_OF_VIEW
from app.server.session.tour import STORY
from symgrasp.scene.scene import Scene
from tests.e2e.page import GraspPage

SIZES = ((1280, 800), (820, 1180), (390, 844), (1920, 1080))

TRIES = 50


def arm_and_object(page: GraspPage) -> np.ndarray:
    """Return the corners (n, 3) of the links at the joint values that are told, and the object's ends."""
    scene = Scene.load(STORY)
    told = page.text("Joints ").first.inner_text()
    angles, opening = re.findall(r"Joints (.*); fingers (\S+) cm", told)[0]
    q = np.deg2rad([float(angle.rstrip("°")) for angle in angles.replace("−", "-").split(", ")])
    arm = scene.arm()
    robot = arm.robot
    poses = robot.T_world_base @ robot.model.forward(arm.robot_values(q, float(opening) / 100))
    corners = [
        hull @ pose[:3, :3].T + pose[:3, 3]
        for link, pose in zip(robot.model.link_names, poses, strict=True)
        for hull in robot.model.hulls(link)
    ]
    ends = np.array([[0.0, 0.0, h, 1.0] for h in (scene.profile.h_min, scene.profile.h_max)])
    return np.concatenate([*corners, (ends @ scene.task().T_world_object.T)[:, :3]])


def pixels(page: GraspPage, points: np.ndarray) -> np.ndarray:
    """Return where points (n, 3) are in the window: (n, 2), as the page is looked at now."""
    page.button("Make a link").click()
    link = page.frame.locator(".sg-link").filter(visible=True)
    camera = Link.parse((link.get_attribute("href") or "").split("?")[1]).camera
    assert camera
    box = page.frame.locator("canvas").first.bounding_box()
    assert box
    eye, target = np.array(camera[:3]), np.array(camera[3:])
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    across, upwards, depth = np.stack([right, np.cross(right, forward), forward]) @ (points - eye).T
    scale = box["height"] / 2 / np.tan(FIELD_OF_VIEW / 2) / depth
    middle = [box["x"] + box["width"] / 2, box["y"] + box["height"] / 2]
    return np.stack([middle[0] + scale * across, middle[1] - scale * upwards], axis=-1)


@pytest.mark.parametrize("size", SIZES, ids=[str(width) for width, _ in SIZES])
def test_arm_and_object_are_beside_the_panels_and_fill_the_view(open_page, size):
    page = open_page("", size=size)
    page.expect_title(STORY)
    expect(page.text("panda holds it: feasible")).to_be_visible()
    points = arm_and_object(page)
    view = page.frame.locator("canvas").first.bounding_box()
    page.tab("Files")
    size_of_view = np.array([view["width"], view["height"]])

    def shown() -> tuple[bool, np.ndarray]:
        seen = pixels(page, points) - [view["x"], view["y"]]
        fills = ((seen.max(axis=0) - seen.min(axis=0)) / size_of_view).max()
        return bool((seen > 0).all() and (seen < size_of_view).all() and fills > 0.8), seen

    right, seen = shown()
    for _ in range(TRIES):  # the camera follows the arm after its joint values are told
        if right:
            break
        page.next_frame()
        right, seen = shown()
    assert right, f"{seen.min(axis=0)} to {seen.max(axis=0)} of {size_of_view}"
    assert page.complaints == []
