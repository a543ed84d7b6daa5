"""Poses, objects and picks in the state of a page, with no page."""

# A map, a pick or a plan may be None in general, but not where these tests look.
# pyright: reportOptionalMemberAccess=false, reportArgumentType=false

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.choices.object_choice import OWN, from_library, from_mesh
from app.render.drawn_poses import drawn_joint_values
from app.state import changes
from app.state.map_view_state import RollChoice
from app.state.object_pose import ObjectPose
from app.state.undo import remember, undo
from symgrasp.errors import SymgraspError
from symgrasp.object.manifold import wrap
from symgrasp.poses import pose_error, rotation_about, rotation_z
from symgrasp.reason import Reason
from tests.app.state.states import opened
from tests.strategies import poses

angle = st.floats(-math.pi, math.pi)


@settings(deadline=None)
@given(poses())
def test_a_pose_taken_apart_and_put_together_is_the_same(pose):
    if pose[2, 2] < -1 + 1e-6:  # upside down the direction of the lean is not defined
        return
    distance, turn = pose_error(ObjectPose.of(pose).matrix(), pose)
    assert distance < 1e-12
    assert turn < 1e-6


@settings(deadline=None)
@given(st.floats(0.01, 3.1), angle, angle)
def test_lean_and_direction_are_those_of_the_axis(lean, towards, spin):
    axis = ObjectPose(0.0, 0.0, 0.0, lean, towards, spin).matrix()[:3, 2]
    assert np.arccos(axis[2]) == pytest.approx(lean, abs=1e-7)
    assert np.arctan2(axis[1], axis[0]) == pytest.approx(towards, abs=1e-6)


def test_the_direction_of_a_small_lean_is_kept():
    pose = ObjectPose(0.0, 0.0, 0.0, lean=1e-9, towards=2.0).matrix()
    assert np.allclose(ObjectPose.of(pose).matrix(), pose, rtol=0, atol=1e-11)


def test_a_turn_shifts_the_map_and_asks_for_nothing():
    state = opened()
    columns = state.map.manifold.angles
    turned = changes.turn(state, 3 * 2 * np.pi / columns)
    assert turned.is_current
    assert turned.next_request is None
    assert np.array_equal(turned.map.reason, np.roll(state.map.reason, -3, axis=2))
    assert not np.array_equal(turned.map.reason, state.map.reason)


@settings(deadline=None)
@given(angle)
def test_the_object_turns_about_its_own_axis(delta):
    state = changes.turn(opened("log_two_robots"), delta)
    base = state.request.T_world_object
    assert np.allclose(state.T_world_object, base @ rotation_z(delta))
    assert np.allclose(state.T_world_object[:3, 2], base[:3, 2])


@settings(deadline=None)
@given(angle, st.integers(0, 7), st.integers(0, 15))
def test_a_cell_clicked_on_the_surface_lies_where_it_is_seen(delta, row, column):
    """The colours do not turn: a cell's place in the world is that of the map before the turn."""
    state = changes.turn(opened(), delta)
    picked = changes.choose_surface_cell(state, row, column)
    grid = state.result.map.manifold
    clicked = state.request.T_world_object @ [*grid.contact(grid.h[row], grid.theta[column]), 1.0]
    chosen = picked.T_world_object @ [*grid.contact(picked.pick.h, picked.pick.theta), 1.0]
    assert np.allclose(chosen, clicked)
    shown = picked.map.reason[:, picked.cell.row, picked.cell.column]
    assert np.array_equal(shown, state.result.map.reason[:, row, column])


@settings(deadline=None)
@given(angle, angle, st.floats(0.0, 0.3))
def test_the_pick_stays_on_the_object_while_it_turns(theta, delta, h):
    state = changes.choose(opened(), h, theta)
    turned = changes.turn(state, delta)
    assert turned.pick == state.pick
    # Its cell is at most half a cell from it, and is reported for the grid as it is turned.
    assert abs(wrap(turned.map.manifold.theta[turned.cell.column] - theta)) <= np.pi / 16 + 1e-9


@settings(deadline=None)
@given(st.floats(-1, 1), st.floats(0.1, 3.0), angle, angle)
def test_dragging_the_gizmo_puts_the_object_where_the_gizmo_is(x, lean, towards, spin):
    pose = ObjectPose(x, 0.2, 0.3, lean, towards, spin).matrix()
    state = changes.drag(changes.turn(opened(), 0.4), pose)
    assert np.allclose(state.T_world_object, pose, atol=1e-9)
    assert not state.is_current


@settings(deadline=None)
@given(angle)
def test_turning_the_gizmo_about_the_axis_only_shifts(turn):
    state = opened("log_two_robots")
    dragged = changes.drag(state, state.T_world_object @ rotation_z(turn) + 1e-8)
    assert dragged.is_current
    assert dragged.base == state.base
    assert wrap(dragged.delta - turn) == pytest.approx(0.0, abs=1e-6)


