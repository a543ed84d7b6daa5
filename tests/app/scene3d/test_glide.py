"""Arms go to a grasp that was picked frame by frame, and follow all else at once."""

# A map may be None in general, but not where these tests look.
# pyright: reportOptionalMemberAccess=false

from __future__ import annotations

import itertools
from types import SimpleNamespace
from typing import Any

import numpy as np

from app.render.drawn_poses import drawn_joint_values
from app.scene3d.glide import FRAMES, INTERVAL, Glide
from app.scene3d.scene_view import SceneView
from app.server.door.viser_server import quiet_server
from app.state import changes
from tests.app.state.states import opened

HOME, THERE, ELSEWHERE = ({"arm": np.full(2, value)} for value in (0.0, 1.0, 3.0))


def frames(glide: Glide) -> list[float]:
    """Return the first joint value in every frame up to the last."""
    shown = [float(glide.values["arm"][0])]
    while glide.wait(0.0) is not None:
        glide.step(0.0)
        shown.append(float(glide.values["arm"][0]))
    return shown


def test_a_movement_goes_one_way_and_ends_where_it_is_to():
    glide = Glide(HOME)
    glide.aim(THERE, 0.0, visibly=True)
    shown = frames(glide)
    assert len(shown) == FRAMES + 1
    assert shown[0] == 0.0
    assert shown[-1] == 1.0
    steps = np.diff(shown)
    assert (steps > 0).all()
    assert steps.max() < 0.25
    assert glide.values == THERE


def test_a_movement_that_is_drawn_again_goes_on():
    glide = Glide(HOME)
    glide.aim(THERE, 0.0, visibly=True)
    glide.step(0.0)
    glide.aim({"arm": np.ones(2)}, 0.0, visibly=False)
    assert len(frames(glide)) == FRAMES


def test_another_goal_begins_where_the_arm_is_shown_and_is_reached_at_once_unless_visibly():
    glide = Glide(HOME)
    glide.aim(THERE, 0.0, visibly=True)
    for _ in range(FRAMES // 2):
        glide.step(0.0)
    amid = float(glide.values["arm"][0])
    glide.aim(ELSEWHERE, 0.0, visibly=True)
    shown = frames(glide)
    assert 0 < shown[0] == amid < 1
    assert (np.diff(shown) > 0).all()
    glide.aim(HOME, 0.0, visibly=False)
    assert frames(glide) == [0.0]


def test_frames_are_due_one_after_the_other():
    glide = Glide(HOME)
    assert glide.wait(5.0) is None
    glide.aim(THERE, 5.0, visibly=True)
    assert glide.wait(5.0) == INTERVAL
    assert glide.wait(6.0) == 0.0
    glide.step(6.0)
    assert glide.wait(6.0) == INTERVAL


def test_a_picked_grasp_is_gone_to_visibly_and_a_turn_is_followed_at_once():
    server = quiet_server()
    try:
        looker = SimpleNamespace(image_width=1280, image_height=800)
        client: Any = SimpleNamespace(scene=server.scene, atomic=server.atomic, camera=looker)
        view, state = SceneView(client, None, *[lambda *_: None] * 4), opened()
        (robot,) = state.scene.robots.values()

        def hand() -> np.ndarray:
            """Where the last link of the arm is shown."""
            node = view.robots[robot.name].nodes[max(view.robots[robot.name].nodes)]
            return np.array(node.position)

        def at(values: np.ndarray) -> np.ndarray:
            return robot.model.forward(values)[max(view.robots[robot.name].nodes), :3, 3]

        view.show(state, move_gizmo=True)
        picked = changes.choose_cell(state, *np.argwhere(state.map.feasible.any(axis=0))[0].tolist())
        goal = at(drawn_joint_values(picked)[robot.name])
        view.show(picked, move_gizmo=True)
        places = [hand()]
        while view.wait() is not None:
            view.step()
            places.append(hand())
        assert len(places) == FRAMES + 1
        assert np.allclose(places[0], at(robot.home), atol=1e-6)
        assert np.allclose(places[-1], goal, atol=1e-6)
        assert not any(np.allclose(a, b, atol=1e-4) for a, b in itertools.pairwise(places))
        turned = changes.turn(picked, 0.3)
        view.show(turned, move_gizmo=True)
        assert view.wait() is None
        assert np.allclose(hand(), at(drawn_joint_values(turned)[robot.name]), atol=1e-6)
    finally:
        server.stop()
