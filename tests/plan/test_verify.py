"""A changed plan is caught, whatever was changed."""

from __future__ import annotations

import json

import pytest

from symgrasp.cli.main import main
from symgrasp.plan.plan import Plan
from symgrasp.plan.verify import verify
from symgrasp.scene.scene import Scene
from tests.plan.tampering import caught, changed
from tests.plan.test_plan import PLANS, bimanual, handover, sequential


@pytest.mark.parametrize("make", PLANS)
def test_plans_hold(make):
    report = verify(make())
    assert report.failures == []
    assert report.checks > 100


@pytest.mark.parametrize("make", PLANS)
def test_margins_of_one_more_cell_are_caught(make):
    """They are exact: a cell more would reach past what is feasible, or half around the object."""
    content = json.loads(make().to_json())
    grid = Scene.from_content(content["scene"]["content"]).manifold
    holds = [
        ("tasks", k, "holds", j) for k, task in enumerate(content["tasks"]) for j in range(len(task["holds"]))
    ]
    sizes = {"margin_along": grid.dh, "margin_around": grid.dtheta}
    for hold in holds:
        for name, size in sizes.items():
            stated = content["tasks"][hold[1]]["holds"][hold[3]][name]
            assert caught(changed(content, (*hold, name), stated + size))


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
