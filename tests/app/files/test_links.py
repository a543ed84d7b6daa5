"""Links: what is shown goes into an address and comes back."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.compute.cache import SharedCache
from app.files.links import LONGEST, link_of, parse_link
from app.panels.files_panel import link_html
from app.state.history import remember, undo
from app.state.map_view_state import RollChoice
from app.state.object_choice import from_library
from app.state.state import Pick, State
from app.state.task_list import TaskList
from app.state.uploaded_scene import UploadedScene
from symgrasp.errors import SymgraspError
from symgrasp.feasibility.color_by import ColorBy
from tests.conftest import load_small

LENGTHS = st.floats(-2, 2)
ANGLES = st.floats(-3.1, 3.1)
POSES = st.fixed_dictionaries(
    {"x": LENGTHS, "y": LENGTHS, "z": LENGTHS, "lean": st.floats(0, 3), "towards": ANGLES}
)

EARLIER = "The page has changed since"


def opened(name: str) -> State:
    return State.of(load_small(name), name)


def query_of(state: State, camera: tuple[float, ...] | None = None) -> str:
    return link_of(state, load_small(state.scene_name), camera)


def reopened(query: str, name: str) -> State:
    link = parse_link(query)
    assert link.scene == name
    return link.apply(opened(name))


@settings(deadline=None)
@given(
    st.dictionaries(st.sampled_from(["pick", "pour", "place"]), POSES),
    ANGLES,
    st.none() | st.tuples(st.floats(0, 0.21), ANGLES, st.none() | st.integers(0, 1)),
    st.sampled_from(list(RollChoice)),
    st.lists(st.booleans(), min_size=3, max_size=3),
    st.sampled_from(["pick", "pour", "place"]),
    st.sampled_from(list(ColorBy)),
)
def test_everything_chosen_comes_back(poses, delta, pick, roll, switches, task, view):
    name = "pick_pour_place"
    state = opened(name).choose_roll(roll)
    for moved, pose in poses.items():
        state = state.choose_task(moved).move(**pose)
    flat_map, gizmo, dark = switches
    state = replace(state.choose_task(task).turn(delta), flat_map=flat_map, gizmo=gizmo, dark=dark)
    state = replace(state, map_view=replace(state.map_view, view=view))
    if pick:
        state = replace(state, pick=Pick(*pick))
    again = reopened(query_of(state), name)
    assert (again.task, again.arm, again.roll) == (state.task, state.arm, state.roll)
    assert (again.flat_map, again.gizmo, again.dark) == (flat_map, gizmo, dark)
    assert again.map_view == state.map_view
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
    state = opened("soda_can").move(x=0.5).turn(np.deg2rad(30))
    assert "&turn=30" in query_of(state)
    assert "&at.pick=50," in query_of(state)
    query = query_of(opened("soda_can"), (1.0, 0.5, 0.7, 0.1, 0.0, 0.25))
    assert query == "scene=soda_can&task=pick&arm=panda&camera=1.000,0.500,0.700,0.100,0.000,0.250"
    assert parse_link(query).camera == (1.0, 0.5, 0.7, 0.1, 0.0, 0.25)


def test_objects_of_the_library_and_hands_come_back():
    store = SharedCache("log_iiwa_and_panda")
    scene, object_choice = store.linked(parse_link("object=log_70mm&hand.iiwa=pr2"))
    assert scene.replaceable_hands["iiwa"] == "pr2"
    assert object_choice
    assert object_choice.choice == "log_70mm"
    state = replace(State.of(scene, "log_iiwa_and_panda"), object_choice=object_choice)
    link = link_of(state, store.scene(state.scene_name))
    again, _ = store.linked(parse_link(link))
    assert again.sha256 == scene.sha256
    assert "tasks" not in link


def test_what_was_uploaded_is_in_no_link():
    scene = load_small("soda_can")
    state = State.of(scene, "soda_can").load_scene(UploadedScene("mine.yaml (upload)", scene))
    with pytest.raises(SymgraspError, match=r"link: scene: 'an upload': .*save the scene instead"):
        link_of(state, scene)
    mesh = replace(from_library("log_70mm"), measurement=object())  # pyright: ignore[reportArgumentType]
    with pytest.raises(SymgraspError, match="link: object: 'an upload'"):
        link_of(State.of(scene, "soda_can").choose_object(scene, mesh), scene)


# -- the list of tasks ----------------------------------------------------------------------

NAMES = st.sampled_from(
    ["pick", "pour", "a, b", '"', "<script>alert(1)</script>", "&at.pick=1", "mäh ✓"]
) | st.text(min_size=1, max_size=12)
EDITS = st.one_of(
    st.just(State.add_task),
    st.just(lambda s: s.change_tasks(TaskList.removed)),
    st.builds(lambda by: lambda s: s.change_tasks(lambda t: t.shifted(by)), st.integers(-3, 3)),
    st.builds(lambda name: lambda s: s.change_tasks(lambda t: t.renamed(name)), NAMES),
    st.builds(
        lambda k: lambda s: s.choose_task(list(s.scene.tasks)[k % len(s.scene.tasks)]), st.integers(0, 9)
    ),
    st.builds(lambda pose: lambda s: s.move(**pose), POSES),
    st.builds(lambda delta: lambda s: s.turn(delta), ANGLES),
    st.just(State.reset_pose),
)


def assert_same_tasks(again: State, state: State) -> None:
    tasks, right = again.moved_scene().tasks, state.moved_scene().tasks
    assert list(tasks) == list(right)
    for name, task in right.items():
        assert tasks[name].arms == task.arms
        assert np.allclose(tasks[name].T_world_object, task.T_world_object, rtol=0, atol=1e-9)
    assert (again.task, again.arm) == (state.task, state.arm)
    assert np.allclose(again.T_world_object, state.T_world_object, rtol=0, atol=1e-9)


@given(
    st.sampled_from(["pick_pour_place", "log_two_robots", "handover_between_robots"]),
    st.lists(EDITS, max_size=12),
)
def test_tasks_changed_in_any_way_come_back(name, edits):
    state = opened(name)
    for edit in edits:
        with suppress(SymgraspError):  # a name that is taken, the last task
            state = edit(state)
    query = query_of(state)
    again = reopened(query, name)
    assert_same_tasks(again, state)
    assert query.isascii()


def test_only_what_differs_from_the_servers_tasks_is_in_a_link():
    state = opened("pick_pour_place")
    assert "tasks" not in query_of(state)
    swapped = state.change_tasks(lambda tasks: tasks.shifted(1))
    assert query_of(swapped) == "scene=pick_pour_place&task=pick&arm=panda&tasks=pour,pick,place"
    renamed = state.change_tasks(lambda tasks: tasks.renamed("a, b"))
    assert "&tasks=%22a,+b%22,pour,place&at.a,+b=" in query_of(renamed)
    assert "at.pour" not in query_of(renamed)
    back = renamed.change_tasks(lambda tasks: tasks.renamed("pick"))
    assert query_of(back) == query_of(state)
    name = "handover_between_robots"
    taken = opened(name).change_tasks(TaskList.removed).change_tasks(lambda tasks: tasks.renamed("pick"))
    query = query_of(taken)
    assert "&tasks=pick,place&arms.pick=left,right&at.pick=" in query
    assert_same_tasks(reopened(query, name), taken)
    assert_same_tasks(reopened(query.replace("&tasks=pick,place", "") + "&tasks=pick,place", name), taken)


def test_a_known_task_can_be_put_back_and_a_new_one_stands_where_it_was_made():
    state = opened("pick_pour_place").move(x=0.6).choose_task("pour").choose_task("pick")
    state = state.add_task().move(x=0.7)
    again = reopened(query_of(state), "pick_pour_place")
    assert list(again.poses) == ["pick"]
    assert again.reset_pose().base.x == pytest.approx(0.7)
    put_back = again.choose_task("pick").reset_pose()
    assert put_back.base == opened("pick_pour_place").base


def test_a_link_that_would_be_too_long_to_be_read_is_not_made():
    state = opened("bottle_on_table")
    with pytest.raises(
        SymgraspError, match=r"link: length: \d+: expected at most 4000 .* save the scene instead"
    ):
        for _ in range(200):
            assert len(query_of(state)) <= LONGEST
            parse_link(query_of(state))
            state = state.add_task()


def test_a_link_that_is_shown_is_marked_once_something_else_is_shown():
    state = opened("pick_pour_place")
    camera = (1.0, 0.5, 0.7, 0.1, 0.0, 0.25)
    assert link_html(state) == ""
    state = state.linked("http://here/?scene=<script>", camera)
    assert "<script>" not in link_html(state)
    assert EARLIER not in link_html(state)
    assert EARLIER not in link_html(state.seen_from(camera).retry().failed("something"))
    for change in (
        lambda s: s.seen_from((1.1, *camera[1:])),
        lambda s: s.turn(0.1),
        lambda s: s.choose_task("pour").move(x=0.5).choose_task("pick"),
        lambda s: s.choose(0.1, 0.0),
        lambda s: s.choose_roll(RollChoice.ZERO),
        lambda s: replace(s, dark=True),
        lambda s: s.change_tasks(lambda tasks: tasks.shifted(1)),
        lambda s: s.move(x=0.51),
    ):
        assert EARLIER in link_html(change(state))
    assert EARLIER not in link_html(state.turn(0.1).turn(0.0))
    turned = remember(state, state.turn(0.1), "", 0.0)
    assert EARLIER in link_html(turned)
    assert EARLIER not in link_html(undo(turned))
    elsewhere = turned.seen_from((1.1, *camera[1:]))
    assert EARLIER in link_html(undo(elsewhere))
    assert elsewhere.seen_from((1.2, *camera[1:])) is elsewhere


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
        ("tasks=", "link: tasks: '': expected names with commas"),
        ('tasks="pick', "link: tasks: '\"pick': expected names with commas"),
        ("tasks=pick,pick", "link: tasks: 'pick': expected every name once"),
        ("tasks=pik", "link: tasks: 'pik': expected one of 'pick' .*did you mean 'pick'.*at.<task>"),
        ("tasks=pick,new", "link: tasks: 'new': expected one of 'pick'; a new task needs at.<task>"),
        ("tasks=new&at.new=1,2", "link: at.new: '1,2': expected six numbers"),
        ("tasks=new&at.new=1,2,3,4,5,6&task=pick", "task: 'pick': expected one of 'new'"),
        ("tasks=new&at.new=1,2,3,4,5,6&at.pick=1,2,3,4,5,6", "task: 'pick': expected one of 'new'"),
        ("tasks=pick,&at.=1,2,3,4,5,6", r"tasks\[1\]"),
        ("tasks=" + "x" * 101 + "&at." + "x" * 101 + "=1,2,3,4,5,6", r"tasks\[0\]"),
        ("arms.pick=none", "link: arms.pick: 'none': expected one of 'panda'"),
        ("arms.pick=panda,panda", "link: arms.pick: 'panda': expected every name once"),
        ("arms.pik=panda", "link: arms.pik: 'panda': expected arms of a task: one of 'pick'"),
        ("tasks=pick&arms.pick=", "link: arms.pick: '': expected names with commas"),
        ("tsk=pick", "link: tsk: 'pick': expected .*did you mean 'task'"),
        ("scene=" + "x" * 5000, "link: length: 5006: expected at most 4000 characters"),
    ],
)
def test_what_is_wrong_with_a_link_is_said_in_a_line(query, message):
    store = SharedCache("bottle_on_table")
    with pytest.raises(SymgraspError, match=message) as error:
        link = parse_link(query)
        scene, _ = store.linked(link)
        link.apply(State.of(scene, ""))
    assert "\n" not in str(error.value)


def test_what_viser_understands_is_left_to_it():
    assert parse_link("darkMode&initialCameraFov=1&websocket=x&turn=5").settings == {"turn": "5"}
