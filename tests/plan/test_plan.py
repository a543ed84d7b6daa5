"""Plans hold in a fresh world, whoever made them."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from contextlib import closing
from dataclasses import replace
from functools import cache
from itertools import product
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from symgrasp.errors import NoPlanError, PlanError, SceneError
from symgrasp.feasibility.create import create_map
from symgrasp.object.manifold import grasp_to_tool
from symgrasp.plan.plan import LARGEST_PLAN, Plan, plan_schema
from symgrasp.plan.verify import verify
from symgrasp.planners import planning
from symgrasp.planners.configurations import ConfigurationFinder
from symgrasp.planners.conflicts import ConflictError, Shared
from symgrasp.planners.gaps import PrintGaps
from symgrasp.planners.planning import plan_bimanual, plan_handover, plan_sequential, regrasp_plans
from symgrasp.poses import from_position_quat, pose_error, rotation_z
from symgrasp.reason import Reason
from symgrasp.scene.format import MOST_TASKS, scene_schema
from symgrasp.scene.scene import Scene
from symgrasp.world import BulletWorld
from tests.conftest import load_small, write_scene
from tests.world.link_pose import link_pose


@cache
def sequential() -> Plan:
    return plan_sequential(load_small("pick_pour_place", 12, 24, 8))


@cache
def bimanual() -> Plan:
    return plan_bimanual(load_small("log_two_robots", 20, 24, 6))


@cache
def handover() -> Plan:
    return plan_handover(load_small("handover_between_robots", 12, 24, 8))


PLANS = [sequential, bimanual, handover]


@pytest.mark.parametrize("make", PLANS)
def test_a_plan_holds_in_a_fresh_world(make):
    """Read back from JSON, with nothing but the plan: the tool is where it says, nothing touches."""
    plan = Plan.model_validate_json(make().to_json())
    scene = Scene.from_content(plan.scene.content)
    assert plan.tasks
    for task in plan.tasks:
        turned = task.object_pose.array() @ rotation_z(task.delta)
        np.testing.assert_allclose(task.object_pose_turned.array(), turned, atol=1e-12)
        arms = [scene.arm(hold.arm) for hold in task.holds]
        with BulletWorld(scene) as world:
            world.set_object(turned)
            configurations = [
                (arm, [hold.joints[n] for n in arm.joint_names], hold.opening)
                for arm, hold in zip(arms, task.holds, strict=True)
            ]
            world.set_arms(configurations)
            assert not world.collisions(arms)
            for arm, hold in zip(arms, task.holds, strict=True):
                tool = link_pose(world, arm.robot.name, arm.tool)
                position, rotation = pose_error(tool, hold.tool_pose.array())
                assert position < 2e-6  # PyBullet reads the URDF in single precision
                assert rotation < 2e-6
                g = hold.grasp
                standoff = arm.hand.standoff(float(scene.profile.radius(g.h)))
                expected = grasp_to_tool(turned, g.h, g.theta, g.roll, standoff)
                np.testing.assert_allclose(hold.tool_pose.array(), expected, atol=1e-8)
                clearance = world.clearance(arm, 0.1)
                assert clearance - 2e-5 < hold.clearance <= clearance
                assert hold.clearance > 0
                assert hold.margin_along > 0


def test_one_grasp_for_the_whole_sequence():
    plan = sequential()
    assert [task.name for task in plan.tasks] == ["pick", "pour", "place"]
    assert all(task.holds[0].grasp == plan.tasks[0].holds[0].grasp for task in plan.tasks)
    assert len({task.holds[0].opening for task in plan.tasks}) == 1
    assert plan.tasks[0].delta == 0.0
    assert any(task.delta != 0.0 for task in plan.tasks)


def test_shipped_planners_do_not_end_at_the_first_cell():
    first = load_small("pick_pour_place", 12, 24, 8).manifold
    grasp = sequential().tasks[0].holds[0].grasp
    assert first.cell(grasp.h, grasp.theta) != (0, 0)


def test_a_handover_keeps_both_grasps():
    """Left picks and gives, right takes and places; each keeps its grasp as long as it holds on."""
    pick, give, place = handover().tasks
    assert [h.arm for h in give.holds] == ["left", "right"]
    assert pick.holds[0].grasp == give.holds[0].grasp
    assert give.holds[1].grasp == place.holds[0].grasp


def test_a_handover_needs_somebody_who_carries(content, tmp_path):
    robot = content["robots"][0]
    content["robots"].append({**robot, "name": "other", "base": {"position": [0, 2, 0]}})
    content["tasks"].append({"name": "place", "arms": ["other"], "pose": {"position": [0.55, 1.9, 0]}})
    scene = Scene.load(write_scene(tmp_path, content))
    with pytest.raises(SceneError, match="an arm that carries the object there from task 'pick'"):
        plan_handover(scene)


def test_four_arms():
    plan = plan_bimanual(load_small("log_four_robots", 24, 12, 4))
    assert len(plan.tasks[0].holds) == 4
    assert verify(plan).holds


def test_two_arms_hold_apart():
    left, right = bimanual().tasks[0].holds
    assert (left.arm, right.arm) == ("left", "right")
    assert (left.grasp.h, left.grasp.theta) != (right.grasp.h, right.grasp.theta)


@pytest.mark.parametrize("make", PLANS)
def test_json_is_valid_and_exact(make, tmp_path):
    plan = make()
    content = json.loads(plan.to_json())
    schema = plan_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.validate(content, schema)
    jsonschema.validate(content["scene"]["content"], scene_schema())
    plan.save(tmp_path / "plan.json")
    back = Plan.load(tmp_path / "plan.json")
    assert back == plan
    assert back.to_json() == plan.to_json()
    for task in back.tasks:
        pose = task.object_pose
        again = from_position_quat(pose.position, pose.quat_wxyz)
        np.testing.assert_allclose(again, pose.array(), atol=1e-12)


def test_hill_climbing_and_the_exact_search():
    """Both end apart; the exact one with the larger gap, and without chance."""
    scene = load_small("log_two_robots", 20, 24, 6)
    climbed = plan_bimanual(scene, method="hill_climb")
    assert climbed.planner.statistics["body_checks"] >= 1
    assert bimanual().planner.seed is None
    arms = list(scene.arms.values())
    gaps = PrintGaps(arms, scene.manifold)

    def gap(plan):
        (a, b), grid = plan.tasks[0].holds, scene.manifold
        cells = [grid.cell(x.grasp.h, x.grasp.theta) for x in (a, b)]
        rolls = [0 if x.grasp.roll == 0 else 1 for x in (a, b)]
        shift = (cells[1][1] - cells[0][1]) % grid.angles
        return gaps.around(0, rolls[0], cells[0][0], 1)[rolls[1], cells[1][0], shift]

    assert gap(bimanual()) >= gap(climbed) >= 0


def test_arms_that_always_meet(monkeypatch):
    """Prints apart but bodies never: every combination is tried, and that is said."""
    scene = load_small("log_two_robots", 4, 4, 1)
    monkeypatch.setattr(ConfigurationFinder, "conflict", lambda self, configurations: (0, 1))
    with pytest.raises(NoPlanError, match=r"no placement exists on this grid: .* the arms meet"):
        plan_bimanual(scene)


def test_other_configurations_than_the_witnesses_are_tried(monkeypatch):
    scene = load_small("log_two_robots", 20, 24, 6)
    conflict = ConfigurationFinder.conflict
    monkeypatch.setattr(planning, "_rated", lambda world, m: m)  # or an easier placement may come first
    first = plan_bimanual(scene)
    refused = [[hold.joints[n] for n in hold.joints] for hold in first.tasks[0].holds]

    def refuse_the_witnesses(self, configurations):
        same = [np.array_equal(p.q, q) for p, q in zip(configurations, refused, strict=True)]
        return (0, 1) if all(same) else conflict(self, configurations)

    monkeypatch.setattr(ConfigurationFinder, "conflict", refuse_the_witnesses)
    second = plan_bimanual(scene)
    assert second.planner.statistics["placements"] == 1
    for a, b in zip(first.tasks[0].holds, second.tasks[0].holds, strict=True):
        assert a.grasp == b.grasp
    assert first.tasks[0].holds != second.tasks[0].holds


def test_the_same_seed_gives_the_same_bytes():
    scene = load_small("log_two_robots", 20, 24, 6)
    assert plan_bimanual(scene).to_json() == bimanual().to_json()
    climbed = [plan_bimanual(scene, method="hill_climb", seed=seed) for seed in (3, 3, 4)]
    assert climbed[0].to_json() == climbed[1].to_json()
    assert climbed[0].tasks != climbed[2].tasks


def test_every_process_writes_the_same_bytes():
    """Whatever its hashes are seeded with."""
    code = (
        "from tests.plan.test_plan import *\n"
        "climbed = plan_bimanual(load_small('log_two_robots', 20, 24, 6), method='hill_climb', seed=3)\n"
        "sys.stdout.write(climbed.to_json() + ''.join(make().to_json() for make in PLANS))\n"
    )
    written = [
        subprocess.run(
            [sys.executable, "-c", code],
            cwd=Path(__file__).parent.parent.parent,
            env={**os.environ, "PYTHONHASHSEED": seed},
            capture_output=True,
            check=True,
        ).stdout
        for seed in ("1", "2")
    ]
    assert written[0] == written[1]
    assert written[0].decode().endswith("".join(make().to_json() for make in PLANS))


def test_the_scene_in_the_plan_is_the_scene():
    scene = load_small("pick_pour_place", 12, 24, 8)
    record = sequential().scene
    assert record.sha256 == scene.sha256 == Scene.from_content(record.content).sha256


def test_planners_refuse_scenes_of_the_other_kind():
    with pytest.raises(SceneError, match="two or more arms"):
        plan_bimanual(load_small("soda_can"))
    with pytest.raises(SceneError, match="does alone"):
        plan_sequential(load_small("log_two_robots"))


def test_no_plan_says_why():
    scene = load_small("pick_pour_place", 4, 4, 1).with_settings(margin=0.05)
    with pytest.raises(NoPlanError, match="no grasp"):
        plan_sequential(scene)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        (lambda c: c.pop("tasks"), "tasks"),
        (lambda c: c.update(schema_version=4), "schema_version"),
        (lambda c: c["tasks"][0].update(delta="x"), "tasks[0].delta"),
        (lambda c: c.update(tasks=c["tasks"][:1] * (MOST_TASKS + 1)), "tasks"),
        (lambda c: c.update(tasks=[{}] * 100_000), "tasks[0].name"),
        (lambda c: c["tasks"][0]["holds"][0]["grasp"].update(extra=1), "tasks[0].holds[0].grasp.extra"),
    ],
)
def test_files_that_are_no_plans(change, field, tmp_path):
    content = json.loads(sequential().to_json())
    change(content)
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(content))
    with pytest.raises(PlanError) as caught:
        Plan.load(path)
    assert caught.value.field == field
    path.write_text("{")
    with pytest.raises(PlanError, match="readable JSON"):
        Plan.load(path)


def test_methods():
    """The first grasp is Algorithm 2's, the best has the larger worst margin, and all can be replayed."""
    scene = load_small("pick_pour_place", 12, 24, 8)
    maps = {(task, "panda"): create_map(scene, task=task) for task in scene.tasks}
    first, best = (plan_sequential(scene, maps=maps, method=m) for m in ("first", "best"))

    def worst(plan):
        holds = [task.holds[0] for task in plan.tasks]
        return min(min(h.margin_along, h.margin_around * scene.profile.radius(h.grasp.h)) for h in holds)

    assert worst(best) >= worst(first) > 0
    assert best == sequential()
    assert plan_sequential(scene, maps=maps, method="regrasp").tasks == best.tasks  # none is needed


