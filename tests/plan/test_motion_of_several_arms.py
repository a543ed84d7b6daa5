"""Motions are caught when they are changed: of two and four arms that lift a log, of a handover, of two arms
whose robot must not fall, and of one arm that sets the bottle down to grasp it anew.
"""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from symgrasp.motion.choosing import best_motion
from symgrasp.plan.plan import Plan
from symgrasp.planners.planning import bimanual_plans, handover_plans, regrasp_plans
from symgrasp.scene.scene import Scene
from symgrasp.world import BulletWorld, open_world
from tests.conftest import load_small
from tests.plan.test_motion import (
    failures,
    numbers,
    pass_over_unchanged,
    retimed,
    reversed_segment,
    swapped,
    without,
)
from tests.plan.test_plan import low_and_high
from tests.plan.test_tampering import standing

MAKERS: dict[str, Callable[[], Plan]] = {
    "two arms": lambda: _moving("log_two_robots", bimanual_plans, (20, 24, 6)),
    "handover": lambda: _moving("handover_between_robots", handover_plans, (12, 24, 8)),
    "four arms": lambda: _moving("log_four_robots", bimanual_plans, (20, 24, 6)),
    "balance": lambda: _balancing(),
    "regrasp": lambda: _regrasping(),
}

EVERY = {"two arms": 23, "handover": 31, "four arms": 101, "balance": 31, "regrasp": 31}
"""How many of the numbers of a motion are changed: one in so many."""


def _moving(name: str, plans: Callable[[Scene], Any], grid: tuple[int, int, int]) -> Plan:
    scene = load_small(name, *grid)
    return best_motion(scene, plans(scene))[0]


def _balancing() -> Plan:
    """Two arms on a torso, of a robot that stands on a square of 40 cm, lift a stick of 1 kg."""
    scene = Scene.from_content(standing())
    plan = best_motion(scene, bimanual_plans(scene))[0]
    assert all(task.balance for task in plan.tasks)
    return plan


def _regrasping() -> Plan:
    scene, maps = low_and_high(approach=0.05, row=7)
    plan = best_motion(scene, regrasp_plans(scene, maps=maps))[0]
    assert len({task.holds[0].grasp.h for task in plan.tasks}) == 2
    return plan


@pytest.fixture(scope="module", params=MAKERS)
def case(request: pytest.FixtureRequest) -> Iterator[tuple[str, Plan, BulletWorld]]:
    plan = MAKERS[request.param]()
    assert plan.motion
    with open_world(Scene.from_content(plan.scene.content)) as world:
        assert failures(json.loads(plan.motion.model_dump_json()), world, plan) == []
        yield request.param, plan, world


@pytest.fixture
def content(case, monkeypatch) -> dict[str, Any]:
    motion = json.loads(case[1].motion.model_dump_json())
    pass_over_unchanged(motion, monkeypatch)
    return motion


def missed(content: dict, case, changes: dict[str, Callable[[dict], object]]) -> list[str]:
    """Return the changes of a motion that are not caught; all of them have to change something."""
    _, plan, world = case
    found = []
    for name, change in changes.items():
        changed = copy.deepcopy(content)
        change(changed)
        assert changed != content, name
        if not failures(changed, world, plan):
            found.append(name)
    return found


def test_segments_left_out_swapped_reversed_or_faster_are_caught(case, content):
    count = len(content["segments"])
    assert count >= 5
    moving = [k for k in range(count) if len(content["segments"][k]["times"]) > 2]
    changes: dict[str, Callable[[dict], object]] = {
        **{f"without {k}": lambda m, k=k: without(m, k) for k in range(count)},
        **{f"swapped {k}": lambda m, k=k: swapped(m, k) for k in range(count - 1)},
        **{f"reversed {k}": lambda m, k=k: reversed_segment(m["segments"][k]) for k in moving},
        **{f"faster {k}": lambda m, k=k: retimed(m, k, 0.9) for k in moving},
    }
    assert missed(content, case, changes) == []


def rides(content: dict, segment: dict, name: str) -> bool:
    """Whether an arm stands still on a torso that another arm of the segment moves."""
    others = {joint for arm in segment["joints"] if arm != name for joint in content["joint_names"][arm]}
    rows = zip(*segment["joints"][name], strict=True)
    moves = {joint for joint, row in zip(content["joint_names"][name], rows, strict=True) if len({*row}) > 1}
    return moves <= others


