"""Survey files are read completely or not at all; batches cover all points once."""

from __future__ import annotations

import gc
import shutil
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
import yaml
from distributed import Client, LocalCluster
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.backends.backend_agg import FigureCanvasAgg

from symgrasp.cli.main import main
from symgrasp.errors import InputError, SurveyError, SymgraspError
from symgrasp.feasibility.create import MapMaker
from symgrasp.object.library import load_object
from symgrasp.poses import from_position_rpy
from symgrasp.robot.hand import HANDS
from symgrasp.scene.scene import Scene
from symgrasp.survey.evaluation import Evaluator, State
from symgrasp.survey.format import NumberAxis, SurveyFile
from symgrasp.survey.pictures import draw_survey
from symgrasp.survey.results import problems
from symgrasp.survey.running import run_on
from symgrasp.survey.shipped import list_surveys, shipped_surveys
from symgrasp.survey.store import create_store, open_results
from symgrasp.survey.success import PoseNoise, success_map
from symgrasp.survey.survey import Axis, Survey
from symgrasp.world import open_world
from tests.conftest import load_small

X = {"name": "x", "of": "position.x", "from": 0.4, "to": 0.6, "count": 3}
TWO_FINGERS = {"name": "two", "links": ["a"], "touch_links": ["a"], "joints": {"a": 1}, "min_opening": 0}
SMALL = {"schema_version": 1, "name": "small", "scene": "pick_pour_place"}


def survey_of(axes: list, folder: Path, **keys) -> Survey:
    path = folder / "survey.yaml"
    path.write_text(yaml.safe_dump({**SMALL, "axes": axes, **keys}))
    return Survey.load(path)


def test_every_shipped_survey_loads():
    assert set(list_surveys()) == set(shipped_surveys())
    assert len(list_surveys()) >= 3
    for name, description in list_surveys().items():
        survey = Survey.load(name)
        assert description
        assert survey.file.name == name
        assert Survey.from_dict(survey.to_dict()).sha256 == survey.sha256


@pytest.mark.parametrize(
    ("axis", "message"),
    [
        ({"name": "x", "of": "position.x"}, "either values, or all of from, to and count"),
        ({**X, "values": [1]}, "either values"),
        ({"name": "x", "of": "position.x", "values": [0.5, 0.5]}, "values that differ"),
        ({"name": "x", "of": "position.x", "values": ["0.10", 0.1]}, "values that differ"),
        ({"name": "x", "of": "position.x", "values": [0, -0.0]}, "values that differ"),
        ({"name": "d", "of": "base.yaw_deg", "values": [-180, 180]}, "values that differ"),
        ({"name": "d", "of": "base.yaw_deg", "from": 0, "to": 360, "count": 5}, "values that differ"),
        ({"name": "p", "of": "position", "values": [[0.1, 0, 0], ["0.10", 0, -0.0]]}, "values that differ"),
        ({"name": "t", "of": "task", "values": ["pick", "pick"]}, "values that differ"),
        ({**X, "count": True}, "axes[0].count: true: expected a whole number"),
        ({**X, "step": 1}, "axes[0].step"),
        ({**X, "name": "share"}, "unlike"),
        ({**X, "of": "obstacles.tabel.pose.position.2"}, "did you mean 'table'"),
        ({**X, "of": "obstacles.table.box"}, "number"),
        ({**X, "of": "obstacles.table.name"}, "number"),
        ({"name": "x", "of": "obstacles.table.box.0", "values": [-1]}, "greater than 0"),
        ({**X, "of": "tasks.pick.pose.rpy_deg.2"}, "a shift"),
        ({**X, "of": "map.heights"}, "one grid"),
        ({**X, "of": "direction_deg"}, "tilt_deg along with direction_deg"),
        ({**X, "of": "base.x", "robot": "pandas"}, "did you mean 'panda'"),
        ({**X, "robot": "panda"}, "a robot only with"),
        ({"name": "t", "of": "task", "values": ["pick", "por"]}, "did you mean 'pour'"),
        (
            {"name": "o", "of": "object", "values": ["wine_botle"]},
            "axes[0].values[0]: 'wine_botle': expected",
        ),
        ({"name": "o", "of": "object", "values": ["wine_botle"]}, "did you mean 'wine_bottle'"),
        (
            {"name": "o", "of": "object", "values": [{"name": "a", "profile": [[0, 0.1], [0, 0.2]]}]},
            "axes[0] (o): 'a': expected profile[1]: 0.0: expected a height above",
        ),
        (
            {"name": "o", "of": "object", "values": ["tumbler", {"name": "a", "mash": "a.stl"}]},
            "axes[0].values[1].mash: 'a.stl': expected a key of the file format",
        ),
        (
            {"name": "h", "of": "hand", "values": [TWO_FINGERS]},
            "axes[0].values[0].max_opening: nothing: expected a value; this key is required",
        ),
        ({"name": "o", "of": "object", "values": [3]}, "axes[0].values[0]: 3: expected a text"),
        ({"name": "o", "of": "object", "values": [{"name": "a", "mesh": "no.stl"}]}, "no.stl"),
        ({"name": "h", "of": "hand", "values": ["frank"]}, "did you mean 'franka'"),
        ({"name": "p", "of": "position", "values": [[0.1, 0.2]]}, "axes[0].values[0]"),
    ],
)
def test_a_wrong_axis_is_refused_in_one_line(axis, message, tmp_path):
    with pytest.raises(SymgraspError) as raised:
        survey_of([{k: v for k, v in axis.items() if v is not None}], tmp_path)
    assert message in str(raised.value)
    assert "survey.yaml" in str(raised.value)


