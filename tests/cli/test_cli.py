from __future__ import annotations

import copy
import json
import re
from importlib import resources
from typing import Any
from xml.etree import ElementTree

import jsonschema
import numpy as np
import pytest
import yaml

from docs.schemas import schemas
from symgrasp.cli import export
from symgrasp.cli.main import main
from symgrasp.feasibility.create import create_map
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.files import SCENES_DIR
from symgrasp.motion.exports import MOTION_EXPORTS
from symgrasp.object.library import load_object
from symgrasp.plan.exports import EXPORTS
from symgrasp.plan.plan import Plan, plan_schema
from symgrasp.plan.writing import LAST_DIGIT
from symgrasp.planners.planning import plan_sequential
from symgrasp.scene.scene import Scene
from tests.conftest import SHIPPED, write_scene
from tests.hostile import chain_urdf, doubling_yaml
from tests.motion.recorded import recorded_plan


def test_scenes_lists_what_ships(capsys):
    assert main(["scenes"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == SHIPPED


def test_every_format_of_plans_can_be_asked_for():
    assert set(export.FORMATS) == {*EXPORTS, *MOTION_EXPORTS}


@pytest.mark.parametrize("ending", ["npz", "png", "svg", "json"])
def test_map_writes_every_format(small, tmp_path, capsys, ending):
    out = tmp_path / f"map.{ending}"
    assert main(["map", str(small), "--out", str(out)]) == 0
    text = capsys.readouterr().out
    assert "feasible" in text
    assert "96 cells" in text
    if ending == "npz":
        assert FeasibilityMap.load(out).reason.shape == (2, 6, 8)
    elif ending == "json":
        content = json.loads(out.read_text())
        assert len(content["reason"][1]) == len(content["h"]) == 6
        assert "FEASIBLE" in content["reasons"]
    else:
        assert out.read_bytes().startswith({"png": b"\x89PNG", "svg": b"<?xml"}[ending])


def test_plan_sequential_and_bimanual(tmp_path, capsys):
    for kind, scene in (("sequential", "soda_can"), ("bimanual", "log_two_robots")):
        out = tmp_path / f"{kind}.json"
        assert main(["plan", kind, scene, "--out", str(out)]) == 0
        plan = Plan.load(out)
        assert plan.kind == kind
        assert "holds at h =" in capsys.readouterr().out
        jsonschema.validate(json.loads(out.read_text()), plan_schema())


def test_plan_with_motion(tmp_path, capsys):
    """It is told part by part, it holds, a changed number is caught, and every export can be read."""
    scene = tmp_path / "scene.yaml"
    content = Scene.load("pick_pour_place").content
    content["map"] = {"heights": 12, "angles": 24, "redundancy": 8}
    scene.write_text(yaml.safe_dump(content))
    out = tmp_path / "plan.json"
    assert main(["plan", "sequential", str(scene), "--motion", "--out", str(out)]) == 0
    lines = capsys.readouterr().out.splitlines()
    parts = [line.split()[0] for line in lines if line.endswith("mm clear") and " s, " in line]
    assert parts[:4] == ["open", "reach", "approach", "close"]
    assert f"in {len(parts)} parts" in lines[-2]
    assert main(["verify", str(out)]) == 0
    plan = json.loads(out.read_text())
    jsonschema.validate(plan, plan_schema())
    plan["motion"]["segments"][1]["joints"]["panda"][3][2] += 0.01
    tampered = tmp_path / "tampered.json"
    tampered.write_text(json.dumps(plan))
    assert main(["verify", str(tampered)]) == 1
    assert "motion.segments[1] (reach)" in capsys.readouterr().out
    for kind in export.FORMATS:
        assert main(["export", kind, str(out), "--out", str(tmp_path / kind)]) == 0
    assert json.loads((tmp_path / "motion").read_text())["panda"]["trajectory"]["points"]
    assert ElementTree.parse(tmp_path / "srdf").getroot().tag == "robot"
    assert (tmp_path / "motion-csv").read_text().startswith("time,")
    assert "<html" in (tmp_path / "html").read_text()[:200]


@pytest.fixture(scope="module")
def can_plan() -> dict[str, Any]:
    """Return the content of a plan of one task."""
    scene = Scene.load("soda_can").content
    scene["map"] = {"heights": 6, "angles": 12, "redundancy": 4}
    return json.loads(plan_sequential(Scene.from_content(scene)).to_json())


@pytest.mark.parametrize("kind", ["csv", "trajectory", "tsr"])
def test_a_plan_that_does_not_hold_is_not_exported(kind, can_plan, tmp_path, capsys):
    """A turn of one joint is told as `verify` tells it, and a file that was there stays."""
    path, out = tmp_path / "plan.json", tmp_path / "out"
    out.write_text("before")
    bent = copy.deepcopy(can_plan)
    joints = bent["tasks"][0]["holds"][0]["joints"]
    joints[next(iter(joints))] += 0.05
    path.write_text(json.dumps(bent))
    assert main(["verify", str(path)]) == 1
    said = capsys.readouterr().out
    assert main(["export", kind, str(path), "--out", str(out)]) == 1
    assert capsys.readouterr().out == f"{said}nothing is written to {out}\n"
    assert out.read_text() == "before"
    path.write_text(json.dumps(can_plan))
    assert main(["export", kind, str(path), "--out", str(out)]) == 0
    assert out.read_text() != "before"


def test_a_motion_that_does_not_hold_is_not_exported(tmp_path, capsys):
    content = json.loads(recorded_plan().to_json())
    del content["motion"]["segments"][1]
    path, out = tmp_path / "plan.json", tmp_path / "out"
    path.write_text(json.dumps(content))
    assert main(["export", "motion", str(path), "--out", str(out)]) == 1
    assert "motion.segments[1]" in capsys.readouterr().out
    assert not out.exists()


def test_ctrl_c_while_a_motion_is_planned_leaves_no_file(monkeypatch, tmp_path, capsys):
    asked = []

    def interrupted(motion, progress):
        asked.append(motion)
        raise KeyboardInterrupt

    monkeypatch.setattr("symgrasp.motion.choosing.timed", interrupted)
    out = tmp_path / "plan.json"
    assert main(["plan", "sequential", "soda_can", "--motion", "--out", str(out)]) == 130
    assert asked
    assert "cancelled" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("command", "option"),
    [
        (["map", "soda_can"], "--out"),
        (["grid", "soda_can"], "--out"),
        (["object", "wine_bottle"], "--fit"),
        (["place", "soda_can"], "--picture"),
        (["success", "soda_can"], "--plan"),
        (["survey", "show", "no.zarr"], "--out"),
    ],
    ids=lambda words: " ".join(words) if isinstance(words, list) else words,
)
def test_a_file_that_cannot_be_written_is_refused_by_its_option_before_anything_is_computed(
    command, option, tmp_path, capsys
):
    for name, said in (("a.xyz", "expected an ending: one of"), ("no/a.png", "a file in an existing folder")):
        assert main([*command, option, str(tmp_path / name)]) == 2
        error = capsys.readouterr().err
        assert f"command line: {option}: " in error
        assert said in error
    assert list(tmp_path.iterdir()) == []


def test_object_of_the_library_and_from_a_mesh(tmp_path, capsys):
    assert (
        main(["object", "wine_bottle", "--out", str(tmp_path / "a.png"), "--fit", str(tmp_path / "b.png")])
        == 0
    )
    text = capsys.readouterr().out
    assert "wine_bottle: 30.00 cm tall" in text
    assert "franka holds it" in text
    assert all((tmp_path / name).read_bytes().startswith(b"\x89PNG") for name in ("a.png", "b.png"))
    mesh = tmp_path / "bottle.stl"
    Scene.load("soda_can").profile.mesh().apply_scale(1000).export(mesh)
    assert main(["object", str(mesh)]) == 2
    assert "; scale 0.001 would make it" in capsys.readouterr().err
    assert main(["object", str(mesh), "--scale", "0.001"]) == 0
    text = capsys.readouterr().out
    assert "11.50 cm tall" in text
    assert "symmetry error" in text
    assert main(["object", "wine_bottel"]) == 2
    assert "did you mean 'wine_bottle'" in capsys.readouterr().err


def test_tolerance_and_flip_of_a_mesh(tmp_path, capsys):
    mesh = tmp_path / "bottle.stl"
    oval = load_object("wine_bottle")[1].mesh()
    oval.vertices[:, 0] *= 1.2
    oval.export(mesh)
    assert main(["object", str(mesh)]) == 2
    refusal = capsys.readouterr().err
    accepts = re.search(r"--tolerance ([\d.]+)", refusal)
    assert accepts, refusal
    assert main(["object", str(mesh), "--tolerance", accepts[1]]) == 0
    upright = capsys.readouterr().out
    assert f"{1e3 * float(accepts[1]):.2f} mm allowed" in upright
    assert main(["object", str(mesh), "--tolerance", accepts[1], "--flip"]) == 0
    flipped = capsys.readouterr().out
    assert "axis in the file     (0.0000, 0.0000, 1.0000)" in upright.replace("-0.0000", "0.0000")
    assert "axis in the file     (0.0000, 0.0000, -1.0000)" in flipped.replace("-0.0000", "0.0000")
    for value in ("0", "-0.1", "nan", "inf"):
        assert main(["object", str(mesh), f"--tolerance={value}"]) == 2
        assert "bottle.stl: tolerance: " in (error := capsys.readouterr().err)
        assert "a length in metres above zero" in error
    for options in (["--flip"], ["--tolerance", "0.01"], ["--scale", "0.1"]):
        assert main(["object", "wine_bottle", *options]) == 2
        assert f"object: {options[0][2:]}: 'wine_bottle': expected a mesh" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["scene", "plan", "survey"])
