"""The camera follows what is played and planned, and leaves alone who looks elsewhere meanwhile."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import viser
from hypothesis import given
from hypothesis import strategies as st

from app.render.drawn_poses import drawn_joint_values
from app.scene3d.following import KEPT, followed, points_to_follow
from app.scene3d.scene_view import SceneView
from app.scene3d.viewpoint import FLAT_SIZE
from app.server.door.viser_server import quiet_server
from app.state.changes import switched
from app.state.first_grasp import with_first_grasp
from app.state.page_link import Camera
from app.state.plans.plan_changes import show_position, show_step
from app.state.state import State
from symgrasp.poses import from_position_quat
from tests.app.scene3d.seen import in_view, link_corners
from tests.app.state.states import opened, with_plan

SIZE = (468, 800)
"""What 1280 x 800 leaves between the panels."""

NUMBERS = st.floats(-3.0, 3.0)
POINTS = st.lists(st.tuples(NUMBERS, NUMBERS, NUMBERS), min_size=1, max_size=6).map(np.array)
CAMERAS = st.tuples(*[NUMBERS] * 6).filter(lambda c: np.hypot(c[0] - c[3], c[1] - c[4]) > 0.1)


@given(CAMERAS, POINTS, st.floats(0.4, 2.5))
def test_all_is_in_view_afterwards_and_the_direction_stays(camera, points, aspect):
    after = followed(camera, points, aspect)
    assert (np.abs(in_view(after, points, aspect)) <= KEPT + 1e-6).all()
    before, now = (np.array(c[3:]) - c[:3] for c in (camera, after))
    assert np.allclose(np.cross(before, now), 0, atol=1e-6 * np.linalg.norm(before) * np.linalg.norm(now))
    assert before @ now > 0
    assert followed(after, points, aspect) == pytest.approx(after, abs=1e-6)


@given(CAMERAS, POINTS, st.floats(0.4, 2.5))
def test_a_camera_that_sees_all_is_left_where_it_is(camera, points, aspect):
    inside = (np.abs(in_view(camera, points, aspect)) < KEPT - 1e-6).all()
    near = ((points - camera[:3]) @ (np.array(camera[3:]) - camera[:3])).min() < 0.2 * np.linalg.norm(
        np.array(camera[3:]) - camera[:3]
    )
    if inside and not near:
        assert followed(camera, points, aspect) is camera


@pytest.fixture
def camera() -> Any:
    return SimpleNamespace(image_width=SIZE[0], image_height=SIZE[1])


@pytest.fixture
def view(camera) -> Iterator[SceneView]:
    server: viser.ViserServer = quiet_server()
    client = SimpleNamespace(scene=server.scene, atomic=server.atomic, camera=camera)
    ignored = [lambda *_: None] * 4
    yield SceneView(client, SIZE, *ignored)  # pyright: ignore[reportArgumentType]
    server.stop()


def pose(camera: Any) -> Camera:
    return (*camera.position, *camera.look_at)


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("pick_pour_place", "sequential"),
        ("handover_between_robots", "handover"),
        ("log_two_robots", "bimanual"),
    ],
)
def test_every_task_of_a_plan_is_in_view(view, camera, name, kind):
    view.show(opened(name), move_gizmo=True)
    state = with_plan(name, kind)
    assert state.plan
    for step in range(len(state.plan.plan.tasks)):
        camera.position, camera.look_at = np.array([9.0, 9.0, 2.0]), np.array([9.0, 5.0, 1.0])  # elsewhere
        state = show_step(state, step)
        view.show(state, move_gizmo=True)
        assert state.shown_task
        robots = [state.scene.arm(hold.arm).robot for hold in state.shown_task.holds]
        values = drawn_joint_values(state)
        points = np.concatenate([link_corners(robot, values[robot.name]) for robot in robots])
        assert (np.abs(in_view(pose(camera), points, SIZE[0] / SIZE[1])) <= KEPT + 1e-6).all()


def test_who_looks_elsewhere_while_nothing_changes_is_not_turned_back(view, camera):
    state = with_plan("pick_pour_place", "sequential")
    view.show(state, move_gizmo=True)
    elsewhere = np.array([9.0, 9.0, 2.0]), np.array([9.0, 5.0, 1.0])
    camera.position, camera.look_at = elsewhere
    view.show(state, move_gizmo=True)
    assert (camera.position, camera.look_at) == elsewhere
    view.show(opened("pick_pour_place"), move_gizmo=True)  # no plan is shown
    assert (camera.position, camera.look_at) == elsewhere


def test_a_page_that_comes_back_is_seen_from_where_it_was(view, camera):
    left = (9.0, 9.0, 2.0, 9.0, 5.0, 1.0)
    view.camera = left
    view.show(with_plan("pick_pour_place", "sequential"), move_gizmo=True)
    assert pose(camera) == left


def behind_obstacles(state: State, camera: Camera) -> int:
    """How many points of the object's axis have an obstacle before them, by samples of the lines of sight."""
    profile, eye = state.scene.profile, np.array(camera[:3])
    heights = np.linspace(profile.h_min, profile.h_max, 9)
    axis = np.stack([0 * heights, 0 * heights, heights, heights**0], axis=-1) @ state.T_world_object.T
    shares = np.linspace(0.02, 1, 400)[:, None, None]
    samples = axis[:, :3] + shares * (eye - axis[:, :3])
    hidden = np.zeros(len(axis), dtype=bool)
    boxes = [obstacle for obstacle in state.scene.obstacles if obstacle.kind == "box"]
    assert len(boxes) == 3
    for box in boxes:
        local = (samples - box.T_world_obstacle[:3, 3]) @ box.T_world_obstacle[:3, :3]
        hidden |= (np.abs(local) <= np.array(box.size) / 2).all(axis=-1).any(axis=0)
    return int(hidden.sum())


