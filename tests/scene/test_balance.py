"""Whether robots stand: against Pinocchio, and against the definition of a convex area."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from symgrasp.errors import SceneError
from symgrasp.feasibility.candidates import CandidateChecker
from symgrasp.feasibility.create import MapMaker, create_map, explain
from symgrasp.ik import solver_for
from symgrasp.object.profile import Profile
from symgrasp.plan.verify import verify
from symgrasp.planners.planning import plan_bimanual, plan_sequential, sequential_plans
from symgrasp.poses import from_position_rpy, inverse, translation
from symgrasp.reason import Reason
from symgrasp.robot.model import RobotModel
from symgrasp.robot.robot import Robot
from symgrasp.scene.balance import Load, load_of_hand, support_margin, support_margins
from symgrasp.scene.scene import Scene
from symgrasp.world import open_world
from tests.engine.random_scenes import random_torso_scene
from tests.plan.test_torso import content

pinocchio = pytest.importorskip("pinocchio")

URDF = Path(__file__).parent.parent / "data" / "two_arms.urdf"


def standing(mass: float = 0.0, half: float = 0.2, arms: tuple[str, ...] = ("left", "right")):
    """The scene of two arms and a stick, on a square support."""
    scene = content()
    scene["robots"][0]["support"] = [[half, half], [-half, half], [-half, -half], [half, -half]]
    scene["object"]["mass"] = mass
    scene["tasks"][0]["arms"] = list(arms)
    return scene


@cache
def weighed(urdf: bytes):
    """Pinocchio's model of a URDF."""
    return pinocchio.buildModelFromXML(urdf.decode())


def centre_of_mass(own: RobotModel, values: np.ndarray) -> np.ndarray:
    """Pinocchio's centre of mass in the base frame."""
    model = weighed(own.urdf)
    q = pinocchio.neutral(model)
    for joint in own.joints:
        if joint.source >= 0:
            q[model.joints[model.getJointId(joint.name)].idx_q] = (
                joint.ratio * values[joint.source] + joint.offset
            )
    data = model.createData()
    # links fixed to the base are no body of Pinocchio's model, but of its universe
    moved = pinocchio.centerOfMass(model, data, q)
    fixed = model.inertias[0]
    total = data.mass[0] + fixed.mass
    return (moved * data.mass[0] + fixed.lever * fixed.mass) / total


@given(st.integers(0, 2**32 - 1))
def test_the_margin_is_that_of_pinocchio_s_centre_of_mass(seed):
    """A support of four sides around the origin, and a load."""
    rng = np.random.default_rng(seed)
    model = RobotModel(URDF)
    values = rng.uniform(np.maximum(model.lower, -3), np.minimum(model.upper, 3))
    base = from_position_rpy(rng.uniform(-1, 1, 3), rng.uniform(-0.5, 0.5, 3))
    low, high = np.sort(rng.uniform(-1, 1, (2, 2)), axis=0)
    corners = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
    robot = Robot("r", model, base, np.zeros(len(values)), support=corners)
    load = Load(float(rng.uniform(0, 50)), rng.uniform(-1, 1, 3))
    mass = model.masses()[0].sum()
    at = base[:3, :3] @ centre_of_mass(model, values) + base[:3, 3]
    x, y = ((mass * at + load.mass * load.point) / (mass + load.mass))[:2]
    expected = min(x - low[0], high[0] - x, y - low[1], high[1] - y)
    assert support_margin(robot, values, [load]) == pytest.approx(expected, abs=1e-9)


def test_the_support_between_feet():
    """Soles of the two feet, 12 cm wide at y = ±12 cm, from x = -8 to 16 cm."""
    scene = random_torso_scene(0)
    scene["robots"][0].update(support=["left_foot", "right_foot"], base={"position": [1, 2, 3]})
    support = Scene.from_content(scene).robots["body"].support
    assert support is not None
    np.testing.assert_allclose(support.min(axis=0), [1 - 0.08, 2 - 0.18], atol=1e-9)
    np.testing.assert_allclose(support.max(axis=0), [1 + 0.16, 2 + 0.18], atol=1e-9)


@pytest.mark.parametrize(
    ("support", "expected"),
    [
        (["left_fot"], "did you mean 'left_foot'"),
        (["left_flange"], "links with soles"),
        ([[0, 0], [1, 1], [2, 2]], "corners"),
        ([[0, 0], [1, 1]], "at least 3"),
    ],
)
def test_supports_that_are_none(support, expected):
    scene = random_torso_scene(0)
    scene["robots"][0]["support"] = support
    with pytest.raises(SceneError, match=expected) as refused:
        Scene.from_content(scene)
    assert "robots[0].support" in str(refused.value)