def test_schemas_are_schemas(name, capsys):
    assert main(["schema", name]) == 0
    printed = capsys.readouterr().out
    assert printed == schemas()[name], "make schemas"
    schema = json.loads(printed)
    jsonschema.Draft202012Validator.check_schema(schema)
    version = schema["properties"]["schema_version"]
    assert version.get("enum", [version.get("const")])[0] == 1
    shipped = resources.files("symgrasp") / "schemas" / f"{name}.schema.json"
    assert shipped.read_text(encoding="utf-8") == printed


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["map", "no_such_scene"], "expected one of 'bottle_on_table'"),
        (["map", "missing.yaml"], "missing.yaml"),
        (["map", "soda_can", "--task", "pikc"], "did you mean 'pick'"),
        (["map", "soda_can", "--arm", "left"], "expected one of 'panda'"),
        (["map", "soda_can", "--out", "map.gif"], "'.npz'"),
        (["map", "soda_can", "--out", "no/such/folder/map.npz"], "existing folder"),
        (
            ["plan", "sequential", "soda_can", "--out", "p.json", "--method", "exact"],
            "'best', 'first', 'regrasp'",
        ),
        (["plan", "bimanual", "soda_can", "--out", "p.json"], "two or more arms"),
        (["plan", "sequential", "log_two_robots", "--out", "p.json"], "does alone"),
        (["explain", "soda_can", "--h", "60", "--theta", "0"], "command line: --h: 60.0: expected within ["),
    ],
)
def test_bad_input_is_one_line_and_status_2(arguments, message, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert message in captured.err
    assert captured.err.count("\n") == 1
    assert captured.out == ""
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("command", "name", "expected"),
    [("map", "plan.json", "a scene: a file that ends in .yaml"), ("verify", "a.yaml", "a plan: a JSON file")],
)
def test_a_file_of_another_kind_is_told_from_a_damaged_one(command, name, expected, tmp_path, capsys):
    (tmp_path / name).write_text("{}")
    assert main([command, str(tmp_path / name)]) == 2
    error = capsys.readouterr().err
    assert f"{tmp_path / name}: file: " in error
    assert f"expected {expected}" in error


