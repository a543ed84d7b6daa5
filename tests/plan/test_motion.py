"""Motions in plan files: read back as they were written, checked, and caught when they are changed."""

from __future__ import annotations

import copy
import json
import re
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from symgrasp.cli.main import main
from symgrasp.errors import PlanError
from symgrasp.motion.record import from_plan, to_record
from symgrasp.plan import check_motion as check_motion_module
from symgrasp.plan.check_motion_states import SegmentStates, check_free
from symgrasp.plan.motion_record import MotionRecord, SegmentRecord
from symgrasp.plan.plan import Plan
from symgrasp.plan.verify import verify
from symgrasp.poses import inverse
from symgrasp.scene.scene import Scene
from symgrasp.world import BulletWorld, open_world
from tests.motion.recorded import recorded_motion, recorded_plan


@pytest.fixture(scope="module")
def world() -> Iterator[BulletWorld]:
    with open_world(Scene.from_content(recorded_plan().scene.content)) as world:
        yield world


@pytest.fixture(scope="module")
def content() -> dict[str, Any]:
    motion = recorded_plan().motion
    assert motion
    return json.loads(motion.model_dump_json())


def failures(motion: dict[str, Any], world: BulletWorld, plan: Plan | None = None) -> list[str]:
    """Return what does not hold of the content of a motion of a plan, which is the recorded one if None.

    What cannot be read counts too.
    """
    found: list[str] = []

    def expect(ok: object, failure: str) -> bool:
        if not ok:
            found.append(failure)
        return bool(ok)

    try:
        record = MotionRecord.model_validate(motion)
    except ValueError as error:
        return [str(error)]
    check_motion_module.check_motion(plan or recorded_plan(), record, world, expect)
    return found


def test_a_motion_is_read_as_it_was_written():
    plan = Plan.parse(recorded_plan().to_json(), "plan")
    assert plan == recorded_plan()
    scene = Scene.from_content(plan.scene.content)
    motion = from_plan(plan, scene)
    assert motion
    assert to_record(motion) == plan.motion
    assert motion.duration == recorded_motion().duration
    for t in np.linspace(0, motion.duration, 30):
        here, there = motion.at(t), recorded_motion().at(t)
        np.testing.assert_array_equal(here.T_world_object, there.T_world_object)
        np.testing.assert_array_equal(here.values["panda"], there.values["panda"])


def test_rows_of_numbers_take_one_line():
    text = recorded_plan().to_json()
    assert json.loads(text) == json.loads(recorded_plan().model_dump_json())
    assert max(len(line) for line in text.splitlines()) > 100
    assert len(text.splitlines()) < 3000


def test_numbers_in_strings_stay():
    plan = recorded_plan()
    name = "[\\n  1,\n  2\n]"
    scene = plan.scene.model_copy(update={"name": name})
    text = plan.model_copy(update={"scene": scene}).to_json()
    assert Plan.parse(text, "plan").scene.name == name


def test_the_whole_plan_holds(tmp_path, capsys):
    path = tmp_path / "plan.json"
    recorded_plan().save(path)
    assert main(["verify", str(path)]) == 0
    assert "the plan holds" in capsys.readouterr().out


def test_version_1_has_no_motion():
    content = json.loads(recorded_plan().to_json())
    motion = content.pop("motion")
    content["schema_version"] = 1
    assert Plan.parse(json.dumps(content), "plan").motion is None
    with pytest.raises(PlanError, match="schema_version 2"):
        Plan.parse(json.dumps({**content, "motion": motion}), "plan")


def numbers(node: Any) -> Iterator[tuple[Any, Any]]:
    """Yield every number of a document, as what it is in and its key there."""
    for key, value in node.items() if isinstance(node, dict) else enumerate(node):
        if isinstance(value, int | float):
            yield node, key
        elif isinstance(value, dict | list):
            yield from numbers(value)