def test_one_object_or_hand_under_two_names_is_told(tmp_path):
    """Products of a catalogue may be alike; each has its row, and that the rows are the same is said."""
    points = load_object("can_330ml")[1].points.tolist()
    same = {"name": "cola", "profile": points}
    heavy = {"name": "full", "profile": points, "mass": 0.35}
    objects = {"name": "o", "of": "object", "values": ["can_330ml", "tumbler", same, heavy]}
    franka = {k: v for k, v in asdict(HANDS["franka"]).items() if v and k != "tool"} | {"min_opening": 0}
    near = {**franka, "name": "shy", "clearance": 0.006}
    hands = {"name": "g", "of": "hand", "values": ["franka", {**franka, "name": "mine"}, near]}
    survey = survey_of([objects, hands], tmp_path)
    assert survey.notes == (
        "axes[0] (o): cola is the same as can_330ml",
        "axes[1] (g): mine is the same as franka",
    )
    assert survey.shape == (4, 3)


def test_the_command_line_says_what_is_wrong(tmp_path, capsys):
    assert main(["survey", "run", "table_raech", "--out", str(tmp_path / "a.zarr")]) == 2
    assert "did you mean 'table_reach'" in capsys.readouterr().err
    assert main(["survey", "show", str(tmp_path)]) == 2
    assert "a store written by symgrasp survey run" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("command", "message"),
    [
        (["place", "soda_can", "--step", "0.001"], "at most 1,000,000, 10,000 along a side"),
        (["place", "soda_can", "--z", "0", "9999"], "at most 1,000,000, 10,000 along a side"),
        (["place", "soda_can", "--yaw", "-360", "360"], "a full turn apart at most"),
        (["success", "soda_can", "--samples", "99999999999"], "a whole number from 1 to 100,000"),
        *(
            (["place", "soda_can", "--scheduler", address], "address")
            for address in ("foo", "", "tcp://", "tcp://a:b", "tcp://127.0.0.1:99999", "tls://127.0.0.1:1")
        ),
    ],
)
def test_what_would_never_end_or_begin_is_refused_in_one_line(command, message, capfd):
    try:
        status = main(command)
    except SystemExit as ended:
        status = ended.code
    gc.collect()  # a client that was never connected complains when it is thrown away
    assert status == 2
    assert message in capfd.readouterr().err.replace("\n", " ")


def test_maps_of_too_many_draws_are_refused():
    scene = load_small("bottle_on_table", 2, 4, 1)
    with (
        open_world(scene) as world,
        pytest.raises(InputError, match="at most 62,500,000 for maps of 16 cells"),
    ):
        success_map(MapMaker(world), "panda", scene.task(), PoseNoise(0.01), count=10**8)


def test_axes_change_what_they_say(tmp_path):
    axes = [
        {"name": "task", "of": "task", "values": ["pick", "place"]},
        {"name": "tilt", "of": "tilt_deg", "values": [30]},
        {"name": "side", "of": "direction_deg", "values": [0, 90]},
        {"name": "table", "of": "obstacles.table.pose.position.2", "values": [-0.1]},
        {"name": "object", "of": "object", "values": ["tumbler", {"name": "can", "library": "can_330ml"}]},
        {"name": "yaw", "of": "base.yaw_deg", "values": [45]},
        {"name": "bx", "of": "base.x", "values": [0.05]},
        X,
    ]
    survey = survey_of(axes, tmp_path)
    point = (1, 0, 1, 0, 1, 0, 0, 2)
    scene = survey.scene_at(point)
    task = Evaluator(survey).task_at(point, scene)
    (table,) = [o for o in scene.obstacles if o.name == "table"]
    base = scene.robots["panda"].T_world_base
    assert task.name == "place"
    assert np.allclose(task.T_world_object[:3, 2], [0, 0.5, 0.75**0.5])
    assert np.allclose(task.T_world_object[:3, 3], [0.6, 0.32, 0.0])
    assert table.T_world_obstacle[2, 3] == -0.1
    assert scene.file.object.name == "can"
    assert np.allclose(base, from_position_rpy([0.05, 0, 0], [0, 0, np.pi / 4]))
    assert survey.scene.file.object.name == "bottle"


