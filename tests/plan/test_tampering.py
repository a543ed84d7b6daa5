"""Whatever is changed in a plan is caught, or says nothing false."""

from __future__ import annotations

import json
from functools import cache

import numpy as np
import pytest

from symgrasp.errors import PlanError, SceneError
from symgrasp.plan import check_record
from symgrasp.plan.plan import Plan
from symgrasp.plan.report import Report
from symgrasp.plan.verify import verify
from symgrasp.planners.planning import plan_bimanual, plan_handover, plan_sequential
from symgrasp.robot.posture import conditioning, limit_slack
from symgrasp.scene.balance import support_margins
from symgrasp.scene.scene import Scene
from tests.conftest import load_small
from tests.plan.tampering import caught, changed, is_harmless, nodes, tamperings
from tests.plan.test_plan import bimanual, handover, low_and_high, sequential
from tests.plan.test_proven_margins import one_hand as proven
from tests.plan.test_torso import content as two_arms
from tests.planners.test_pitched import LEANING, UPRIGHT
from tests.planners.test_pitched import scene_of as so101_scene


@cache
def regrasped() -> Plan:
    """A plan that sets the object down and takes it anew."""
    scene, maps = low_and_high()
    return plan_sequential(scene, maps=maps, method="regrasp")


@cache
def pitched() -> Plan:
    """A plan of an arm of five joints."""
    return plan_sequential(so101_scene(UPRIGHT, LEANING))


def standing() -> dict:
    """The content of a scene with a body that has to stay upright, with a torso."""
    content = two_arms()
    content["robots"][0]["support"] = [[0.2, 0.2], [-0.2, 0.2], [-0.2, -0.2], [0.2, -0.2]]
    content["object"]["mass"] = 1.0
    return content


@cache
def balanced() -> Plan:
    return plan_bimanual(Scene.from_content(standing()))


@cache
def retreating() -> Plan:
    """A plan whose hand has a straight retreat, for which all of the redundancy is searched."""
    scene = load_small("pick_pour_place", 8, 24)
    return plan_sequential(scene.with_settings(redundancy="auto", approach=0.05))


EVERY = {
    sequential: 9,
    bimanual: 11,
    handover: 17,
    regrasped: 41,
    balanced: 23,
    pitched: 23,
    retreating: 31,
    proven: 29,
}
"""How many of the changes of a plan a thorough run tries: one in so many; others try a third of them."""


@pytest.fixture
def quick(monkeypatch):
    """Build a scene once, which most changes leave as it is."""
    build, known = Scene.from_content, {}

    def built(content, source="scene", folder=None):
        if folder is not None:
            return build(content, source, folder)
        key = json.dumps(content, sort_keys=True)
        if key not in known:
            known.clear()
            known[key] = build(content, source)
        return known[key]

    monkeypatch.setattr(check_record.Scene, "from_content", staticmethod(built))


def document(make) -> dict:
    return json.loads(make().to_json())


@pytest.mark.parametrize("make", EVERY)
def test_every_change_is_caught_or_harmless(make, quick, thorough):
    """Value by value: left out, of another type, larger, smaller, negated, reordered, repeated."""
    every, least = (EVERY[make], 100) if thorough else (3 * EVERY[make] + 2, 30)
    tried = [t for k, t in enumerate(tamperings(document(make))) if k % every == 0]
    passed = [t for t in tried if not caught(t[2])]
    missed = [(p, v) for p, v, c in passed if not is_harmless(make(), Plan.parse(json.dumps(c), "plan"))]
    assert missed == []
    assert len(tried) > least
    assert len(passed) < 0.12 * len(tried)


@pytest.mark.parametrize("make", EVERY)
def test_small_changes_of_joints_and_poses_are_caught(make, quick):
    """A tenth of a millimetre in a hundred, in every seventh number."""
    content = document(make)
    held = {"joints", "tool_pose", "object_pose_turned"}
    numbers = [(p, v) for p, v in nodes(content) if isinstance(v, float) and held & set(p)][::7]
    missed = [p for p, v in numbers if not caught(changed(content, p, v - 1e-5))]
    assert len(numbers) > 8
    assert missed == []


def edited(make, change) -> Report | str:
    """What is found of a plan that was changed, its scene hashed again: a report, or why it is refused."""
    content = document(make)
    change(content)
    content = changed(content, ("scene", "content", "name"), content["scene"]["content"]["name"])
    try:
        return verify(Plan.parse(json.dumps(content), "plan.json"))
    except PlanError as error:
        return str(error)


