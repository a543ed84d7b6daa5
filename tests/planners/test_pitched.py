"""Plans of arms of five joints, against the URDF alone and a search that knows no closed form."""

from __future__ import annotations

import json

import numpy as np
import pytest

from symgrasp.bench.arms.numerical import reach
from symgrasp.errors import NoPlanError, SceneError
from symgrasp.feasibility.create import MapMaker
from symgrasp.motion.planning import plan_motion
from symgrasp.object.manifold import Manifold
from symgrasp.plan.exports import to_tsr
from symgrasp.plan.listing import plan_in_words
from symgrasp.plan.plan import Plan
from symgrasp.plan.verify import verify
from symgrasp.planners.planning import plan_bimanual, plan_handover, plan_sequential, sequential_plans
from symgrasp.poses import inverse, pose_error
from symgrasp.reason import Reason
from symgrasp.robot.pitch import SAME_PITCH
from symgrasp.scene.scene import Scene
from symgrasp.world import open_world
from tests.feasibility.test_pitched import so101
from tests.plan.tampering import tool_in_world

UPRIGHT = {"position": [0.28, 0.05, 0.0]}
BESIDE = {"position": [0.25, -0.1, 0.0]}
LEANING = {"position": [0.25, 0.0, 0.05], "rpy_deg": [20, 30, 0]}
TURNED_OVER = {"position": [0.25, 0.0, 0.1], "rpy_deg": [0, 100, 0]}


def scene_of(*poses: dict, heights: int = 8) -> Scene:
    """Return a scene in which an SO-101 holds a can at some poses."""
    content = so101("upright").content
    tasks = [{"name": f"task {k}", "pose": pose} for k, pose in enumerate(poses)]
    return Scene.from_content({
        **content, "tasks": tasks, "map": {"heights": heights, "angles": 24, "redundancy": 8}
    })  # fmt: skip


def hands_in_object(plan: Plan, arm_name: str) -> list[np.ndarray]:
    """Return the poses (4, 4) of an arm's tool in the object, task by task, by its URDF and joint values."""
    arm = Scene.from_content(plan.scene.content).arm(arm_name)
    return [
        inverse(task.object_pose_turned.array()) @ tool_in_world(arm, hold.joints)
        for task in plan.tasks
        for hold in task.holds
        if hold.arm == arm_name
    ]


def assert_rigid(hands: list[np.ndarray]) -> None:
    """Check that a hand is at the same place of the object in all tasks."""
    for hand in hands[1:]:
        distance, angle = pose_error(hand, hands[0])
        assert distance < 0.1 * SAME_PITCH
        assert angle < 2 * SAME_PITCH


@pytest.fixture(scope="module")
def plan() -> Plan:
    return plan_sequential(scene_of(UPRIGHT, LEANING, BESIDE))


@pytest.mark.parametrize("method", ["best", "first", "regrasp"])
def test_one_grasp_is_rigid_in_all_tasks(method, plan):
    found = plan if method == "best" else plan_sequential(scene_of(UPRIGHT, LEANING, BESIDE), method=method)
    hands = hands_in_object(found, "so101")
    assert len(hands) == 3
    assert_rigid(hands)
    assert all(task.holds[0].grasp == found.tasks[0].holds[0].grasp for task in found.tasks)
    assert (report := verify(found)), str(report)
    turns = np.array([task.delta for task in found.tasks]) / Manifold(scene_of(UPRIGHT).profile, 8, 24).dtheta
    assert np.abs(turns - np.round(turns)).max() > 1e-3  # the azimuth within the cell is made up for


