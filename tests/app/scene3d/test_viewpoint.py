"""Where things stand in the 3D view, and how it is looked at."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace

import numpy as np
import pytest
import viser
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from app.panels.pose_panel import position_range
from app.scene3d.flat_map import MIN_FACING
from app.scene3d.scene_view import SceneView
from app.scene3d.viewpoint import choose_viewpoint
from app.server.door.viser_server import quiet_server
from symgrasp.scene.scene import Scene
from tests.app.scene3d.seen import in_view, link_corners
from tests.app.state.states import opened
from tests.conftest import PLAIN


@pytest.fixture(scope="module")
def server() -> Iterator[viser.ViserServer]:
    server = quiet_server()
    yield server
    server.stop()


def view_of(server: viser.ViserServer, camera: tuple[float, ...] | None) -> SceneView:
    looker = SimpleNamespace(image_width=1280, image_height=800)
    client = SimpleNamespace(scene=server.scene, atomic=server.atomic, camera=looker)
    ignored = [lambda *_: None] * 4
    view = SceneView(client, None, *ignored)  # pyright: ignore[reportArgumentType]
    view.camera = camera
    view.show(opened("soda_can"), move_gizmo=True)
    view.camera_moved((3.0, 3.0, 3.0, 0.0, 0.0, 0.0))  # from before the scene was there
    view.camera_moved((*looker.position, *looker.look_at))
    return view


@pytest.fixture(scope="module")
def view(server) -> SceneView:
    return view_of(server, None)


def front_towards(view: SceneView, eye: np.ndarray) -> float:
    """Cosine of the horizontal angle between the front of the flat map and a point."""
    assert view.flat_map
    w, x, y, z = view.flat_map.frame.wxyz
    towards = (eye - view.flat_map.frame.position)[:2]
    front = Rotation.from_quat([x, y, z, w]).apply([0.0, 0.0, 1.0])[:2]
    return float(front @ towards / np.linalg.norm(towards))


ANGLES = st.floats(-np.pi, np.pi)


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(ANGLES, min_size=1, max_size=6))
def test_the_flat_map_is_seen_from_the_front_however_the_camera_goes_round(view, angles):
    for angle in angles:
        eye = np.array([0.5 + 1.5 * np.cos(angle), 1.5 * np.sin(angle), 0.8])
        view.camera_moved((*eye, 0.5, 0.0, 0.1))
        assert front_towards(view, eye) >= MIN_FACING - 1e-9


def test_a_camera_right_above_leaves_the_flat_map_as_it_is(view):
    before = view.flat_map.frame.wxyz.copy()
    x, y, z = view.flat_map.frame.position
    view.camera_moved((x, y, z + 2.0, 0.5, 0.0, 0.1))
    assert np.array_equal(view.flat_map.frame.wxyz, before)


@pytest.mark.parametrize("angle", [0.0, 2.0, 4.0])
def test_a_view_that_begins_with_a_camera_has_the_flat_map_towards_it(server, angle):
    """So it is in a picture that was saved, from wherever, with the object anywhere."""
    eye = np.array([0.5 + 2 * np.cos(angle), 2 * np.sin(angle), 0.8])
    assert front_towards(view_of(server, (*eye, 0.5, 0.0, 0.1)), eye) > 0.9


@pytest.mark.parametrize("name", [*PLAIN, "pr2_pour"])
@pytest.mark.parametrize("aspect", [472 / 800, 840 / 800, 1600 / 800])
def test_every_robot_and_every_task_is_in_the_picture(name, aspect):
    scene = Scene.load(name)
    pose = scene.task().T_world_object
    camera = choose_viewpoint(scene, pose, aspect=aspect).camera(aspect)
    middle = [0.0, 0.0, (scene.profile.h_min + scene.profile.h_max) / 2, 1.0]
    places = [(task.T_world_object @ middle)[None, :3] for task in scene.tasks.values()]
    points = np.concatenate([*links_at_home(scene), ends_of(scene, pose), *places])
    assert (np.abs(in_view(camera, points, aspect)) < 1).all()


@pytest.mark.parametrize("aspect", [472 / 800, 820 / 268, 390 / 205])
@pytest.mark.parametrize("name", PLAIN)
def test_a_close_view_is_filled_by_robots_and_object(name, aspect):
    scene = Scene.load(name)
    pose = scene.task().T_world_object
    camera = choose_viewpoint(scene, pose, aspect=aspect, close=True, flat_map=False).camera(aspect)
    seen = in_view(camera, np.concatenate([*links_at_home(scene), ends_of(scene, pose)]), aspect)
    assert (np.abs(seen) < 1).all()
    if np.linalg.norm(np.subtract(camera[:3], camera[3:])) > 1.2:  # else it would be too near
        assert (seen.max(axis=0) - seen.min(axis=0)).max() > 1.6


def links_at_home(scene: Scene) -> list[np.ndarray]:
    return [link_corners(robot, robot.home) for robot in scene.robots.values()]


def ends_of(scene: Scene, pose: np.ndarray) -> np.ndarray:
    ends = np.array([[0.0, 0.0, h, 1.0] for h in (scene.profile.h_min, scene.profile.h_max)])
    return (ends @ pose.T)[:, :3]


@pytest.mark.parametrize("name", PLAIN)
def test_the_object_can_be_moved_a_metre_beyond_everything(name):
    scene = Scene.load(name)
    poses = [robot.T_world_base for robot in scene.robots.values()]
    poses += [task.T_world_object for task in scene.tasks.values()]
    for axis in range(3):
        low, high = position_range(scene, axis)
        places = [100 * pose[axis, 3] for pose in poses]
        assert low % 10 == high % 10 == 0
        assert 100 <= min(places) - low < 110
        assert 100 <= high - max(places) < 110