def test_points_that_cannot_be_are_told_apart(tmp_path):
    axes = [
        {"name": "bx", "of": "base.x", "values": [0.0, 0.3, 0.5]},
        {"name": "by", "of": "base.y", "values": [0.0, -0.45]},
        {"name": "y", "of": "position.y", "values": [-0.35, -0.2]},
    ]
    small = {"heights": 2, "angles": 4, "redundancy": 1}
    survey = survey_of(axes, tmp_path, keep_out=[{"x": [0.4, 0.6], "y": [-1, 1]}], map=small, task="pick")
    with Evaluator(survey) as evaluator:
        assert evaluator.point((0, 0, 0)).state == State.COMPUTED
        assert evaluator.point((1, 1, 0)).state == State.ROBOT_BLOCKED  # the wall is there
        assert evaluator.point((2, 0, 0)).state == State.KEPT_OUT


def test_the_object_may_not_be_inside_anything(tmp_path):
    axes = [{"name": "p", "of": "position", "values": [[0.62, 0.48, 0.0], [0.45, -0.35, 0.0]]}]
    survey = survey_of(axes, tmp_path, map={"heights": 2, "angles": 4, "redundancy": 1}, task="pick")
    with Evaluator(survey) as evaluator:
        assert evaluator.point((0,)).state == State.OBJECT_BLOCKED
        assert evaluator.point((1,)).state == State.COMPUTED


@given(st.lists(st.tuples(st.integers(2, 12), st.booleans()), min_size=1, max_size=4))
def test_batches_cover_all_points_once(sizes):
    axes, paths = [], iter(("position.x", "position.y", "position.z", "tilt_deg"))
    for k, (count, moves) in enumerate(sizes):
        of = next(paths) if moves else f"obstacles.{k}.box.0"
        axes.append(NumberAxis(name=f"a{k}", of=of, from_=0.1, to=1.0, count=count))
    file = SurveyFile(schema_version=1, name="a", scene="a", axes=tuple(axes))

    resolved = tuple(Axis(a.name, a, a.numbers(), a.numbers()) for a in axes)
    survey = Survey("a", file, None, resolved)  # pyright: ignore[reportArgumentType]
    points = [point for batch in range(survey.batches) for point in survey.points_of(batch)]
    assert sorted(points) == list(np.ndindex(survey.shape))
    assert max(len(list(survey.points_of(batch))) for batch in range(survey.batches)) <= 64


TABLE = "obstacles.table.pose.position.2"


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (TABLE, TABLE),
        (TABLE, "obstacles.{table}.pose.position.2"),
        ("base.x", "robots.panda.base.position.0"),
        ("base.x", "robots.0.base.position.0"),
        ("position.y", "tasks.pick.pose.position.1"),
        ("position.y", "tasks.0.pose.position.1"),
        ("object", "object.profile.0.0"),
        ("position", "position.z"),
        ({"of": "base.x", "robot": "panda"}, "base.x"),
        ({"of": "hand", "arm": "panda"}, "hand"),
    ],
)
def test_one_number_is_on_one_axis(one, other, tmp_path):
    scene = Scene.load(SMALL["scene"])
    index = [o.name for o in scene.obstacles].index("table")
    values = {
        "object": ["wine_bottle"],
        "hand": ["franka"],
        "position": [[0.5, 0, 0]],
        "object.profile.0.0": [0],
    }
    axes = []
    for k, axis in enumerate((one, other)):
        own = axis if isinstance(axis, dict) else {"of": axis.format(table=index)}
        axes.append({"name": f"a{k}", "values": values.get(own["of"], [0.1]), **own})
    with pytest.raises(SurveyError, match=r"axes\[1\].of .*no other axis varies, such as axes\[0\]"):
        survey_of(axes, tmp_path)


