"""A changed plan is caught, whatever was changed."""

from __future__ import annotations

import copy
import json
from collections.abc import Iterator
from typing import Any

import pytest

from symgrasp.cli.main import main
from symgrasp.errors import PlanError
from symgrasp.plan.plan import Plan
from symgrasp.plan.verify import verify
from symgrasp.scene.scene import Scene
from tests.plan.test_plan import PLANS, bimanual, handover, sequential

UNCHECKED = ("schema_version", "versions", "planner", "units", "frames")
"""What a plan says about its making rather than about the world."""


def numbers(node: Any, path: tuple = ()) -> Iterator[tuple]:
    """Yield the path of every number of a plan that says something about the world."""
    items = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
    for key, value in items:
        if not path and key in UNCHECKED:
            continue
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            yield (*path, key)
        else:
            yield from numbers(value, (*path, key))


def changed(content: dict, path: tuple, step: float) -> dict:
    content = copy.deepcopy(content)
    node = content
    for key in path[:-1]:
        node = node[key]
    node[path[-1]] += step
    return content


def caught(content: dict) -> bool:
    try:
        return not verify(Plan.model_validate(content)).holds
    except (PlanError, ValueError):
        return True


@pytest.mark.parametrize("make", PLANS)
def test_plans_hold(make):
    report = verify(make())
    assert report.failures == []
    assert report.checks > 100


@pytest.mark.parametrize("make", PLANS)
def test_every_changed_number_is_caught(make):
    """Each number in turn, beyond its tolerance; of the scene's content, every tenth."""
    content = json.loads(make().to_json())
    paths = list(numbers(content))
    scene = [p for p in paths if p[0] == "scene"]
    paths = [p for p in paths if p[0] != "scene"] + scene[::10]
    missed = [p for p in paths if not caught(changed(content, p, 1e-3))]
    print(f"{len(paths) - len(missed)} of {len(paths)} changes caught")
    assert len(paths) > 120
    assert missed == []


@pytest.mark.parametrize("make", PLANS)
def test_small_changes_of_joints_and_poses_are_caught(make):
    content = json.loads(make().to_json())
    paths = [p for p in numbers(content) if {"joints", "tool_pose", "object_pose_turned"} & set(p)]
    missed = [p for p in paths if not caught(changed(content, p, -1e-5))]
    assert len(paths) > 60
    assert missed == []


@pytest.mark.parametrize("make", PLANS)
def test_margins_of_one_more_cell_are_caught(make):
    """They are exact: a cell more would reach past what is feasible, or half around the object."""
    content = json.loads(make().to_json())
    grid = Scene.from_content(content["scene"]["content"]).manifold
    holds = [
        ("tasks", k, "holds", j) for k, task in enumerate(content["tasks"]) for j in range(len(task["holds"]))
    ]
    sizes = {"margin_along": grid.dh, "margin_around": grid.dtheta}
    assert all(caught(changed(content, (*h, name), size)) for h in holds for name, size in sizes.items())


def edit(make, change) -> dict:
    content = json.loads(make().to_json())
    change(content)
    return content


@pytest.mark.parametrize(
    ("make", "change"),
    [
        (sequential, lambda c: c["tasks"].pop()),
        (handover, lambda c: c["tasks"].pop(1)),
        (handover, lambda c: c["tasks"][2]["holds"].__setitem__(0, c["tasks"][1]["holds"][0])),
        (sequential, lambda c: c["tasks"].pop(0)),
        (sequential, lambda c: c["tasks"].reverse()),
        (sequential, lambda c: c.update(tasks=[])),
        (sequential, lambda c: c["tasks"][1]["holds"].clear()),
        (sequential, lambda c: c.update(kind="bimanual")),
        (sequential, lambda c: c["tasks"][0].update(name="pour")),
        (sequential, lambda c: c["scene"]["content"]["obstacles"].pop()),
        (sequential, lambda c: c["scene"].update(name="other")),
        (sequential, lambda c: c["robots"].update(other=["joint"])),
        (sequential, lambda c: c["tasks"][2].update(holds=c["tasks"][1]["holds"])),
        (bimanual, lambda c: c["tasks"][0]["holds"].pop()),
        (bimanual, lambda c: c["tasks"][0]["holds"].reverse()),
        (bimanual, lambda c: c["tasks"][0]["holds"][0].update(arm="right", robot="right")),
        (bimanual, lambda c: c["tasks"][0]["holds"].__setitem__(1, c["tasks"][0]["holds"][0])),
        (bimanual, lambda c: c.update(kind="sequential")),
    ],
)
def test_changed_structure_is_caught(make, change):
    assert caught(edit(make, change))


def test_collisions_are_named():
    """The same configuration among other obstacles: the plan fails with the pair and the depth."""
    content = json.loads(sequential().to_json())
    box = {"name": "crate on top", "box": [0.3, 0.3, 0.3], "pose": {"position": [0.45, -0.35, 0.3]}}
    content["scene"]["content"]["obstacles"].append(box)
    report = verify(Plan.model_validate(content))
    assert any("crate on top are" in line and "mm too close" in line for line in report.failures)
    assert any(line.startswith("scene: sha256") for line in report.failures)


def test_on_the_command_line(tmp_path, capsys):
    path = tmp_path / "plan.json"
    sequential().save(path)
    assert main(["verify", str(path)]) == 0
    assert "the plan holds" in capsys.readouterr().out
    path.write_text(json.dumps(edit(sequential, lambda c: c["tasks"][1].update(delta=0.1))))
    assert main(["verify", str(path)]) == 1
    assert "turned pose: off by" in capsys.readouterr().out
    path.write_text("{}")
    assert main(["verify", str(path)]) == 2
    assert capsys.readouterr().err.startswith(f"symgrasp: {path}: ")
    assert main(["verify", str(tmp_path / "none.json")]) == 2