def test_a_robot_without_masses_cannot_balance():
    scene = random_torso_scene(0, falls=True)
    robot = scene["robots"][0]
    robot["urdf"] = str(URDF.parent / "three_parallel.urdf")
    for key in ("arms", "home", "torso"):
        del robot[key]
    robot.update(mount={"link": "flange"}, hand="wsg50", support=[[0, 0], [1, 0], [0, 1]])
    scene["tasks"][0]["arms"] = ["body"]
    with pytest.raises(SceneError, match="a URDF with the masses of its links"):
        Scene.from_content(scene)


@pytest.mark.parametrize(
    ("knots", "expected"),
    [
        ([[0, 0.1], [2, 0.1]], 1.0),
        ([[1, 0.3], [5, 0.0]], 2.0),  # a cone: a quarter of its height
        ([[0, 0.1], [1, 0.1], [1.0000001, 0.2], [2, 0.2]], (0.5 * 1 + 1.5 * 4) / 5),
    ],
)
def test_the_centre_of_mass_of_an_even_body(knots, expected):
    assert Profile(knots, "profile").centre_of_mass == pytest.approx(expected, abs=1e-6)


def test_hands_of_one_robot_carry_all_and_hands_of_several_share():
    content = standing(6.0)
    other = {**content["robots"][0], "name": "other", "base": {"position": [5, 0, 0]}}
    other["arms"] = [{**arm, "name": f"other_{arm['name']}"} for arm in other["arms"]]
    content["robots"].append(other)
    scene = Scene.from_content(content)
    T = scene.task().T_world_object
    alone = load_of_hand(scene, scene.arm("left"), ["left", "right"], T, 0.1)
    assert alone.mass == 6.0
    np.testing.assert_allclose(alone.point, (T @ [0, 0, 0.35, 1])[:3])
    shared = load_of_hand(scene, scene.arm("left"), ["left", "right", "other_left"], T, 0.1)
    assert shared.mass == pytest.approx(2.0)
    np.testing.assert_allclose(shared.point, (T @ [0, 0, 0.1, 1])[:3])
    assert load_of_hand(scene, scene.arm("left"), ["other_left"], T, 0.1).mass == 6.0


def test_a_heavier_load_topples_more_cells_and_plans_say_by_how_much_it_stands():
    light, heavy = (create_map(Scene.from_content(standing(mass))) for mass in (1.0, 25.0))
    count = [np.count_nonzero(m.reason == Reason.OUT_OF_BALANCE) for m in (light, heavy)]
    assert count[0] < count[1]
    assert np.all(light.feasible | ~heavy.feasible)
    cell = tuple(np.argwhere(heavy.reason == Reason.OUT_OF_BALANCE)[0])
    grid = heavy.manifold
    text = str(
        explain(
            Scene.from_content(standing(25.0)),
            float(grid.h[cell[1]]),
            float(grid.theta[cell[2]]),
            [0.0, np.pi][cell[0]],
        )
    )
    assert "out of balance" in text
    assert "mm outside of the support" in text
    plan = plan_bimanual(Scene.from_content(standing(1.0)))
    assert verify(plan), str(verify(plan))
    (task,) = plan.tasks
    assert 0 < task.balance["body"] < 0.2
    boast = task.model_copy(update={"balance": {"body": task.balance["body"] + 1e-3}})
    assert "mm inside of the support, not" in str(verify(plan.model_copy(update={"tasks": (boast,)})))
    silent = task.model_copy(update={"balance": {}})
    assert "balance of [], not ['body']" in str(verify(plan.model_copy(update={"tasks": (silent,)})))


def test_plans_keep_all_robots_standing():
    """Each arm alone is balanced by the other at home: together they may not be."""
    scene = Scene.from_content(standing(4.0, half=0.12))
    with open_world(scene) as world:
        maps = {("carry", arm): MapMaker(world).map(arm, "carry") for arm in ("left", "right")}
    assert all(m.feasible.any() for m in maps.values())
    plan = plan_bimanual(scene, maps=maps)
    (task,) = plan.tasks
    held = [
        (scene.arm(h.arm), np.array([h.joints[n] for n in scene.arm(h.arm).joint_names]), h.opening)
        for h in task.holds
    ]
    margins = support_margins(scene, task.object_pose_turned.array(), held)
    assert 0 <= task.balance["body"] <= margins["body"]
    assert margins["body"] == pytest.approx(task.balance["body"], abs=2e-5)  # stated a little too low


