"""Whatever things are called, every command prints it in lines that do nothing to a terminal."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import pytest
import yaml

from symgrasp.cli.main import main
from symgrasp.cli.shared import LONGEST_LINE
from symgrasp.compiling import COMPILING_MESSAGE
from symgrasp.errors import printable
from tests.conftest import write_scene
from tests.hands.test_finger_linkages import rooted
from tests.hostile_names import HOSTILE_NAMES

NAMES = pytest.mark.parametrize("name", HOSTILE_NAMES.values(), ids=HOSTILE_NAMES)


@pytest.fixture
def named(content, tmp_path):
    """Write the scene with given names for robot, object and obstacle; all else is called like the robot."""
    content["map"] = {"heights": 4, "angles": 8, "redundancy": 2}

    def write(robot: str, thing: str, obstacle: str) -> Path:
        content["name"] = content["robots"][0]["name"] = content["tasks"][0]["name"] = robot
        content["object"]["name"], content["obstacles"][0]["name"] = thing, obstacle
        content["obstacles"], content["tasks"] = content["obstacles"][:1], content["tasks"][:1]
        content["tasks"][0].pop("arms", None)
        return write_scene(tmp_path, content)

    return write


def checked(capsys: pytest.CaptureFixture[str]) -> str:
    """Return what was printed, after a look at every line of it."""
    captured = capsys.readouterr()
    for line in (captured.out + captured.err).split("\n"):
        assert line.isprintable()
    assert all(len(line) <= LONGEST_LINE for line in captured.err.split("\n"))
    return captured.out + captured.err


def outputs(scene: Path, capsys: pytest.CaptureFixture[str]) -> list[str]:
    """Run the commands that print names of a scene; return what each prints."""
    folder, plan = scene.parent, str(scene.parent / "plan.json")
    commands: list[list[str]] = [
        *(["map", str(scene), "--out", str(folder / f"map.{ending}")] for ending in ("png", "svg", "json")),
        ["explain", str(scene), "--h", "0.1", "--theta", "180"],
        ["plan", "sequential", str(scene), "--list", "2", "--out", plan],
        ["verify", plan],
        *(["export", kind, plan, "--out", str(folder / kind)] for kind in ("csv", "trajectory", "tsr")),
    ]
    printed = []
    for command in commands:
        assert main(command) == 0, (command, capsys.readouterr().err)
        printed.append(checked(capsys).replace(f"symgrasp: {COMPILING_MESSAGE} …\n", ""))
    return printed


@NAMES
def test_names_of_a_scene(name, named, capsys):
    plain, names = ("Alice", "Bob", "Carol"), (name, name[1:] + "2", name[1:] + "3")
    expected = outputs(named(*plain), capsys)
    for old, new in zip(plain, names, strict=True):
        expected = [text.replace(old, printable(new)) for text in expected]
    folder = named(*names).parent
    printed = outputs(folder / "scene.yaml", capsys)
    assert [text.split() for text in printed] == [text.split() for text in expected]
    with (folder / "csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert {(row["task"], row["arm"]) for row in rows} == {(name, name)}
    assert list(json.loads((folder / "trajectory").read_text())) == [name]
    (region,) = yaml.safe_load_all((folder / "tsr").read_text())
    assert region["name"] == f"{name}: {name}"
    assert region["reference"] == names[1]


@NAMES
def test_names_of_a_hand(name, tmp_path, capsys):
    path = tmp_path / "hand.urdf"
    link = name.translate({code: None for code in (7, 13, 27)})  # which XML cannot hold
    attribute = quoteattr(link, {"\n": "&#10;"})
    path.write_text(
        rooted(0.0, 0.0).replace("'a'", attribute).replace("'palm'", attribute[:-1] + " 2" + attribute[-1])
    )
    assert main(["hand", str(path)]) == 0
    hand: dict[str, Any] = yaml.safe_load(checked(capsys))["hand"]
    assert hand["touch_links"] == [link, "b"]


@NAMES
@pytest.mark.parametrize(
    "command",
    [
        ["map", "{}"],
        ["map", "soda_can", "--task", "{}"],
        ["map", "soda_can", "--arm", "{}"],
        ["map", "soda_can", "--out", "{}"],
        ["plan", "sequential", "soda_can", "--out", "no/{}/plan.json"],
        ["plan", "bimanual", "log_two_robots", "--list", "1", "--method", "{}"],
        ["verify", "{}"],
        ["export", "csv", "{}", "--out", "plan.csv"],
        ["object", "{}"],
        ["object", "{}.stl"],
        ["hand", "{}"],
    ],
)
def test_names_on_the_command_line(command, name, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main([part.replace("{}", name) for part in command]) == 2
    assert checked(capsys).count("\n") == 1


@NAMES
@pytest.mark.parametrize(
    "command", [["{}"], ["plan", "{}", "soda_can"], ["plan", "bimanual", "x", "--seed", "{}"]]
)
def test_names_that_are_no_arguments(command, name, capsys):
    with pytest.raises(SystemExit) as caught:
        main([part.replace("{}", name * 20) for part in command])
    assert caught.value.code == 2
    checked(capsys)
