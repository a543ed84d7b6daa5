"""Links: what is shown goes into an address and comes back."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.choices.object_choice import from_library
from app.choices.uploaded_scene import UploadedScene
from app.compute.cache import SharedCache
from app.files.links import LONGEST, Link
from app.panels.files_panel import link_html
from app.state import changes, job_changes
from app.state.map_view_state import RollChoice
from app.state.object_pose import ObjectPose
from app.state.state import Pick, State
from app.state.task_list import TaskList
from app.state.undo import remember, undo
from symgrasp.errors import SymgraspError
from symgrasp.feasibility.color_by import ColorBy
from symgrasp.scene.scene import Scene
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
    return Link.of(state, load_small(state.scene_name), camera).query()


def reopened(query: str, name: str) -> State:
    link = Link.parse(query)
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
    state = changes.choose_roll(opened(name), roll)
    for moved, pose in poses.items():
        state = changes.moved(changes.choose_task(state, moved), **pose)
    flat_map, gizmo, dark = switches
    state = changes.turn(changes.choose_task(state, task), delta)
    state = changes.switched(state, flat_map=flat_map, drag_handles=gizmo, dark=dark)
    state = replace(state, map_view=replace(state.map_view, color_by=view))
    if pick:
        state = replace(state, pick=Pick(*pick))
    again = reopened(query_of(state), name)
    assert (again.task, again.arm, again.map_view.roll) == (state.task, state.arm, state.map_view.roll)
    assert (again.display.flat_map, again.display.drag_handles, again.display.dark) == (flat_map, gizmo, dark)
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
    state = changes.turn(changes.moved(opened("soda_can"), x=0.5), np.deg2rad(30))
    assert "&turn=30" in query_of(state)
    assert "&at.pick=50," in query_of(state)
    query = query_of(opened("soda_can"), (1.0, 0.5, 0.7, 0.1, 0.0, 0.25))
    assert query == "scene=soda_can&task=pick&arm=panda&camera=1.000,0.500,0.700,0.100,0.000,0.250"
    assert Link.parse(query).camera == (1.0, 0.5, 0.7, 0.1, 0.0, 0.25)


def test_objects_of_the_library_and_hands_come_back():
    cache = SharedCache("log_iiwa_and_panda")
    scene, object_choice = cache.linked(Link.parse("object=log_70mm&hand.iiwa=pr2"), Scene.with_hand)
    assert scene.replaceable_hands["iiwa"] == "pr2"
    assert object_choice
    assert object_choice.option == "log_70mm"
    state = replace(State.of(scene, "log_iiwa_and_panda"), object_choice=object_choice)
    link = Link.of(state, cache.scene(state.scene_name)).query()
    again, _ = cache.linked(Link.parse(link), Scene.with_hand)
    assert again.sha256 == scene.sha256
    assert "tasks" not in link


def test_what_was_uploaded_is_in_no_link():
    scene = load_small("soda_can")
    state = changes.open_upload(State.of(scene, "soda_can"), UploadedScene("mine.yaml (upload)", scene))
    with pytest.raises(SymgraspError, match=r"link: scene: 'an upload': .*save the scene instead"):
        Link.of(state, scene)
    mesh = replace(from_library("log_70mm"), measurement=object())  # pyright: ignore[reportArgumentType]
    with pytest.raises(SymgraspError, match="link: object: 'an upload'"):
        Link.of(changes.choose_object(State.of(scene, "soda_can"), scene, mesh), scene)


# -- the list of tasks ----------------------------------------------------------------------

NAMES = st.sampled_from(
    ["pick", "pour", "a, b", '"', "<script>alert(1)</script>", "&at.pick=1", "mäh ✓"]
) | st.text(min_size=1, max_size=12)
EDITS = st.one_of(
    st.just(changes.add_task),
    st.just(lambda s: changes.change_tasks(s, TaskList.removed)),
    st.builds(lambda by: lambda s: changes.change_tasks(s, lambda t: t.shifted(by)), st.integers(-3, 3)),
    st.builds(lambda name: lambda s: changes.change_tasks(s, lambda t: t.renamed(name)), NAMES),
    st.builds(
        lambda k: lambda s: changes.choose_task(s, list(s.scene.tasks)[k % len(s.scene.tasks)]),
        st.integers(0, 9),
    ),
    st.builds(lambda pose: lambda s: changes.moved(s, **pose), POSES),
    st.builds(lambda delta: lambda s: changes.turn(s, delta), ANGLES),
    st.just(changes.reset_pose),
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
    swapped = changes.change_tasks(state, lambda tasks: tasks.shifted(1))
    assert query_of(swapped) == "scene=pick_pour_place&task=pick&arm=panda&tasks=pour,pick,place"
    renamed = changes.change_tasks(state, lambda tasks: tasks.renamed("a, b"))
    assert "&tasks=%22a,+b%22,pour,place&at.a,+b=" in query_of(renamed)
    assert "at.pour" not in query_of(renamed)
    back = changes.change_tasks(renamed, lambda tasks: tasks.renamed("pick"))
    assert query_of(back) == query_of(state)
    name = "handover_between_robots"
    taken = changes.change_tasks(
        changes.change_tasks(opened(name), TaskList.removed), lambda tasks: tasks.renamed("pick")
    )
    query = query_of(taken)
    assert "&tasks=pick,place&arms.pick=left,right&at.pick=" in query
    assert_same_tasks(reopened(query, name), taken)
    assert_same_tasks(reopened(query.replace("&tasks=pick,place", "") + "&tasks=pick,place", name), taken)


def test_a_known_task_can_be_put_back_and_a_new_one_stands_where_it_was_made():
    state = changes.choose_task(
        changes.choose_task(changes.moved(opened("pick_pour_place"), x=0.6), "pour"), "pick"
    )
    state = changes.moved(changes.add_task(state), x=0.7)
    again = reopened(query_of(state), "pick_pour_place")
    assert list(again.poses) == ["pick"]
    assert changes.reset_pose(again).base.x == pytest.approx(0.7)
    put_back = changes.reset_pose(changes.choose_task(again, "pick"))
    assert put_back.base == opened("pick_pour_place").base


def test_a_link_that_would_be_too_long_to_be_read_is_not_made():
    state = opened("bottle_on_table")
    with pytest.raises(
        SymgraspError, match=r"link: length: \d+: expected at most 4000 .* save the scene instead"
    ):
        for _ in range(200):
            assert len(query_of(state)) <= LONGEST
            Link.parse(query_of(state))
            state = changes.add_task(state)


def test_a_link_that_is_shown_is_marked_once_something_else_is_shown():
    state = opened("pick_pour_place")
    camera = (1.0, 0.5, 0.7, 0.1, 0.0, 0.25)
    assert link_html(state) == ""
    state = changes.linked(state, "http://here/?scene=<script>", camera)
    assert "<script>" not in link_html(state)
    assert EARLIER not in link_html(state)
    assert EARLIER not in link_html(
        job_changes.failed(job_changes.retried(changes.seen_from(state, camera)), "something")
    )
    for change in (
        lambda s: changes.seen_from(s, (1.1, *camera[1:])),
        lambda s: changes.turn(s, 0.1),
        lambda s: changes.choose_task(changes.moved(changes.choose_task(s, "pour"), x=0.5), "pick"),
        lambda s: changes.choose(s, 0.1, 0.0),
        lambda s: changes.choose_roll(s, RollChoice.ZERO),
        lambda s: changes.switched(s, dark=True),
        lambda s: changes.change_tasks(s, lambda tasks: tasks.shifted(1)),
        lambda s: changes.moved(s, x=0.51),
    ):
        assert EARLIER in link_html(change(state))
    assert EARLIER not in link_html(changes.turn(changes.turn(state, 0.1), 0.0))
    turned = remember(state, changes.turn(state, 0.1), "", 0.0)
    assert EARLIER in link_html(turned)
    assert EARLIER not in link_html(undo(turned))
    elsewhere = changes.seen_from(turned, (1.1, *camera[1:]))
    assert EARLIER in link_html(undo(elsewhere))
    assert changes.seen_from(elsewhere, (1.2, *camera[1:])) is elsewhere


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
        ("at.pick=1,2,x,4,5,6", "link: at.pick: 'x': expected a number"),
        ("at.pick=1,2,3,4,5,inf", "link: at.pick: 'inf': expected a number"),
        (
            "at.pick=1,2,3,4,5,6&at.pick=1,2,3,4,5,6",
            "link: at.pick: '1,2,3,4,5,6': expected every setting once",
        ),
        ("at=1,2,3,4,5,6", "link: at: '1,2,3,4,5,6': expected one of .*'at.<task>'"),
        ("hand=pr2", "link: hand: 'pr2': expected one of .*'hand.<arm>'"),
        ("task.pick=1", "link: task.pick: '1': expected one of"),
        ("h=5&theta=x", "link: theta: 'x': expected a number"),
        ("h=100001", "link: h: '100001': expected a number"),
        ("dark=true", "link: dark: 'true': expected one of '0', '1'"),
        ("view=x", "link: view: 'x': expected one of"),
        ("camera=1,2,3,4,5,1e6", "link: camera: '1e6': expected a number"),
        ("tsk=pick", "link: tsk: 'pick': expected .*did you mean 'task'"),
        ("scene=" + "x" * 5000, "link: length: 5006: expected at most 4000 characters"),
    ],
)
def test_what_is_wrong_with_a_link_is_said_in_a_line(query, message):
    cache = SharedCache("bottle_on_table")
    with pytest.raises(SymgraspError, match=message) as error:
        link = Link.parse(query)
        scene, _ = cache.linked(link, Scene.with_hand)
        link.apply(State.of(scene, ""))
    assert "\n" not in str(error.value)


def test_what_viser_understands_is_left_to_it():
    assert Link.parse("darkMode&initialCameraFov=1&websocket=x&turn=5") == Link(turn=5)


# -- the model ------------------------------------------------------------------------------

WORDS = st.none() | NAMES
CAMERAS = st.none() | st.tuples(*[st.floats(-1e4, 1e4)] * 6)
OBJECT_POSES = st.builds(ObjectPose, LENGTHS, LENGTHS, LENGTHS, st.floats(0, 3), ANGLES, ANGLES)
NAME_LISTS = st.lists(NAMES, min_size=1, max_size=3, unique=True)
GRASPS = st.just({}) | st.fixed_dictionaries(
    {"h": st.floats(-1e5, 1e5), "theta": st.floats(-180, 180), "side": st.none() | st.integers(0, 1)}
)


@given(
    st.fixed_dictionaries(
        {"scene": WORDS, "object": WORDS, "task": WORDS, "arm": WORDS, "camera": CAMERAS},
        optional={
            "hand": st.dictionaries(NAMES, NAMES, max_size=2),
            "tasks": st.none() | NAME_LISTS,
            "arms": st.dictionaries(NAMES, NAME_LISTS, max_size=2),
            "at": st.dictionaries(NAMES, OBJECT_POSES, max_size=2),
            "turn": st.floats(-360, 360),
            "roll": st.sampled_from(RollChoice),
            "view": st.sampled_from(ColorBy),
            "board": st.booleans(),
            "gizmo": st.booleans(),
            "dark": st.booleans(),
        },
    ),
    GRASPS,
)
def test_a_link_is_read_as_it_was_written(values, grasp):
    link = Link(**values, **grasp)
    query = link.query()
    assert Link.parse(query) == link
    assert Link.parse(query).query() == query


def test_settings_are_written_in_one_order():
    query = (
        "scene=two&object=log_70mm&hand.a=pr2&hand.b=wsg50&task=x&arm=a&tasks=x,y,z&at.x=1,2,3,4,5,6"
        "&arms.y=a,b&at.y=1.5,2,3,4,5,-6&arms.z=b&turn=30&roll=0°&view=clearance&board=0&gizmo=1&dark=1"
        "&camera=1.000,0.500,0.700,0.100,0.000,0.250&h=12&theta=-40&side=180"
    )
    assert Link.parse(query).query() == query.replace("°", "%C2%B0")
    assert Link.parse("&".join(reversed(query.split("&")))) == Link.parse(query)
    assert Link.parse("board=1&gizmo=0&dark=0&turn=0&roll=either&view=reason").query() == ""


def test_a_task_may_stand_behind_its_arm():
    name = "handover_between_robots"
    first, last = (load_small(name).tasks[task].arms[0] for task in ("pick", "place"))
    for query in (f"task=place&arm={last}", f"arm={last}&task=place"):
        state = Link.parse(query).apply(opened(name))
        assert (state.task, state.arm) == ("place", last)
    for query in (f"task=place&arm={first}", f"arm={first}&task=place"):
        with pytest.raises(SymgraspError, match=f"link: arm: '{first}': expected one of '{last}'"):
            Link.parse(query).apply(opened(name))


def test_an_angle_or_a_side_without_a_height_picks_nothing():
    assert Link.parse("theta=x&side=90") == Link()


def test_a_number_that_could_not_be_read_is_not_written():
    state = changes.moved(opened("soda_can"), x=1001.0)
    with pytest.raises(SymgraspError, match=r"^link: at.pick: '100100': expected a number$"):
        query_of(state)
    with pytest.raises(SymgraspError, match=r"^link: camera: 'nan': expected a number$"):
        query_of(opened("soda_can"), (np.nan, 0.0, 0.0, 0.0, 0.0, 0.0))