def test_values_that_do_not_go_together_are_recorded(tmp_path, capsys):
    """Each number is fine, both together are not: that point says why, and the others are computed."""
    axes = [
        {"name": "low", "of": "object.profile.0.0", "values": [0.0, 0.1]},
        {"name": "high", "of": "object.profile.1.0", "values": [0.05, 0.15]},
    ]
    small = {"heights": 2, "angles": 4, "redundancy": 1}
    survey = survey_of(axes, tmp_path, scene="bottle_on_table", map=small)
    out = tmp_path / "a.zarr"
    cluster: Any = LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=":0")
    with cluster, Client(cluster, set_as_default=False) as client:
        run_on(client, survey, out)
    _, results = open_results(out)
    states = [[State.COMPUTED, State.COMPUTED], [State.UNUSABLE, State.COMPUTED]]
    assert results.state.values.tolist() == states
    (told,) = problems(results)
    assert "a height above the one before it" in told
    assert main(["survey", "show", str(out), "--out", str(tmp_path / "a.png")]) == 0
    shown = capsys.readouterr().out
    assert "1 whose values do not go together" in shown
    assert told in shown
    assert create_store(out, survey).missing() == []


def test_a_store_of_version_1_is_gone_on_with(tmp_path):
    """It has no reasons why values do not go together; the rest is as in version 2."""
    survey = survey_of([X], tmp_path, map={"heights": 2, "angles": 4, "redundancy": 1}, task="pick")
    out = tmp_path / "a.zarr"
    create_store(out, survey)
    shutil.rmtree(out / "problem")
    path = out / "zarr.json"
    path.write_text(path.read_text().replace('"version": 2', '"version": 1'))
    store = create_store(out, survey)
    with Evaluator(survey) as evaluator:
        for batch in store.missing():
            store.write(batch, {p: evaluator.point(p) for p in survey.points_of(batch)})
    assert store.missing() == []
    assert list(problems(open_results(out)[1])) == []
    path.write_text(path.read_text().replace('"version": 1', '"version": 3'))
    with pytest.raises(SurveyError, match="expected 1 or 2"):
        open_results(out)


@pytest.mark.parametrize("count", [1, 3])
def test_labels_are_not_cut_off(tmp_path, count):
    """That of a workspace is longer than a small picture is high."""
    axes = [X, {"name": "y", "of": "position.y", "values": [0.1 * k for k in range(count)]}]
    label = "feasible angles of the grasp at 10.0 cm, roll 180° (%)"
    values = xr.DataArray(np.ones((3, count)), dims=("x", "y"), attrs={"label": label})
    figure = draw_survey(survey_of(axes, tmp_path), values)
    FigureCanvasAgg(figure).draw()
    shown = [panel.yaxis.label for panel in figure.axes if "feasible" in panel.get_ylabel()]
    assert [" ".join(own.get_text().split()) for own in shown] == [label]
    box = shown[0].get_window_extent()
    assert 0 <= box.x0 < box.x1 <= figure.bbox.width
    assert 0 <= box.y0 < box.y1 <= figure.bbox.height


def test_a_plan_of_a_kind_that_the_scene_has_not_is_refused(tmp_path):
    with pytest.raises(SymgraspError, match="several arms"):
        survey_of([X], tmp_path, plan="handover")
    with pytest.raises(SurveyError, match="either task"):
        survey_of([{"name": "t", "of": "task", "values": ["pick"]}], tmp_path, task="pour")


def test_the_file_of_a_hand_is_part_of_a_survey(tmp_path):
    """Results with another gripper than that of before are not mixed with its own."""
    text = (Path(__file__).parents[2] / "static_scenes/hands/wsg50.urdf").read_text()
    (tmp_path / "hand.urdf").write_text(text)
    fingers = ["wsg50_left_finger", "wsg50_right_finger"]
    hand = {
        "name": "mine", "urdf": "hand.urdf", "links": ["wsg50_base", *fingers], "touch_links": fingers,
        "joints": {"wsg50_joint": 0.5}, "min_opening": 0, "max_opening": 0.11, "finger_depth": 0.067,
        "pad_width": 0.0203, "palm_width": 0.05, "palm_depth": 0.076, "tool": {"link": "wsg50_tool"},
    }  # fmt: skip
    axes = [{"name": "hand", "of": "hand", "values": ["wsg50", hand]}]
    before = survey_of(axes, tmp_path, scene="ur5_bottle").sha256
    assert survey_of(axes, tmp_path, scene="ur5_bottle").sha256 == before
    larger = text.replace('scale="0.001 0.001 0.001"', 'scale="0.0012 0.0012 0.0012"')
    assert larger != text
    (tmp_path / "hand.urdf").write_text(larger)
    assert survey_of(axes, tmp_path, scene="ur5_bottle").sha256 != before