def low_and_high(approach: float = 0.0, row: int = 6):
    """Return a scene and its maps, where picking is feasible below a row alone, and pouring above it."""
    scene = load_small("pick_pour_place", 12, 24, 8).with_settings(approach=approach)
    maps = {(task, "panda"): create_map(scene, task=task) for task in scene.tasks}
    for task, rows in (("pick", slice(0, row)), ("pour", slice(row, 12))):
        m = maps[task, "panda"]
        reason = np.full_like(m.reason, Reason.UNREACHABLE)
        reason[:, rows] = m.reason[:, rows]
        maps[task, "panda"] = replace(m, reason=reason)
    return scene, maps


def test_a_regrasp_where_one_grasp_does_not_do():
    """Set down at the place, where both grasps are feasible."""
    scene, maps = low_and_high()
    with pytest.raises(ConflictError, match="no grasp serves pick and pour") as caught:
        plan_sequential(scene, maps=maps)
    assert caught.value.conflict.regrasps == (Shared(("pick",), "place"), Shared(("pour", "place"), None))
    plan = plan_sequential(scene, maps=maps, method="regrasp")
    assert [task.name for task in plan.tasks] == ["pick", "place", "place", "pour", "place"]
    grasps = [task.holds[0].grasp for task in plan.tasks]
    assert grasps[0] == grasps[1] != grasps[2] == grasps[3] == grasps[4]
    down, up = (plan.tasks[k].object_pose_turned.array() for k in (1, 2))
    np.testing.assert_allclose(down, up, atol=1e-9)  # nobody turns it while it stands
    assert verify(plan).failures == []