def test_plans_differ_in_pitch_too_and_all_hold():
    plans = list(sequential_plans(scene_of(UPRIGHT, LEANING)))
    grasps = [plan.tasks[0].holds[0].grasp for plan in plans]
    assert len({str(grasp) for grasp in grasps}) == len(grasps)
    assert len({grasp.pitch for grasp in grasps}) > 2
    for found in plans[:: max(1, len(plans) // 4)]:
        assert verify(found)
        assert_rigid(hands_in_object(found, "so101"))


def test_a_plan_says_its_pitch(plan):
    grasp = plan.tasks[0].holds[0].grasp
    assert grasp.pitch != 0.0
    assert f"pitch {np.rad2deg(grasp.pitch):.1f}°" in plan_in_words(plan)
    region = to_tsr(plan)
    assert f"pitched by {np.rad2deg(grasp.pitch):.1f}°" in region
    assert Plan.parse(plan.to_json(), "plan.json") == plan


@pytest.mark.parametrize(
    ("change", "failure"),
    [
        (lambda g: g.update(pitch=g["pitch"] + 3e-4), "grasp and tool_pose"),
        (lambda g: g.update(pitch=0.0), "grasp and tool_pose"),
        (lambda g: g.update(theta=g["theta"] + 3e-4), "grasp and tool_pose"),
        (lambda g: g.update(pitch=1.9), "outside"),
    ],
)
def test_a_wrong_pitch_is_found(plan, change, failure):
    content = json.loads(plan.to_json())
    for task in content["tasks"]:
        change(task["holds"][0]["grasp"])
    report = verify(Plan.parse(json.dumps(content), "plan.json"))
    assert not report
    assert any(failure in line for line in report.failures)


def test_a_pitch_that_changes_on_the_way_is_found(plan):
    """Even where both are within the leeway."""
    content = json.loads(plan.to_json())
    content["tasks"][1]["holds"][0]["grasp"]["pitch"] += 1e-5
    assert any("changed its grasp" in line for line in verify(Plan.model_validate(content)).failures)


def test_an_overstated_margin_is_found(plan):
    content = json.loads(plan.to_json())
    grid = scene_of(UPRIGHT).manifold
    for name, size in (("margin_along", grid.dh), ("margin_around", grid.dtheta)):
        tampered = json.loads(json.dumps(content))
        tampered["tasks"][0]["holds"][0][name] += size
        assert any(f"{name} is overstated" in line for line in verify(Plan.model_validate(tampered)).failures)


def test_tasks_without_a_common_pitch_exclude_each_other():
    """Upright and upside down, the hand would have to come from below."""
    with pytest.raises(NoPlanError, match="they share no roll and pitch"):
        plan_sequential(scene_of(UPRIGHT, TURNED_OVER))


def test_maps_at_a_pitch_are_those_of_a_numerical_search():
    """What it reaches at that pitch, within a cell, inside the limits, the map does not call out of reach."""
    scene, rng = scene_of(UPRIGHT, LEANING, heights=5), np.random.default_rng(0)
    pitches = (0.25, 0.7)
    seen = reached = 0
    with open_world(scene) as world:
        maker = MapMaker(world)
        for task in scene.tasks.values():
            m = maker.maps_at_pitches("so101", task, pitches)
            assert m.proven.shape == m.feasible.shape
            assert not (m.proven & m.feasible).any()
            tools = scene.arm().hand.tool_poses(scene.manifold, task.T_world_object)
            out = np.isin(m.reason, (Reason.UNREACHABLE, Reason.NOT_FOUND, Reason.JOINT_LIMITS))
            for some in (np.argwhere(out), np.argwhere(m.feasible)):
                for i, row, column in rng.permutation(some)[:10]:
                    roll, pitch = m.roll_and_pitch(int(i))
                    arm = scene.arm().at_pitch(pitch).grasping(scene.manifold, int(row), roll)
                    found = (
                        arm.lower[5] < arm.upper[5] and reach(arm, tools[roll, row, column], rng) is not None
                    )
                    feasible = bool(m.feasible[i, row, column])
                    seen += 1
                    reached += found
                    # The limits of pitch and azimuth have a width for the search, on whose edge it may end.
                    assert found or not feasible
                    assert feasible or not found
    assert seen == 40
    assert reached == 20


def two_arms(tasks: list[dict], length: float = 0.3, apart: float = 0.3) -> Scene:
    """Return a scene with two SO-101 side by side, and a stick that lies in front of both."""
    robot = so101("upright").content["robots"][0]
    sides = (("left", [0, 0.5 * apart, 0]), ("right", [0, -0.5 * apart, 0]))
    return Scene.from_content({
        "schema_version": 1,
        "name": "two",
        "robots": [{**robot, "name": name, "base": {"position": at}} for name, at in sides],
        "object": {"name": "stick", "profile": [[0, 0.015], [length, 0.015]]},
        "tasks": tasks,
        "map": {"heights": 8, "angles": 16, "redundancy": 8},
    })  # fmt: skip


def across(y: float) -> dict:
    """Return a pose in which a stick lies along y from there on."""
    return {"position": [0.25, y, 0.15], "rpy_deg": [-90, 0, 0]}


def test_two_hands_hold_a_stick():
    found = plan_bimanual(two_arms([{"name": "hold", "arms": ["left", "right"], "pose": across(-0.15)}]))
    assert verify(found)
    assert len({hold.grasp.pitch for hold in found.tasks[0].holds}) == 2


def test_one_hand_gives_a_stick_to_the_other():
    """Each has one grasp, though the turn of the stick is common to both while they hold it together."""
    upright = lambda y, z=0.0: {"position": [0.25, y, z]}  # noqa: E731
    tasks = [
        {"name": "take", "arms": ["right"], "pose": upright(-0.15)},
        {"name": "give", "arms": ["right", "left"], "pose": upright(0.0, 0.03)},
        {"name": "put", "arms": ["left"], "pose": upright(0.15)},
    ]
    found = plan_handover(two_arms(tasks, 0.2, 0.34))
    assert verify(found)
    for arm in ("left", "right"):
        hands = hands_in_object(found, arm)
        assert len(hands) == 2
        assert_rigid(hands)


def test_motions_are_refused(plan):
    with pytest.raises(NoPlanError, match="no motion of so101: expected arms of 6 or 7 joints"):
        plan_motion(Scene.from_content(plan.scene.content), plan)


def test_hill_climbing_is_refused():
    scene = two_arms([{"name": "hold", "arms": ["left", "right"], "pose": across(-0.15)}])
    with pytest.raises(SceneError, match="hill climbing, which knows no pitch"):
        plan_bimanual(scene, method="hill_climb")


def test_two_hands_do_not_carry_a_stick():
    """Each turn of the stick suits one of them."""
    tasks = [
        {"name": f"hold {k}", "arms": ["left", "right"], "pose": across(-0.15 + 0.02 * k)} for k in (0, 1)
    ]
    with pytest.raises(SceneError, match="holds the object together with others in several"):
        plan_handover(two_arms(tasks))