IN_FRONT = (0.085, 0.2)
"""From where to where (m) the support of `tipping` reaches, in front of the robot."""


def tipping(approach: float) -> Scene:
    """One arm and a stick; the support is so far in front that the robot may fall backwards without it."""
    scene = standing(2.0, arms=("left",))
    scene["robots"][0]["support"] = [[x, y] for x in IN_FRONT for y in (-0.2, 0.2)]
    del scene["robots"][0]["torso"]
    scene["tasks"] = scene["tasks"][:1]
    scene["map"] = {"heights": 6, "angles": 12, "redundancy": 1, "approach": approach}
    return Scene.from_content(scene)


def stands_by_pinocchio(scene: Scene, values: np.ndarray, load: float, point: np.ndarray) -> bool:
    """Whether the centre of mass, with a load (kg) at a point (3,), is inside the support of `tipping`."""
    robot = scene.robots["body"]
    mass = robot.model.masses()[0].sum()
    at = robot.T_world_base[:3, :3] @ centre_of_mass(robot.model, values) + robot.T_world_base[:3, 3]
    middle = (mass * at + load * point) / (mass + load) - robot.T_world_base[:3, 3]
    return bool(IN_FRONT[0] <= middle[0] <= IN_FRONT[1] and abs(middle[1]) <= 0.2)


def test_a_robot_must_stand_along_the_retreat_too():
    """Every candidate that is free without a support is followed here, and weighed by Pinocchio."""
    scene = tipping(0.1)
    content = scene.file.model_dump(mode="json", exclude_none=True)
    del content["robots"][0]["support"]
    free = Scene.from_content(content)
    arm, task, grid = free.arm("left"), free.task(), free.manifold
    ik = solver_for(arm, 1)
    tools = inverse(arm.robot.T_world_base) @ grid.tool_poses(task.T_world_object, arm.hand.finger_depth)
    middle = (task.T_world_object @ [0, 0, free.profile.centre_of_mass, 1])[:3]
    expected = np.zeros((2, grid.heights, grid.angles), dtype=bool)
    tipped = 0
    with open_world(free) as world:
        checker = CandidateChecker(world, arm, ik, 0.1)
        world.set_object(task.T_world_object)
        for cell in np.ndindex(expected.shape):
            opening = arm.hand.opening(float(free.profile.radius(grid.h[cell[1]])))
            for c in checker.candidates(tools[cell], opening):
                if c.reason != Reason.FEASIBLE:
                    continue
                held = stands_by_pinocchio(scene, arm.robot_values(c.q, opening), 2.0, middle)
                path = [c.q]
                for distance in np.linspace(0.01, 0.1, 10):
                    found = ik.solve_sample(tools[cell] @ translation([0, 0, -distance]), c.sample).q
                    path.append(found[np.abs(found - path[-1]).max(axis=1).argmin()])
                empty = [stands_by_pinocchio(scene, arm.robot_values(q, opening), 0.0, middle) for q in path]
                expected[cell] |= held and all(empty)
                tipped += held and not all(empty)
    the_map = create_map(scene)
    np.testing.assert_array_equal(the_map.feasible, expected)
    np.testing.assert_array_equal(create_map(scene, method="reference").feasible, expected)
    assert tipped > 5
    assert expected.any()


def test_where_a_robot_falls_on_the_retreat_is_explained_and_verified():
    """A plan of the same scene without a retreat is refuted once the retreat counts."""
    scene, still = tipping(0.1), tipping(0.0)
    with_retreat, without = create_map(scene), create_map(still)
    blocked = np.argwhere((with_retreat.reason == Reason.APPROACH_BLOCKED) & without.feasible)
    grid = scene.manifold
    explanations = [
        explain(scene, float(grid.h[i]), float(grid.theta[j]), [0.0, np.pi][r]) for r, i, j in blocked
    ]
    fallen = [e for e in explanations if e.candidates[0].imbalance]
    assert fallen
    assert all(e.reason == Reason.APPROACH_BLOCKED for e in fallen)
    assert all("mm outside of the support" in e.candidates[0].why.split("after ")[1] for e in fallen)
    cells = {(e.cell.row, e.cell.column) for e in fallen}
    plans = sequential_plans(scene, maps={("carry", "left"): without})
    holds = next(plan for plan in plans if grid.cell((g := plan.tasks[0].holds[0].grasp).h, g.theta) in cells)
    assert "approach blocked" in str(verify(holds))
    assert verify(plan_sequential(scene)).failures == []