@pytest.mark.parametrize("azimuth", range(0, 360, 45))
def test_no_obstacle_is_before_the_object_of_a_plan(view, camera, azimuth):
    view.show(opened("pick_pour_place"), move_gizmo=True)
    state = with_plan("pick_pour_place", "sequential")
    assert state.plan
    for step in range(len(state.plan.plan.tasks)):
        state = show_step(state, step)
        middle = state.T_world_object[:3, 3]
        angle = np.deg2rad(azimuth)
        eye = middle + np.array([1.2 * np.cos(angle), 1.2 * np.sin(angle), 0.1])
        camera.position, camera.look_at = eye, middle
        view.show(state, move_gizmo=True)
        assert behind_obstacles(state, pose(camera)) == 0
        assert (
            np.abs(in_view(pose(camera), points_to_follow(state), SIZE[0] / SIZE[1])) <= KEPT + 1e-6
        ).all()


def test_what_plays_turns_no_camera_around(view, camera):
    state = with_plan("pick_pour_place", "sequential")
    view.show(state, move_gizmo=True)
    wall = next(o for o in state.scene.obstacles if o.name == "wall").T_world_obstacle[:3, 3]
    middle = state.T_world_object[:3, 3]
    camera.position, camera.look_at = middle + 8 * (wall - middle) * [1, 1, 0], middle
    before = pose(camera)
    assert behind_obstacles(state, before)
    view.show(show_position(state, 0.3), move_gizmo=True)
    after = pose(camera)
    ahead, later = (np.array(c[3:]) - c[:3] for c in (before, after))
    assert np.cross(ahead, later) == pytest.approx(np.zeros(3), abs=1e-9)


def flat_corners(view: SceneView) -> np.ndarray:
    """The corners (4, 3) of the flat map where it is drawn."""
    assert view.flat_map
    frame, (width, height) = view.flat_map.frame, FLAT_SIZE
    signs = np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]]) / 2
    pose = from_position_quat(frame.position, frame.wxyz)
    return signs * [width, height] @ pose[:3, :2].T + pose[:3, 3]


@pytest.mark.parametrize("shown", [True, False])
def test_the_flat_map_is_in_view_while_a_plan_plays(view, camera, shown):
    state = switched(with_plan("pick_pour_place", "sequential"), flat_map=shown)
    view.show(state, move_gizmo=True)
    moved = []
    for position in np.linspace(0.0, 2.0, 9):
        arm, object_pose = points_to_follow(state)[0], state.T_world_object[:3, 3]
        view.camera_moved(pose(camera))
        flat = flat_corners(view)
        camera.position = object_pose + np.array([0.9, 0.3, 0.4])
        camera.look_at = (arm + object_pose) / 2
        state = show_position(state, float(position))
        view.show(state, move_gizmo=True)
        seen = in_view(pose(camera), flat, SIZE[0] / SIZE[1])
        moved.append(bool((np.abs(seen) <= KEPT + 1e-6).all()))
    assert all(moved) if shown else not all(moved)


def test_a_camera_moves_while_its_scene_is_replaced(view, camera):
    view.show(opened("pick_pour_place"), move_gizmo=True)
    view.camera_moved(pose(camera))
    assert view.flat_map
    view.flat_map.frame.remove()
    for azimuth in np.linspace(0, 2 * np.pi, 5):
        view.camera_moved((3 * np.cos(azimuth), 3 * np.sin(azimuth), 1.0, 0.0, 0.0, 0.0))


def first_grasp(view: SceneView, state: State) -> State:
    """Show a page that begins with a grasp before its map is there; return it with the grasp."""
    view.is_close, state = True, switched(state, flat_map=False)
    view.show(replace(state, result=None, holds_first=True), move_gizmo=True)
    held = with_first_grasp(replace(state, holds_first=True))
    assert held.pick
    return held


def test_the_arm_is_in_view_when_it_has_taken_its_first_grasp(view, camera):
    held = first_grasp(view, opened("pick_pour_place"))
    view.camera_moved(pose(camera))
    view.show(held, move_gizmo=True)
    arm = held.scene.arm()
    seen = in_view(
        pose(camera), link_corners(arm.robot, drawn_joint_values(held)[arm.robot.name]), SIZE[0] / SIZE[1]
    )
    assert (np.abs(seen) < 1).all()
    assert (seen.max(axis=0) - seen.min(axis=0)).max() > 1.7  # from nearer than the arm at home is seen


def test_who_looks_elsewhere_before_the_first_grasp_is_not_turned_back(view, camera):
    held = first_grasp(view, opened("pick_pour_place"))
    view.camera_moved(pose(camera))
    elsewhere = np.array([9.0, 9.0, 2.0]), np.array([9.0, 5.0, 1.0])
    camera.position, camera.look_at = elsewhere
    view.camera_moved(pose(camera))
    view.show(held, move_gizmo=True)
    assert (camera.position, camera.look_at) == elsewhere