@pytest.mark.parametrize(
    ("command", "name", "text", "limit"),
    [
        ("map", "a.yaml", doubling_yaml(12), "more than 100,000 values"),
        ("map", "a.yaml", " " * 1_000_001, "more than 1 MB"),
        ("object", "a.yaml", doubling_yaml(12, merged=True), "more than 100,000 values"),
        ("object", "a.yaml", f"name: a\nprofile: {[[k, 1] for k in range(10_001)]}", "at most 10,000 knots"),
        ("hand", "a.urdf", chain_urdf(2000), "two or more fingers, or --tool for one jaw"),
        ("hand", "a.urdf", chain_urdf(5001), "at most 5,000 of them"),
        ("verify", "a.json", "[" * 1_000_000, "recursion"),
        ("verify", "a.json", " " * 5_000_001, "more than 5 MB"),
    ],
    ids=lambda value: value[:20],
)
def test_a_hostile_file_is_one_line_that_names_the_limit(command, name, text, limit, tmp_path, capsys):
    path = tmp_path / name
    path.write_text(text)
    assert main([command, str(path)]) == 2
    captured = capsys.readouterr()
    assert captured.err.startswith(f"symgrasp: {tmp_path.anchor}")
    assert f"{name}: " in captured.err
    assert limit in captured.err
    assert captured.err.count("\n") == 1
    assert captured.out == ""


