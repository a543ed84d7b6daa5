"""Survey files are read completely or not at all; batches cover all points once."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from symgrasp.cli.main import main
from symgrasp.errors import SurveyError, SymgraspError
from symgrasp.poses import from_position_rpy
from symgrasp.survey.evaluation import Evaluator, State
from symgrasp.survey.format import NumberAxis, SurveyFile
from symgrasp.survey.shipped import list_surveys, shipped_surveys
from symgrasp.survey.survey import Axis, Survey

X = {"name": "x", "of": "position.x", "from": 0.4, "to": 0.6, "count": 3}
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
        ({"name": "o", "of": "object", "values": ["wine_botle"]}, "did you mean 'wine_bottle'"),
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


def test_the_command_line_says_what_is_wrong(tmp_path, capsys):
    assert main(["survey", "run", "table_raech", "--out", str(tmp_path / "a.zarr")]) == 2
    assert "did you mean 'table_reach'" in capsys.readouterr().err
    assert main(["survey", "show", str(tmp_path)]) == 2
    assert "a store written by symgrasp survey run" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


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