def test_tilting_the_gizmo_keeps_the_place():
    state = opened()
    tilted = state.T_world_object.copy()
    tilted[:3, :3] = rotation_about((1.0, 0.0, 0.0), 0.3)
    assert changes.drag(state, tilted).base.lean == pytest.approx(0.3)
    assert changes.drag(state, tilted).base.x == state.base.x


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_numbers_that_are_none_are_refused(value):
    for change in (
        lambda s: changes.turn(s, value),
        lambda s: changes.moved(s, x=value),
        lambda s: changes.choose(s, value, 0.0),
        lambda s: changes.choose(s, 0.1, value),
    ):
        with pytest.raises(SymgraspError, match="finite"):
            change(opened())


def test_another_object_needs_a_map_of_its_own_and_stands_where_the_old_one_stood():
    state = changes.choose(changes.turn(changes.moved(opened("pick_pour_place"), x=0.5), 0.3), 0.05, 0.0)
    object_choice = from_library("wine_bottle")
    changed = changes.choose_object(
        state, state.scene.with_object(object_choice.name, object_choice.profile), object_choice
    )
    assert changed.next_request == changed.request
    assert changed.request.scene.profile is object_choice.profile
    assert (changed.result, changed.pick, changed.map) == (None, None, None)
    assert np.array_equal(changed.T_world_object, state.T_world_object)
    assert (changed.object_option, changed.uploaded_object) == ("wine_bottle", None)
    back = changes.choose_object(changed, state.scene, None)
    assert (back.object_option, back.request) == (OWN, state.request)


def test_an_uploaded_object_stays_on_offer():
    state = opened()
    object_choice = from_library("wine_bottle")
    measured = replace(object_choice, option="b.stl (upload)", measurement=object())
    scene = state.scene.with_object(object_choice.name, object_choice.profile)
    state = changes.choose_object(changes.choose_object(state, scene, measured), scene, object_choice)
    assert (state.object_choice, state.uploaded_object) == (object_choice, measured)


def test_an_uploaded_object_is_flipped_in_the_scene_and_undone():
    content = from_library("wine_bottle").profile.mesh(48).export(file_type="stl")
    assert isinstance(content, bytes)
    choice = from_mesh("b.stl", content, 1.0)
    state = opened()
    state = changes.choose_object(state, state.scene.with_object(choice.name, choice.profile), choice)
    flipped = remember(state, changes.flip_object(state), "", 1.0)
    top = choice.profile.h_max
    knots = np.array(choice.profile.points)[::-1] * [-1, 1] + [top, 0]
    assert np.array(flipped.scene.file.object.profile) == pytest.approx(knots)
    assert flipped.object_choice is flipped.uploaded_object is not choice
    assert flipped.next_request == flipped.request != state.request
    assert undo(flipped).scene is state.scene
    assert np.array(changes.flip_object(flipped).scene.profile.points) == pytest.approx(choice.profile.points)
    library = changes.choose_object(state, state.scene, from_library("wine_bottle"))
    assert changes.flip_object(library) is library


def test_a_height_off_the_object_is_refused_in_its_units():
    with pytest.raises(SymgraspError, match=r"h \(cm\).*31.*0 to 30 cm"):
        changes.choose(opened(), 0.31, 0.0)


def test_either_roll_shows_the_one_that_got_furthest():
    m = opened().map
    merged = RollChoice.EITHER.reason(m)
    assert np.array_equal(merged == Reason.FEASIBLE, m.feasible.any(axis=0))
    for row, column in np.ndindex(*merged.shape):
        roll = RollChoice.EITHER.roll(m, row, column)
        assert m.reason[roll, row, column] == merged[row, column]


@pytest.mark.parametrize("roll", RollChoice)
def test_a_feasible_pick_poses_the_arm_and_another_parks_it(roll):
    state = changes.choose_roll(opened(), roll)
    shown = roll.reason(state.map)
    home = state.scene.robots["panda"].home
    row, column = np.argwhere(shown == Reason.FEASIBLE)[0]
    held = changes.choose_cell(state, row, column)
    values = drawn_joint_values(held)["panda"]
    arm = state.scene.arm()
    witness = held.map.witness(held.cell)
    assert np.array_equal(values, arm.robot_values(witness.q, witness.opening))
    assert not np.allclose(values, home)
    row, column = np.argwhere(shown != Reason.FEASIBLE)[0]
    assert np.array_equal(drawn_joint_values(changes.choose_cell(state, row, column))["panda"], home)
    assert np.array_equal(drawn_joint_values(changes.clear_pick(held))["panda"], home)