def test_an_object_inside_an_obstacle(content, tmp_path, capsys):
    content["tasks"][0]["pose"]["position"] = [0.55, 0, -0.02]
    path = write_scene(tmp_path, content)
    assert main(["map", str(path), "--out", str(tmp_path / "map.npz")]) == 2
    assert "bottle is 20.0 mm inside table" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == [path]


def test_no_plan_is_status_1_and_leaves_no_file(content, tmp_path, capsys):
    content["map"] = {"heights": 2, "angles": 2, "redundancy": 1, "margin": 0.2}
    path = write_scene(tmp_path, content)
    assert main(["plan", "sequential", str(path), "--out", str(tmp_path / "plan.json")]) == 1
    assert "no grasp" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == [path]


def test_an_existing_file_survives_a_failure(content, tmp_path):
    out = tmp_path / "plan.json"
    out.write_text("precious")
    assert main(["plan", "bimanual", "soda_can", "--out", str(out)]) == 2
    assert out.read_text() == "precious"


def test_long_values_are_shortened_in_the_middle(tmp_path, capsys):
    folder = tmp_path / ("deep" * 60)
    folder.mkdir()
    path = folder / ("s" * 200 + ".yaml")
    path.write_text("schema_version: 1\nname: " + "n" * 5000)
    assert main(["map", str(path)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert len(line) <= 300
    assert line.startswith("symgrasp: " + str(path)[:20])
    assert "…" in line
    assert "expected" in line


@pytest.mark.parametrize("command", ["map", "explain", "plan", "verify", "export", "hand", "app"])
def test_every_command_that_reads_a_scene_or_a_urdf_takes_packages(command, capsys, tmp_path):
    with pytest.raises(SystemExit):
        main([command, "--package", f"arms={tmp_path / 'missing'}"])
    assert "missing': expected NAME=DIR, with an existing folder" in capsys.readouterr().err


def test_a_package_that_an_option_names(content, tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("SYMGRASP_PACKAGES", "")
    content["map"] = {"heights": 2, "angles": 4, "redundancy": 2}
    content["obstacles"].append(
        {"name": "rock", "mesh": "package:///stones/a%20rock.obj", "pose": {"position": [0, 3, 0]}}
    )
    (tmp_path / "a rock.obj").write_bytes((SCENES_DIR / "bowl.obj").read_bytes())
    scene = tmp_path / "scene" / "scene.yaml"
    scene.parent.mkdir()
    scene.write_text(yaml.safe_dump(content))
    assert main(["map", str(scene)]) == 2
    assert "no package 'stones' in --package" in capsys.readouterr().err
    assert main(["map", str(scene), "--package", f"stones={tmp_path}"]) == 0
    (found,) = (o for o in Scene.load(scene).file.obstacles if o.name == "rock")
    assert found.mesh == str(tmp_path / "a rock.obj")


def test_a_map_in_the_colours_of_its_windows(tmp_path, capsys):
    pictures = {}
    for color in ("reason", "elbow-window"):
        out = tmp_path / f"{color}.png"
        assert main(["map", "soda_can", "--color-by", color, "--out", str(out)]) == 0
        assert ("widest elbow window of a feasible cell: " in capsys.readouterr().out) == (color != "reason")
        pictures[color] = out.read_bytes()
    assert pictures["reason"] != pictures["elbow-window"]
    assert main(["map", "ur5_bottle", "--color-by", "elbow-window"]) == 2  # its arm has six joints
    assert "expected one of seven joints" in capsys.readouterr().err


def test_a_map_says_what_its_infeasible_cells_rest_on(content, tmp_path, capsys):
    content["map"] = {"heights": 6, "angles": 12}
    scene = str(write_scene(tmp_path, content))
    out = tmp_path / "map.json"
    assert main(["map", scene, "--out", str(out)]) == 0
    said = re.search(
        r"(\S+) % of the infeasible cells are proven to be, the others to (\S+) rad", _printed(capsys)
    )
    written = json.loads(out.read_text())
    reason, proven = np.array(written["reason"]), np.array(written["proven"])
    infeasible = reason != written["reasons"].index("FEASIBLE")
    assert said
    assert float(said[1]) == pytest.approx(100 * proven.sum() / infeasible.sum(), abs=0.05)
    assert float(said[2]) == pytest.approx(written["resolution"], rel=0.5)
    assert 0 < written["resolution"] < 0.01
    assert main(["map", scene, "--redundancy", "5"]) == 0
    assert "infeasible cells are proven" not in _printed(capsys)
    roll, row, column = np.argwhere(
        infeasible & ~proven & (reason > written["reasons"].index("UNREACHABLE"))
    )[0]
    where = ["--h", str(written["h"][row]), "--theta", str(np.rad2deg(written["theta"][column]))]
    assert main(["explain", scene, *where, "--roll", str(180 * roll)]) == 0
    assert "that none is feasible rests on a search of the redundancy to " in _printed(capsys)


def test_a_map_says_what_is_proven_of_whole_cells_and_of_the_area(content, tmp_path, capsys):
    content["map"] = {"heights": 6, "angles": 12, "redundancy": 4, "resolution": {"mm": 15, "deg": 10}}
    out = tmp_path / "map.json"
    assert main(["map", str(write_scene(tmp_path, content)), "--out", str(out)]) == 0
    printed = _printed(capsys)
    m = create_map(Scene.from_content(content))
    assert m.certified is not None and m.refined is not None
    for what, these in (("feasible", m.feasible), ("infeasible", ~m.feasible)):
        assert f"{(m.certified & these).sum()} of {these.sum()} {what} cells (" in printed
    assert f"feasible area, with cells split to parts: {m.refined.area}" in printed
    assert 0 < m.refined.area.least < m.refined.area.most < 1
    written = json.loads(out.read_text())
    assert written["certified"] == m.certified.tolist()
    assert written["refined"]["area"] == {
        "feasible": m.refined.area.share,
        "least": m.refined.area.least,
        "most": m.refined.area.most,
    }


def test_verify_pins_a_scene_and_lets_no_number_be_overstated(can_plan, tmp_path, capsys):
    plan, scene = tmp_path / "plan.json", tmp_path / "scene.yaml"
    plan.write_text(json.dumps(can_plan))
    scene.write_text(yaml.safe_dump(can_plan["scene"]["content"]))
    assert main(["verify", str(plan), "--scene", str(scene), "--strict"]) == 0
    assert "the plan holds" in _printed(capsys)
    assert main(["verify", str(plan), "--scene", "soda_can"]) == 1
    assert f"scene: map.heights is 6, but 24 in {Scene.load('soda_can').source}" in _printed(capsys)
    over = copy.deepcopy(can_plan)
    over["tasks"][0]["holds"][0]["limit_slack"] += 2 * LAST_DIGIT  # it is rounded down to at least one below
    plan.write_text(json.dumps(over))
    assert main(["verify", str(plan)]) == 0
    assert main(["verify", str(plan), "--strict"]) == 1
    assert "from a limit, not" in _printed(capsys)


def _printed(capsys) -> str:
    """Return what was printed, however wide the console is."""
    return " ".join(capsys.readouterr().out.split())