@pytest.fixture
def only_changed_states(content, monkeypatch):
    """Look for collisions only in segments that are not as they were, which are known to be free."""
    pass_over_unchanged(content, monkeypatch)


def pass_over_unchanged(content: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    """Let all segments of the content of a motion count as free."""
    free = {SegmentRecord.model_validate(segment).model_dump_json() for segment in content["segments"]}

    def check_changed(states, *rest):
        return 0 if states.segment.model_dump_json() in free else check_free(states, *rest)

    monkeypatch.setattr(check_motion_module, "check_free", check_changed)


@pytest.mark.usefixtures("only_changed_states")
@pytest.mark.parametrize("step", [1e-3, -1e-3])
def test_every_changed_number_is_caught(step, content, world, thorough):
    """Clearances are what was proven, and may be larger in truth: they are changed by more."""
    changed = copy.deepcopy(content)
    every = list(numbers(changed))
    assert len(every) == len(re.findall(r"\d(?=[,\]}])", json.dumps(content)))
    assert failures(changed, world) == []
    missed = []
    for k, (node, key) in enumerate(every):
        if k % 2 == (step > 0) and key != "clearance":  # every other number is made larger, the rest smaller
            continue
        if not thorough and k // 2 % 3:
            continue
        was = node[key]
        node[key] += 100 * abs(step) if key == "clearance" else step
        if not failures(changed, world):
            missed.append((k, key, was))
        node[key] = was
    assert missed == []
    assert changed == content


def reversed_segment(segment: dict[str, Any]) -> None:
    for rows in (*segment["joints"].values(), *segment["velocities"].values()):
        rows.reverse()
    segment["times"] = [segment["times"][-1] - t for t in segment["times"][::-1]]


def retimed(motion: dict[str, Any], k: int, factor: float) -> None:
    """Make a segment faster, with all that follows from it."""
    segment = motion["segments"][k]
    motion["duration"] += (factor - 1) * segment["times"][-1]
    segment["times"] = [factor * t for t in segment["times"]]
    segment["velocities"] = {
        arm: [[v / factor for v in row] for row in rows] for arm, rows in segment["velocities"].items()
    }


def without(motion: dict[str, Any], k: int) -> None:
    motion["duration"] -= motion["segments"].pop(k)["times"][-1]


def swapped(motion: dict[str, Any], k: int) -> None:
    segments = motion["segments"]
    segments[k], segments[k + 1] = segments[k + 1], segments[k]


SEGMENTS = range(9)
CHANGES: dict[str, Callable[[dict[str, Any]], object]] = {
    **{f"without {k}": lambda m, k=k: without(m, k) for k in SEGMENTS},
    **{f"swapped {k}": lambda m, k=k: swapped(m, k) for k in SEGMENTS[:-1]},
    **{f"reversed {k}": lambda m, k=k: reversed_segment(m["segments"][k]) for k in (1, 2, 4, 5, 7, 8)},
    **{f"faster {k}": lambda m, k=k: retimed(m, k, 0.95) for k in (1, 2, 4, 5, 7, 8)},
    "all reversed": lambda m: m["segments"].reverse(),
    "hand shut at once": lambda m: retimed(m, 3, 0.01),
    "held by nobody": lambda m: m["segments"][4].update(held_by=[]),
    "held too early": lambda m: m["segments"][2].update(held_by=["panda"]),
    "carried elsewhere": lambda m: m["segments"][4].update(task_to="place"),
    "not closed": lambda m: m["segments"][3]["gripper"].update(panda=[0.039, 0.035]),
    "another arm": lambda m: m["joint_names"].update(other=m["joint_names"].pop("panda")),
    "joints in another order": lambda m: m["joint_names"]["panda"].reverse(),
    "a row left out": lambda m: m["segments"][1]["joints"]["panda"].pop(5),
    "a time left out": lambda m: m["segments"][1]["times"].pop(5),
    "a time twice": lambda m: m["segments"][1]["times"].__setitem__(5, m["segments"][1]["times"][4]),
    "a kind that closes nothing": lambda m: m["segments"][3].update(kind="open"),
}


@pytest.mark.usefixtures("only_changed_states")
@pytest.mark.parametrize("name", CHANGES)
def test_changed_segments_are_caught(name, content, world):
    changed = copy.deepcopy(content)
    CHANGES[name](changed)
    assert failures(changed, world)


def test_a_path_through_an_obstacle_is_named(content):
    """The same motion in a scene with a post in the way of the carry."""
    plan = recorded_plan()
    pole = {"name": "post", "cylinder": {"radius": 0.02, "height": 1.0}}
    scene = Scene.from_content(plan.scene.content)
    middle = recorded_motion().at(sum(recorded_motion().starts[4:6]) / 2).T_world_object[:3, 3]
    pole["pose"] = {"position": [float(middle[0]), float(middle[1]), 0.5]}
    obstacles = [*plan.scene.content["obstacles"], pole]
    blocked = Scene.from_content({**scene.content, "obstacles": obstacles})
    with open_world(blocked) as world:
        found = failures(content, world)
    assert any("post" in failure and "(carry)" in failure for failure in found)


@pytest.mark.parametrize(
    ("limit", "tasks", "holds"), [(100.0, None, False), (112.0, None, True), (5.0, 1, False)]
)
def test_a_tilt_beyond_the_limit_of_the_scene_is_told(limit, tasks, holds, content):
    """The bottle is tipped by 110 degrees to pour."""
    carry = {"tilt_deg": limit} | ({"tasks": ["pour", "place"]} if tasks else {})
    limited = Scene.from_content({**recorded_plan().scene.content, "carry": carry})
    with open_world(limited) as world:
        found = failures(content, world)
    assert any("the object tilts by 110" in failure for failure in found) == (not holds)


def test_a_tilt_is_told_whatever_a_segment_is_called(content):
    changed = copy.deepcopy(content)
    for segment in changed["segments"]:
        if segment["kind"] == "carry":
            segment["kind"] = "lift"
    limited = Scene.from_content({**recorded_plan().scene.content, "carry": {"tilt_deg": 100.0}})
    with open_world(limited) as world:
        assert any("the object tilts by 110" in failure for failure in failures(changed, world))


def test_states_are_close_to_each_other_however_far_rows_are_apart(content):
    """A joint that turns nearly all around in one row comes back close to where it was."""
    scene = Scene.from_content(recorded_plan().scene.content)
    arm = scene.arm()
    rows = np.stack([arm.home, arm.home])
    rows[:, 0] = arm.lower[0], arm.upper[0]
    segment = {**content["segments"][1], "times": [0.0, 10.0], "joints": {arm.name: rows.tolist()}}
    segment["velocities"] = {arm.name: np.zeros_like(rows).tolist()}
    start = {arm.robot.name: arm.robot.home}
    states = SegmentStates(scene, SegmentRecord.model_validate(segment), start, np.eye(4), {}, {})
    at = states.between(0.01, 10_000)
    assert at is not None
    tool = np.array([arm.tool_pose(q[arm.indices])[:2, 3] for q in states.values(at)[arm.robot.name]])
    apart = np.linalg.norm(np.diff(tool, axis=0), axis=1)
    assert apart.max() <= 0.01
    assert apart.sum() == pytest.approx(np.ptp(rows[:, 0]) * np.linalg.norm(tool[0]), rel=0.01)
    assert states.between(0.01, len(at)) is not None
    assert states.between(0.01, len(at) - 1) is None


def test_strictly_no_clearance_is_overstated_at_all(content, world):
    """By a hair it may be otherwise, since worlds differ by that; the recorded plan holds strictly."""
    assert verify(recorded_plan(), strict=True).failures == []
    start = {name: robot.home for name, robot in world.scene.robots.items()}
    T = recorded_plan().tasks[0].object_pose_turned.array()

    def told(clearance: float, strict: bool) -> list[str]:
        segment = SegmentRecord.model_validate({**content["segments"][0], "clearance": clearance})
        found: list[str] = []
        check_free(
            SegmentStates(world.scene, segment, start, T, {}, {}, strict),
            world,
            10_000,
            "here",
            lambda ok, text: bool(ok) or bool(found.append(text)),
        )
        return found

    clearance = 0.05
    while found := told(clearance, strict=True):
        clearance = 1e-3 * float(found[0].split(" keep ")[1].split(" mm")[0]) - 1e-6
    assert clearance > content["segments"][0]["clearance"]
    assert not told(clearance + 4e-6, strict=False)
    assert told(clearance + 4e-6, strict=True)


def test_states_are_counted_over_the_whole_motion(content, world, monkeypatch):
    counts: list[int] = []

    def counted(*args):
        counts.append(check_free(*args))
        return counts[-1]

    monkeypatch.setattr(check_motion_module, "check_free", counted)
    assert failures(content, world) == []
    total = sum(counts)
    assert max(counts) < total - 1
    monkeypatch.setattr(check_motion_module, "MOST_STATES", total)
    assert failures(content, world) == []
    monkeypatch.setattr(check_motion_module, "MOST_STATES", total - 1)
    assert any("states of the motion" in failure for failure in failures(content, world))


@pytest.mark.parametrize("kind", ["approach", "retreat"])
def test_fingers_may_touch_the_object_on_the_line_of_the_grasp_alone(kind, content, world):
    """A hand that turns around its approach cuts through the bottle between its fingers."""
    scene, plan = world.scene, recorded_plan()
    arm = scene.arm()
    hold, T = plan.tasks[0].holds[0], plan.tasks[0].object_pose_turned.array()
    q = np.array([hold.joints[name] for name in arm.joint_names])
    turned = q.copy()
    turned[-1] += 0.6 if q[-1] + 0.6 < arm.upper[-1] else -0.6
    start = arm.robot.home.copy()
    start[arm.indices] = q
    for joint, value in arm.hand.joint_values(hold.opening).items():
        start[arm.robot.model.joint_names.index(joint)] = value
    line = next(s for s in content["segments"] if s["kind"] == "approach")["joints"][arm.name]
    grasps = {arm.name: [inverse(T) @ hold.tool_pose.array()]}
    found = []
    for rows in (line[::-1], [q.tolist(), turned.tolist()]):
        segment = {
            **content["segments"][2],
            **{"kind": kind, "held_by": [], "gripper": {}, "clearance": 0.0},
            **{"times": np.linspace(0.0, 9.0, len(rows)).tolist(), "joints": {arm.name: rows}},
            "velocities": {arm.name: np.zeros((len(rows), len(q))).tolist()},
        }
        record = SegmentRecord.model_validate(segment)
        states = SegmentStates(scene, record, {arm.robot.name: start}, T, {}, grasps)
        told: list[str] = []
        check_free(
            states, world, 10_000, "here", lambda ok, text, told=told: bool(ok) or bool(told.append(text))
        )
        found.append(told)
    assert found[0] == []
    assert len(found[1]) == 1 and "finger" in found[1][0] and "bottle" in found[1][0]


@pytest.mark.parametrize("task", ["pick", "pour", "place"])
def test_joint_values_of_plan_and_motion_are_the_same(task, content, world):
    changed = recorded_plan().model_dump(mode="json")
    (hold,) = next(t for t in changed["tasks"] if t["name"] == task)["holds"]
    hold["joints"]["panda_joint3"] += 1e-4
    found: list[str] = []
    check_motion_module.check_motion(
        Plan.model_validate(changed),
        MotionRecord.model_validate(content),
        world,
        lambda ok, text: bool(ok) or bool(found.append(text)),
    )
    assert found
    assert all("panda_joint3" in text and f"as in {task}" in text for text in found)