def scene_of(content: dict) -> dict:
    return content["scene"]["content"]


def lowered(content: dict) -> None:
    """Lower the table by 20 mm."""
    (table,) = (o for o in scene_of(content)["obstacles"] if o["name"] == "table")
    table["pose"]["position"][2] -= 0.02


def around(content: dict) -> None:
    """Put a small post where the bottle stands."""
    at = scene_of(content)["tasks"][0]["pose"]["position"]
    post = {"name": "post", "box": [0.01, 0.01, 0.02], "pose": {"position": [at[0], at[1], 0.01]}}
    scene_of(content)["obstacles"].append(post)


@pytest.mark.parametrize(
    ("make", "change", "lines"),
    [
        (sequential, around, ["tasks[0] (pick): bottle is", "mm inside post"]),
        (sequential, lowered, ["tasks[0] (pick): nothing holds the object up before it is held"]),
        (sequential, lowered, ["tasks[2] (place): nothing holds the object up after it was held"]),
        (regrasped, lowered, ["tasks[2] (place): the object is let go where nothing holds it up"]),
        (
            bimanual,
            lambda c: scene_of(c)["tasks"][0].pop("supported"),
            ["tasks[0] (lift): nothing holds the object up", "nor is it supported: false"],
        ),
        (sequential, lambda c: c["units"].update(length="mm"), ["units: ", "expected {'length': 'm'"]),
        (sequential, lambda c: c["units"].pop("angle"), ["units: ", "expected {'length': 'm'"]),
        (sequential, lambda c: c.pop("units"), ["units: ", "this key is required"]),
        (sequential, lambda c: c["frames"].update(tool="elsewhere"), ["frames: ", "expected {'world': "]),
        (sequential, lambda c: c.pop("schema_version"), ["schema_version: ", "this key is required"]),
        (sequential, lambda c: c.update(schema_version=True), ["schema_version: true: expected a whole"]),
        (sequential, lambda c: c.update(schema_version=1.0), ["schema_version: 1.0: expected a whole"]),
        (sequential, lambda c: scene_of(c).update(schema_version=1.0), ["1.0: expected a whole number"]),
        (
            sequential,
            lambda c: c["tasks"][0]["holds"][0].update(clearance=-0.001),
            ["tasks[0].holds[0].clearance: -0.001: expected greater than or equal to 0"],
        ),
        (
            sequential,
            lambda c: c["tasks"][0]["holds"][0].update(clearance=0.2),
            ["tasks[0].holds[0].clearance: 0.2: expected less than or equal to 0.1"],
        ),
        (
            sequential,
            lambda c: c["tasks"][0]["holds"][0].update(clearance=0.1),
            ["tasks[0] (pick): panda: clearance is", "mm, not 100.000 mm"],
        ),
        (sequential, lambda c: c["tasks"].insert(0, c["tasks"][0]), ["tasks: pick is done again without"]),
        (handover, lambda c: c["tasks"].insert(1, c["tasks"][1]), ["but the scene asks for"]),
        (sequential, lambda c: c.update(kind="handover"), ["planner: best makes no handover plans"]),
        (
            sequential,
            lambda c: (c.update(kind="handover"), c["planner"].update(algorithm="exact")),
            ["tasks: several tasks with several arms hand over"],
        ),
        (
            bimanual,
            lambda c: c.update(kind="handover"),
            ["tasks: several tasks with several arms hand over"],
        ),
        (
            handover,
            lambda c: (c.update(kind="sequential"), c["planner"].update(algorithm="best")),
            ["tasks: one arm does the sequence"],
        ),
        (handover, lambda c: c.update(kind="bimanual"), ["tasks: one task with several arms"]),
        (sequential, lambda c: c["planner"].update(algorithm="an oracle"), ["planner.algorithm: "]),
        (sequential, lambda c: c["planner"].update(seed=3), ["planner: seed is 3"]),
        (sequential, lambda c: c["versions"].update(numpy="the best"), ["versions.numpy: 'the best'"]),
    ],
)  # fmt: skip
def test_what_is_said_of_a_change(make, change, lines):
    """One clear line says what is wrong."""
    found = edited(make, change)
    said = [found] if isinstance(found, str) else found.failures
    assert any(all(part in line for part in lines) for line in said), said
    assert all("\n" not in line for line in said)


