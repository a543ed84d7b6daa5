"""Hands of robots: a cylinder as thick as the opening fits between the fingers, one 4 mm thicker does not.

The fingers are set in PyBullet, and the cylinder stands where a grasp has the object.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from symgrasp.errors import UrdfError
from symgrasp.hands.held import held_radius, outline
from symgrasp.hands.measure import measure_hand
from symgrasp.hands.structure import find_hand_structure
from symgrasp.references import resolve
from symgrasp.robot.hand import Hand
from symgrasp.robot.model import RobotModel
from symgrasp.world.client import load_urdf, pybullet

EXAMPLES = "package://example-robot-data/robots"
HANDS = {
    "pr2": ("pr2_description/urdf/pr2.urdf", "l_gripper_tool_frame"),
    "talos": ("talos_data/robots/talos_full_v2.urdf", "gripper_left_base_link"),
    "tiago pro": ("tiago_pro_description/robots/tiago_pro.urdf", "gripper_left_base_link"),
    "tiago's five fingers": ("tiago_description/robots/tiago.urdf", "hand_palm_link"),
    "baxter": ("baxter_description/urdf/baxter.urdf", "right_gripper"),
    "g1": ("g1_description/urdf/g1_29dof_with_hand_rev_1_0.urdf", "right_hand_palm_link"),
    "allegro": ("allegro_hand_description/urdf/allegro_left_hand.urdf", None),
    "romeo": ("romeo_description/urdf/romeo.urdf", "l_wrist"),
    "romeo, its tool beside what fingers hold": ("romeo_description/urdf/romeo.urdf", "l_gripper"),
    "panda": ("panda_description/urdf/panda.urdf", None),
    "xarm": ("package://pybullet_data/xarm/xarm6_with_gripper.urdf", None),
}
MARGIN = 0.001
"""What PyBullet adds to a mesh all around (m)."""

SIDES = 96
"""Of the polygon that stands for a circle."""


def model(reference: str) -> RobotModel:
    path = resolve(reference if "://" in reference else f"{EXAMPLES}/{reference}", Path())
    assert path is not None
    return RobotModel(path)


class Cylinders:
    """A robot in PyBullet, and cylinders across its hand."""

    def __init__(self, robot: RobotModel, hand: Hand) -> None:
        self.robot, self.hand = robot, hand
        self.client = pybullet.connect(pybullet.DIRECT)
        self.body = load_urdf(self.client, robot, np.eye(4))
        count = pybullet.getNumJoints(self.body, physicsClientId=self.client)
        infos = [pybullet.getJointInfo(self.body, k, physicsClientId=self.client) for k in range(count)]
        self.joints = {info[1].decode(): info[0] for info in infos}
        for link in range(-1, count):
            pybullet.changeDynamics(self.body, link, collisionMargin=0, physicsClientId=self.client)
        self.links = {info[12].decode(): info[0] for info in infos}

    def distance(self, opening: float, radius: float) -> float:
        """Return the distance of the fingers, opened so far, from a cylinder of a radius in their grasp."""
        robot, hand = self.robot, self.hand
        assert hand.tool is not None
        values = dict(zip(robot.joint_names, robot.default_values(), strict=True)) | hand.joint_values(
            opening
        )
        poses = robot.forward([values[name] for name in robot.joint_names])
        pose = dict(zip(robot.link_names, poses, strict=True))
        for joint in robot.joints:
            if joint.source >= 0 and joint.name in self.joints:  # those that move nothing are left out
                value = joint.ratio * values[robot.joint_names[joint.source]] + joint.offset
                pybullet.resetJointState(
                    self.body, self.joints[joint.name], value, physicsClientId=self.client
                )
        T = pose[hand.tool.link] @ hand.tool.matrix()
        turns = np.linspace(0, 2 * np.pi, SIDES, endpoint=False)
        around = [np.sin(turns), hand.standoff(radius) / radius + np.cos(turns)]
        corners = np.concatenate(
            [np.column_stack([np.full(SIDES, x), *(radius * np.array(around))]) for x in (-0.3, 0.3)]
        )
        shape = pybullet.createCollisionShape(
            pybullet.GEOM_MESH,
            vertices=(corners @ T[:3, :3].T + T[:3, 3]).tolist(),
            physicsClientId=self.client,
        )
        cylinder = pybullet.createMultiBody(0, shape, physicsClientId=self.client)
        pybullet.changeDynamics(cylinder, -1, collisionMargin=0, physicsClientId=self.client)
        pybullet.performCollisionDetection(physicsClientId=self.client)
        found = pybullet.getClosestPoints(self.body, cylinder, 0.1, physicsClientId=self.client)
        pybullet.removeBody(cylinder, physicsClientId=self.client)
        # A shape around the whole hand may be touched as well, and always is.
        beside = find_hand_structure(robot, hand.tool.link).beside
        fingers = {self.links[link] for link in hand.touch_links if link in self.links and link not in beside}
        assert fingers
        return min((point[8] for point in found if point[3] in fingers), default=0.1)


@pytest.mark.parametrize("name", HANDS)
def test_a_cylinder_as_thick_as_the_opening_fits(name):
    reference, tool = HANDS[name]
    robot = model(reference)
    hand = measure_hand(robot, tool)
    cylinders = Cylinders(robot, hand)
    assert hand.finger_depth > 0.002
    assert np.isfinite([hand.min_opening, hand.max_opening, hand.palm_depth, hand.pad_width]).all()
    assert 0 <= hand.min_opening < hand.max_opening - 0.02
    try:
        for opening in np.linspace(hand.min_opening, hand.max_opening, 6)[1:]:
            assert cylinders.distance(opening, opening / 2) > -MARGIN - 2e-4
            thicker = cylinders.distance(opening, opening / 2 + 0.002)
            assert thicker < -MARGIN - 5e-4 or opening == hand.max_opening  # where the tips may be the limit
    finally:
        pybullet.disconnect(cylinders.client)


@pytest.mark.parametrize(
    ("reference", "tool", "message"),
    [
        (
            "g1_description/urdf/g1_29dof_rev_1_0.urdf",
            "left_rubber_hand",
            "fingers or a jaw hang",
        ),
        ("icub_description/robots/icub.urdf", "l_hand", "fingers or a jaw hang"),
        ("kinova_description/robots/kinova.urdf", None, "two or more fingers, or --tool"),
        ("z1_description/urdf/z1.urdf", None, "two or more fingers, or --tool"),
        ("so_arm_description/urdf/so101.urdf", None, "two or more fingers, or --tool"),
        ("talos_data/robots/talos_reduced.urdf", "gripper_left_base_link", "in front of the palm"),
        (
            "alex_description/urdf/alex_sake_hands.urdf",
            "LeftSakePalmLink",
            "fingers in one piece",
        ),
        ("alex_description/urdf/alex_psyonic_hands.urdf", None, "mimic: 'index_q1'"),
    ],
)
def test_what_is_no_hand(reference, tool, message):
    with pytest.raises(UrdfError, match=message):
        measure_hand(model(reference), tool)


@given(
    st.lists(st.tuples(st.floats(0.005, 0.08), st.floats(-0.08, 0.08)), min_size=3, max_size=12),
    st.floats(0.0, 0.05),
)
def test_the_largest_disc_touches_and_is_free(corners, depth):
    """Against points along the edges of the hull of one finger."""
    points = np.array(corners)
    if np.linalg.matrix_rank(points - points[0], tol=1e-3) < 2:
        return
    hull = np.column_stack([np.zeros(len(points)), points])
    hull = np.concatenate([hull, hull + np.array([0.01, 0, 0])])
    side = outline([hull], 1.0)
    radius = held_radius(side, depth)
    if radius > 0.99:  # nothing in the way
        return
    share = np.linspace(0, 1, 400)[:, None]
    edges = np.concatenate([a + share * (b - a) for a, b in zip(side.starts, side.ends, strict=True)])
    apart = np.hypot(edges[:, 0], edges[:, 1] - max(0.0, radius - depth)).min()
    assert apart >= radius - 1e-6
    assert apart <= radius + 1e-3