def test_plans_with_a_regrasp_end():
    """Where one height is left for either grasp, plans combine their rolls, each combination once."""
    scene, maps = low_and_high()
    with closing(regrasp_plans(scene, maps=maps)) as plans:
        first = next(plans)
    for task, k in (("pick", 0), ("pour", -1)):
        m, grasp = maps[task, "panda"], first.tasks[k].holds[0].grasp
        row = int(np.abs(m.manifold.h - grasp.h).argmin())
        reason = np.full_like(m.reason, Reason.UNREACHABLE)
        reason[:, row] = m.reason[:, row]
        maps[task, "panda"] = replace(m, reason=reason)
    with closing(regrasp_plans(scene, maps=maps)) as plans:
        found = list(plans)
    rolls = [(plan.tasks[0].holds[0].grasp.roll, plan.tasks[-1].holds[0].grasp.roll) for plan in found]
    assert found[0].tasks == first.tasks
    assert len(rolls) > 1
    assert all(verify(plan) for plan in found)
    assert sorted(rolls) == sorted(product(*map(set, zip(*rolls, strict=True))))


def test_progress_grows_to_the_end():
    shares: list[float] = []
    plan_sequential(load_small("pick_pour_place"), progress=shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


@pytest.mark.parametrize(
    "text",
    ["[" * 1_000_000, '{"tasks": ' + "9" * 10_000 + "}", " " * (LARGEST_PLAN + 1)],
    ids=lambda text: text[:20],
)
def test_a_hostile_plan_is_one_line(text, tmp_path):
    path = tmp_path / "plan.json"
    path.write_text(text)
    with pytest.raises(PlanError, match=r"plan\.json: file: .*: expected a readable JSON file$") as caught:
        Plan.load(path)
    assert "\n" not in str(caught.value)