def test_a_key_twice_is_refused():
    text = sequential().to_json().replace('"delta":', '"delta": 0.5,\n      "delta":', 1)
    with pytest.raises(PlanError, match="the key 'delta' twice"):
        Plan.parse(text, "plan.json")
    with pytest.raises(PlanError, match="the number NaN"):
        Plan.parse(sequential().to_json().replace("0.0", "NaN", 1), "plan.json")


def test_a_pinned_scene_names_what_differs():
    """A changed scene makes a true plan of another scene; only who knows the scene can tell."""
    scene = load_small("pick_pour_place", 12, 24, 8)
    assert verify(sequential(), scene=scene)
    content = document(sequential)
    path = ("scene", "content", "obstacles", 3, "pose", "position", 0)
    other = Plan.parse(json.dumps(changed(content, path, 0.63)), "plan")
    assert verify(other)
    report = verify(other, scene=scene)
    assert report.failures == [f"scene: obstacles[3].pose.position[0] is 0.63, but 0.62 in {scene.source}"]
    path = ("scene", "content", "obstacles", 3)
    fewer = Plan.parse(
        json.dumps(changed(content, path[:3], content["scene"]["content"]["obstacles"][:3])), "plan"
    )
    (line,) = verify(fewer, scene=scene).failures
    assert line.startswith("scene: obstacles is 3 values, but 4 values")


@pytest.mark.parametrize("make", EVERY)
def test_plans_hold_strictly(make):
    """No number is overstated; a clearance that is, by less than worlds differ, is let pass unless strict."""
    plan = make()
    assert verify(plan, strict=True).failures == []
    content, clearance = document(make), ("tasks", 0, "holds", 0, "clearance")
    (line,) = verify(Plan.model_validate(changed(content, clearance, 0.1))).failures
    measured = float(line.split("clearance is ")[1].split(" mm")[0]) / 1e3
    over = Plan.model_validate(changed(content, clearance, measured + 2e-6))
    assert plan.tasks[0].holds[0].clearance < measured
    assert verify(over)
    assert not verify(over, strict=True)


@pytest.mark.parametrize("make", [sequential, bimanual, balanced, proven])
def test_strictly_no_number_is_overstated_at_all(make):
    """Beyond what it is by what rounding could explain, each of them is let pass unless strict."""
    plan, content, tried, missed = make(), document(make), 0, []
    scene = Scene.from_content(plan.scene.content)
    for k, task in enumerate(plan.tasks[:1]):
        arms = [(scene.arm(hold.arm), np.array([*hold.joints.values()]), hold.opening) for hold in task.holds]
        real: dict[tuple, float] = {
            ("balance", robot): margin + 5e-7
            for robot, margin in support_margins(scene, task.object_pose_turned.array(), arms).items()
        }
        for j, (hold, (arm, q, _)) in enumerate(zip(task.holds, arms, strict=True)):
            real["holds", j, "limit_slack"] = float(limit_slack(arm, q)) + 5e-7
            real["holds", j, "conditioning"] = float(conditioning(arm, q)) + 5e-7
            for name in ("margin_along", "margin_around"):  # which are stated as they are
                real["holds", j, name] = getattr(hold, name) + 5e-10
        for path, over in real.items():
            changed_plan = Plan.model_validate(changed(content, ("tasks", k, *path), over))
            if not verify(changed_plan) or verify(changed_plan, strict=True):
                missed.append((k, *path))
        tried += len(real)
    assert missed == []
    assert tried >= 4


def test_planners_say_where_nothing_holds_the_object_up():
    """Where a scene does not say so, the plan does; where it says otherwise, there is no plan."""
    scene = load_small("log_two_robots", 20, 24, 6)
    silent = scene.with_supported("lift", supported=None)
    plan = plan_bimanual(silent)
    assert plan.scene.content["tasks"][0]["supported"] is False
    assert verify(plan)
    assert not verify(plan, scene=silent)
    with pytest.raises(SceneError, match=r"task lift: supported: true: expected false"):
        plan_bimanual(scene.with_supported("lift", supported=True))


def test_a_handover_takes_several_tasks_and_arms():
    for name in ("pick_pour_place", "log_two_robots"):
        with pytest.raises(SceneError, match="several tasks, done by several arms"):
            plan_handover(load_small(name))
