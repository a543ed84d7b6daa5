"""Links: what is shown goes into an address and comes back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.compute import Store
from app.links import link_of, parse_link
from app.scene_files import Loaded
from app.state import Pick, State
from app.things import from_library
from app.values import RollChoice
from symgrasp.errors import SymgraspError
from symgrasp.views import View
from tests.conftest import load_small

LENGTHS = st.floats(-2, 2)
ANGLES = st.floats(-3.1, 3.1)
POSES = st.fixed_dictionaries(
    {"x": LENGTHS, "y": LENGTHS, "z": LENGTHS, "lean": st.floats(0, 3), "towards": ANGLES}
)


def reopened(query: str, name: str) -> State:
    link = parse_link(query)
    assert link.scene == name
    return link.apply(State.of(load_small(name), name))


@settings(deadline=None)
@given(
    st.dictionaries(st.sampled_from(["pick", "pour", "place"]), POSES),
    ANGLES,
    st.none() | st.tuples(st.floats(0, 0.21), ANGLES, st.none() | st.integers(0, 1)),
    st.sampled_from(list(RollChoice)),
    st.lists(st.booleans(), min_size=3, max_size=3),
    st.sampled_from(["pick", "pour", "place"]),
    st.sampled_from(list(View)),
)
def test_everything_chosen_comes_back(poses, delta, pick, roll, switches, task, view):
    name = "pick_pour_place"
    state = State.of(load_small(name), name).choose_roll(roll)
    for moved, pose in poses.items():
        state = state.choose_task(moved).move(**pose)
    board, gizmo, dark = switches
    state = replace(state.choose_task(task).turn(delta), board=board, gizmo=gizmo, dark=dark)
    state = replace(state, looking=replace(state.looking, view=view))
    if pick:
        state = replace(state, pick=Pick(*pick))
    again = reopened(link_of(state), name)
    assert (again.task, again.arm, again.roll) == (state.task, state.arm, state.roll)
    assert (again.board, again.gizmo, again.dark) == (board, gizmo, dark)
    assert again.looking == state.looking
    assert set(again.poses) == set(state.poses)
    for moved in state.poses:
        assert np.allclose(again.poses[moved].matrix(), state.poses[moved].matrix(), atol=1e-10)
    assert again.delta == pytest.approx(delta, abs=1e-10)
    assert (again.pick is None) == (state.pick is None)
    if again.pick and state.pick:
        assert again.pick.h == pytest.approx(state.pick.h, abs=1e-10)
        assert np.cos(again.pick.theta - state.pick.theta) == pytest.approx(1)
        assert again.pick.roll == state.pick.roll


def test_a_link_is_short_and_readable():
    state = State.of(load_small("soda_can"), "soda_can").move(x=0.5).turn(np.deg2rad(30))
    assert "&turn=30" in link_of(state)
    assert "&at.pick=50," in link_of(state)
    query = link_of(State.of(load_small("soda_can"), "soda_can"), (1.0, 0.5, 0.7, 0.1, 0.0, 0.25))
    assert query == "scene=soda_can&task=pick&arm=panda&camera=1.000,0.500,0.700,0.100,0.000,0.250"
    assert parse_link(query).camera == (1.0, 0.5, 0.7, 0.1, 0.0, 0.25)


def test_objects_of_the_library_and_hands_come_back():
    store = Store("log_iiwa_and_panda")
    scene, thing = store.linked(parse_link("object=log_70mm&hand.iiwa=pr2"))
    assert scene.mounted["iiwa"] == "pr2"
    assert thing
    assert thing.choice == "log_70mm"
    state = replace(State.of(scene, "log_iiwa_and_panda"), thing=thing)
    again, _ = store.linked(parse_link(link_of(state)))
    assert again.sha256 == scene.sha256


def test_what_was_uploaded_is_in_no_link():
    scene = load_small("soda_can")
    state = State.of(scene, "soda_can").load_scene(Loaded("mine.yaml (upload)", scene))
    with pytest.raises(SymgraspError, match=r"link: scene: 'an upload': .*save the scene instead"):
        link_of(state)
    mesh = replace(from_library("log_70mm"), measurement=object())  # pyright: ignore[reportArgumentType]
    with pytest.raises(SymgraspError, match="link: object: 'an upload'"):
        link_of(State.of(scene, "soda_can").choose_object(scene, mesh))


@pytest.mark.parametrize(
    ("query", "message"),
    [
        ("scene=no_such", "scene: 'no_such': expected one of"),
        ("scene=/etc/passwd", "scene: '/etc/passwd': expected one of"),
        ("object=../secret.yaml", "object: '../secret.yaml': expected one of"),
        ("hand.panda=wsg50", "arm: 'panda': expected one of"),
        ("task=none", "task: 'none': expected one of"),
        ("arm=none", "link: arm: 'none': expected one of 'panda'"),
        ("turn=x", "link: turn: 'x': expected a number"),
        ("turn=nan", "link: turn: 'nan': expected a number"),
        ("turn=1e99", "link: turn: '1e99': expected a number"),
        ("turn=1&turn=2", "link: turn: '2': expected every setting once"),
        ("at.pick=1,2", "link: at.pick: '1,2': expected six numbers"),
        ("at.none=1,2,3,4,5,6", "task: 'none': expected one of"),
        ("h=99", r"h \(cm\): 99.0: expected 0 to"),
        ("h=5&side=90", "link: side: '90': expected one of"),
        ("roll=30", "link: roll: '30': expected one of"),
        ("camera=1,2,3", "link: camera: '1,2,3': expected six numbers"),
        ("tsk=pick", "link: tsk: 'pick': expected .*did you mean 'task'"),
        ("scene=" + "x" * 5000, "link: length: 5006: expected at most 4000 characters"),
    ],
)
def test_what_is_wrong_with_a_link_is_said_in_a_line(query, message):
    store = Store("bottle_on_table")
    with pytest.raises(SymgraspError, match=message) as error:
        link = parse_link(query)
        scene, _ = store.linked(link)
        link.apply(State.of(scene, ""))
    assert "\n" not in str(error.value)


def test_what_viser_understands_is_left_to_it():
    assert parse_link("darkMode&initialCameraFov=1&websocket=x&turn=5").settings == {"turn": "5"}