def test_what_one_arm_does_without_the_others_is_caught(case, content):
    """Where several hold the object, none may be early, late, still, somewhere else, or not be told."""
    changes: dict[str, Callable[[dict], object]] = {}
    for k, segment in enumerate(content["segments"]):
        names = list(segment["joints"])
        for name in segment["held_by"]:
            changes[f"{k}: not held by {name}"] = lambda m, k=k, name=name: m["segments"][k][
                "held_by"
            ].remove(name)
        if len(names) < 2:
            continue
        for name in names:

            def late(m: dict, k: int = k, name: str = name) -> None:
                for what in ("joints", "velocities"):
                    rows = m["segments"][k][what][name]
                    rows[1:-1] = [rows[0], *rows[1:-2]]

            def still(m: dict, k: int = k, name: str = name) -> None:
                for what, factor in (("joints", 1.0), ("velocities", 0.0)):
                    rows = m["segments"][k][what][name]
                    rows[:] = [[factor * value for value in rows[0]]] * len(rows)

            def left_out(m: dict, k: int = k, name: str = name) -> None:
                for what in ("joints", "velocities"):
                    del m["segments"][k][what][name]

            def without_hand(m: dict, k: int = k, name: str = name) -> None:
                del m["segments"][k]["gripper"][name]

            # Where hands move the arms are still, and no row is late.
            kinds = (left_out, without_hand) if segment["gripper"] else (left_out, late, still)
            if not segment["gripper"] and rides(content, segment, name):
                kinds = (late, still)  # nothing else happens where it is left out
            changes |= {f"{k}: {name} {f.__name__}": f for f in kinds}

        def exchanged(m: dict, k: int = k, names: list[str] = names) -> None:
            joints = m["segments"][k]["joints"]
            joints[names[0]], joints[names[1]] = joints[names[1]], joints[names[0]]

        if segment["joints"][names[0]] != segment["joints"][names[1]]:  # they are alike at home
            changes[f"{k}: exchanged"] = exchanged
    assert missed(content, case, changes) == []


def test_an_arm_that_never_takes_the_object_is_caught(case, content):
    """All that the last arm does to take the object is left out, and nobody says that it holds it."""
    name = [*[s for s in content["segments"] if s["kind"] == "close"][-1]["gripper"]][-1]

    def idle(m: dict) -> None:
        carried = [s for s in m["segments"] if s["kind"] in ("lift", "carry", "lower")]
        alone = [s for s in m["segments"] if [*s["joints"]] == [name] and s not in carried]
        m["segments"] = [s for s in m["segments"] if s not in alone]
        m["duration"] -= sum(s["times"][-1] for s in alone)
        for segment in m["segments"]:
            segment["held_by"] = [arm for arm in segment["held_by"] if arm != name]
            for part in ("joints", "velocities", "gripper") if segment not in carried else ():
                segment[part].pop(name, None)

    assert missed(content, case, {f"{name} idle": idle}) == []


def test_changed_numbers_are_caught(case, content, thorough):
    """Clearances may be larger in truth, see the motions of one arm."""
    name, plan, world = case
    changed = copy.deepcopy(content)
    every = [entry for entry in numbers(changed) if entry[1] != "clearance"]
    step, least = (EVERY[name], 200) if thorough else (3 * EVERY[name] + 2, 60)
    every = every[::step]
    assert len(every) > least
    passed = []
    for k, (node, key) in enumerate(every):
        was = node[key]
        node[key] += 1e-3 if k % 2 else -1e-3
        if not failures(changed, world, plan):
            passed.append((k, key, was))
        node[key] = was
    assert passed == []
    assert changed == content


def test_a_robot_that_falls_on_the_way_is_told():
    """The same motion on feet that are too small for it."""
    plan = MAKERS["balance"]()
    assert plan.motion
    motion, small = json.loads(plan.motion.model_dump_json()), standing()
    for half, falls in ((0.2, False), (0.02, True)):
        small["robots"][0]["support"] = [[half, half], [-half, half], [-half, -half], [half, -half]]
        with open_world(Scene.from_content(small)) as world:
            found = failures(motion, world, plan)
        assert any("centre of mass" in failure for failure in found) == falls, found
        assert bool(found) == falls
