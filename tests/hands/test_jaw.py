"""Hands with one jaw that turns: against the geometry of a wedge, and against the meshes themselves."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from symgrasp.errors import UrdfError
from symgrasp.feasibility.create import MapMaker
from symgrasp.feasibility.creation.algorithm1 import create_map_reference
from symgrasp.feasibility.starter import starter_scene
from symgrasp.found_arms import find_arms
from symgrasp.hands.measure import measure_hand
from symgrasp.plan.verify import verify
from symgrasp.planners.planning import plan_sequential
from symgrasp.poses import inverse
from symgrasp.references import resolve
from symgrasp.robot.hand import Hand
from symgrasp.robot.model import RobotModel
from symgrasp.scene.scene import Scene
from symgrasp.world import open_world
from tests.hands.test_finger_linkages import box

EXAMPLES = "package://example-robot-data/robots"
MESHES = {
    "so101": (f"{EXAMPLES}/so_arm_description/urdf/so101.urdf", "gripper_frame_link"),
    "z1": (f"{EXAMPLES}/z1_description/urdf/z1.urdf", "gripperStator"),
}

WIDTH, THICK = 0.02, 0.008


def wedge(length: float, turn: tuple[float, float, float], reverse: bool, fixed: float = 1.0) -> str:
    """Two flat jaws whose faces meet in the joint when it is closed.

    Args:
        length: of the jaws (m).
        turn: roll, pitch and yaw of the hand in its palm (rad).
        reverse: whether a positive angle closes.
        fixed: how long the fixed jaw is, as a share of the other.
    """
    sign, rpy = (-1 if reverse else 1), " ".join(f"{v:.9g}" for v in turn)
    limits = "lower='-1.2' upper='0'" if reverse else "lower='0' upper='1.2'"
    palm = box([WIDTH, 0.03, 0.02], [0, 0, -0.01])
    jaws = [box([WIDTH, THICK, share * length], [0, y, share * length / 2])
            for y, share in ((-THICK / 2, fixed), (THICK / 2, 1.0))]  # fmt: skip
    return (
        f"<robot name='wedge'><link name='flange'/><link name='palm'>{palm}{jaws[0]}</link>"
        f"<link name='jaw'>{jaws[1]}</link>"
        "<joint name='on' type='fixed'><parent link='flange'/><child link='palm'/>"
        f"<origin rpy='{rpy}'/></joint>"
        "<joint name='turn' type='revolute'><parent link='palm'/><child link='jaw'/>"
        f"<axis xyz='{-sign} 0 0'/><limit {limits} effort='1' velocity='1'/></joint></robot>"
    )


@pytest.mark.parametrize("file", ["wedge.urdf", "wedge.urdf.xacro"])
def test_a_hand_is_called_what_its_file_is(tmp_path, file):
    pytest.importorskip("xacro")
    (tmp_path / file).write_text(wedge(0.06, (0.0, 0.0, 0.0), False))
    assert measure_hand(tmp_path / file, "palm").name == "wedge"


def measured(folder: Path, urdf: str) -> tuple[RobotModel, Hand]:
    path = folder / "wedge.urdf"
    path.write_text(urdf, encoding="utf-8")
    model = RobotModel(path)
    return model, measure_hand(model, "flange")


@given(
    length=st.floats(0.06, 0.12),
    turn=st.tuples(*[st.floats(-1.5, 1.5)] * 3),
    reverse=st.booleans(),
    share=st.floats(0.0, 1.0),
)
@settings(max_examples=12, deadline=None, phases=(Phase.explicit, Phase.generate))
def test_an_object_touches_both_faces_of_a_wedge(tmp_path_factory, length, turn, reverse, share):
    """Between faces that meet in the joint at an angle α, a radius R is held R / tan(α / 2) from it."""
    model, hand = measured(tmp_path_factory.mktemp("jaw"), wedge(length, turn, reverse))
    opening = hand.min_opening + share * (hand.max_opening - hand.min_opening)
    radius = opening / 2
    poses = model.forward(model.default_values())
    assert hand.tool is not None
    tool = hand.tool.matrix()
    palm = inverse(poses[model.link_index(hand.tool.link)]) @ poses[model.link_index("palm")]
    at = inverse(palm) @ tool @ [0.0, hand.shift_at(radius - hand.clearance), hand.standoff(radius), 1.0]
    assert at[1] == pytest.approx(radius, abs=4e-4)
    (angle,) = hand.joint_values(opening).values()
    assert np.tan(abs(angle) / 2) == pytest.approx(radius / at[2], abs=0.02)
    # It is as wide as friction allows, less the steps in which radii and depths are looked at.
    most = hand.max_opening / 2
    z = length - 0.01 + hand.standoff(most)
    assert np.deg2rad(40) < 2 * np.arctan2(most, z) < np.deg2rad(45.5)
    assert hand.palm_depth == pytest.approx(length - 0.01, abs=2e-3)
    assert hand.pad_width == pytest.approx(WIDTH)


def installed(urdf: str) -> RobotModel:
    path = resolve(urdf, Path())
    assert path is not None
    return RobotModel(path)


def surface(model: RobotModel, hand: Hand, opening: float) -> dict[str, np.ndarray]:
    """Return points (n, 3) of the meshes of both jaws in the tool frame, sampled densely."""
    assert hand.tool is not None
    q = model.default_values()
    for name, value in hand.joint_values(opening).items():
        q[model.joint_names.index(name)] = value
    poses = model.forward(q)
    T = inverse(poses[model.link_index(hand.tool.link)] @ hand.tool.matrix())
    found = {}
    for link in hand.touch_links:
        points = []
        for shape in model.shapes(link):
            pose = T @ poses[model.link_index(link)] @ shape.pose
            sampled = trimesh.sample.sample_surface(shape.mesh(link), 100_000, seed=0)[0]
            points.append(sampled @ pose[:3, :3].T + pose[:3, 3])
        found[link] = np.concatenate(points)
    return found


@pytest.mark.parametrize("name", sorted(MESHES))
def test_meshes_of_both_jaws_touch_the_object(name):
    urdf, tool = MESHES[name]
    model = installed(urdf)
    hand = measure_hand(model, tool)
    angles = []
    for opening in np.linspace(hand.min_opening, hand.max_opening, 4):
        radius = opening / 2
        y, z = float(hand.shift_at(radius - hand.clearance)), hand.standoff(radius)
        for points in surface(model, hand, opening).values():
            near = np.hypot(points[:, 1] - y, points[:, 2] - z).min()
            assert near == pytest.approx(radius, abs=5e-4)
        angles += hand.joint_values(opening).values()
    assert hand.max_opening > 0.04
    assert len({np.sign(b - a) for a, b in pairwise(angles)}) == 1


def test_map_and_plan_put_the_object_between_the_jaws():
    """The engine's map is that of Algorithm 1, and in a plan both jaws are as near the can."""
    urdf = MESHES["z1"][0]
    model = installed(urdf)
    content = starter_scene("z1", urdf, find_arms(model))
    content["map"] = {"heights": 5, "angles": 8}
    scene = Scene.from_content(content)
    arm, task = scene.arm(), scene.task()
    with open_world(scene) as world:
        found = MapMaker(world).map(arm.name, task)
        assert np.array_equal(found.reason, create_map_reference(world, arm, task, scene.manifold).reason)
        plan = plan_sequential(scene)
    assert verify(plan)
    (hold,) = plan.tasks[0].holds
    T_tool_object = inverse(hold.tool_pose.array()) @ plan.tasks[0].object_pose_turned.array()
    radius = float(scene.profile.radius(hold.grasp.h))
    y, z = (T_tool_object @ [0, 0, hold.grasp.h, 1])[1:3]
    for points in surface(model, arm.hand, hold.opening).values():
        near = np.hypot(points[:, 1] - y, points[:, 2] - z).min()
        assert near == pytest.approx(radius + arm.hand.clearance, abs=5e-4)


def test_a_short_part_beside_the_joint_is_no_jaw(tmp_path):
    with pytest.raises(UrdfError, match="a fixed jaw that reaches as far"):
        measured(tmp_path, wedge(0.08, (0, 0, 0), False, fixed=0.3))


def test_a_link_that_turns_all_round_is_no_jaw(tmp_path):
    with pytest.raises(UrdfError, match="a jaw, which turns less"):
        measured(tmp_path, wedge(0.08, (0, 0, 0), False).replace("lower='0'", "lower='-3'"))
