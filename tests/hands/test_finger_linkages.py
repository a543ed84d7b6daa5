"""Hands whose fingers have several links: roots that stand further in than the pads, mimic joints."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from symgrasp.errors import UrdfError
from symgrasp.hands.measure import measure_hand
from symgrasp.robot.hand import Hand
from symgrasp.robot.model import RobotModel
from symgrasp.world.client import load_urdf, pybullet

CRANK, TILT, TURN = 0.06, 0.5, 0.8
"""Length of the cranks (m), their tilt outwards when the hand is open, the turn that closes it (rad)."""

PIVOT_Y, PIVOT_Z, PALM, PAD_LENGTH = 0.03, 0.055, 0.05, 0.04
FACE = 0.0145
"""How far the face of a pad stands inwards of the end of its crank (m)."""


def box(size: list[float], at: list[float]) -> str:
    size_text, at_text = (" ".join(f"{v:.9g}" for v in values) for values in (size, at))
    return f"<collision><origin xyz='{at_text}'/><geometry><box size='{size_text}'/></geometry></collision>"


def linkage_hand(signs: dict[str, int], chained: bool, offset: float, root: float = 0.0) -> str:
    """Two fingers on parallel linkages: six joints, of which five mimic ``crank_l``.

    Args:
        signs: joint → whether its axis is reversed, so that its multiplier is negative.
        chained: whether joints of the right finger mimic those before them, not ``crank_l`` itself.
        offset: the value of the right crank where ``crank_l`` is zero (rad).
        root: how far a block behind the pads stands further in than they do (m).
    """
    links = f"<link name='palm'>{box([0.06, 0.14, PALM], [0, 0, PALM / 2])}</link>"
    joints = ""

    def joint(name: str, parent: str, child: str, at: str, way: float, zero: float, mimic: str) -> None:
        nonlocal joints
        axis = way * signs[name]
        joints += (
            f"<joint name='{name}' type='revolute'><parent link='{parent}'/><child link='{child}'/>"
            f"<origin xyz='{at}' rpy='{zero:.12g} 0 0'/><axis xyz='{axis} 0 0'/>{mimic}</joint>"
        )

    def follow(name: str, leader: str, ratio: float, offset: float = 0.0) -> str:
        """The mimic element with which a joint turns as far as its leader, counted along their axes."""
        ratio *= signs[name] * signs[leader]
        return f"<mimic joint='{leader}' multiplier='{ratio}' offset='{offset}'/>"

    for side, name in ((1, "l"), (-1, "r")):
        # A positive turn about x takes z towards -y: the left crank closes that way, the right one opens.
        y, z = side * CRANK * np.sin(TILT), CRANK * np.cos(TILT)
        crank = "".join(box([0.01, 0.008, 0.008], [0, at * y, at * z]) for at in (0.25, 0.5, 0.75, 1.0))
        pad = box([0.02, 0.01, PAD_LENGTH], [0, side * (0.005 - FACE), 0.5 * PAD_LENGTH])
        if root:
            pad += box([0.02, 0.01 + root, 0.012], [0, side * (0.005 - FACE - root / 2), 0.006])
        links += f"<link name='crank_{name}'>{crank}</link><link name='bar_{name}'>{crank}</link>"
        links += f"<link name='finger_{name}'>{pad}</link>"
        ends = sorted((0.0, TURN * signs["crank_l"]))
        limits = f"<limit lower='{ends[0]}' upper='{ends[1]}' effort='1' velocity='1'/>"
        leader = "crank_l" if name == "l" or not chained else "crank_r"
        of_leader = offset if leader == "crank_r" else 0.0
        # The right crank stands at `offset` where crank_l is at zero; its frame is turned back by as much.
        mimic = limits if name == "l" else follow("crank_r", "crank_l", 1.0, offset)
        back = 0.0 if name == "l" else side * offset * signs["crank_r"] * -1.0
        joint(f"crank_{name}", "palm", f"crank_{name}", f"0 {side * PIVOT_Y} {PIVOT_Z}", side, back, mimic)
        for other, parent, at, way in (
            ("bar", "palm", f"0 {side * (PIVOT_Y - 0.015)} {PIVOT_Z}", 1.0),
            ("finger", f"crank_{name}", f"0 {y:.12g} {z:.12g}", -1.0),
        ):
            joint_name = f"{other}_{name}"
            # Where the leader stands at its offset, this joint is to stand at zero.
            own = -way * signs[joint_name] * signs[leader] * of_leader
            mimic = follow(joint_name, leader, way, own)
            joint(joint_name, parent, joint_name, at, side, 0.0, mimic)
    return f"<robot name='linkage'>{links}{joints}</robot>"


JOINTS = ("crank_l", "bar_l", "finger_l", "crank_r", "bar_r", "finger_r")
STRAIGHT: dict[str, int] = dict.fromkeys(JOINTS, 1)


class Placed:
    """A hand in PyBullet, its joints set from what was put into the URDF, not from what was read in it."""

    def __init__(self, model: RobotModel, signs: dict[str, int], offset: float) -> None:
        self.signs, self.offset = signs, offset
        self.client = pybullet.connect(pybullet.DIRECT)
        self.body = load_urdf(self.client, model, np.eye(4))
        count = pybullet.getNumJoints(self.body, physicsClientId=self.client)
        infos = [pybullet.getJointInfo(self.body, k, physicsClientId=self.client) for k in range(count)]
        self.joints = {info[1].decode(): info[0] for info in infos}

    def set_crank(self, value: float) -> None:
        for name, joint in self.joints.items():
            way = -1.0 if name.startswith("finger") else 1.0
            own = way * self.signs[name] * self.signs["crank_l"] * value
            own += self.offset if name == "crank_r" else 0.0
            pybullet.resetJointState(self.body, joint, own, physicsClientId=self.client)
        pybullet.performCollisionDetection(physicsClientId=self.client)

    def gap(self) -> float:
        """The distance between the fingers by PyBullet, roots and all."""
        left, right = self.joints["finger_l"], self.joints["finger_r"]
        found = pybullet.getClosestPoints(self.body, self.body, 1.0, left, right, physicsClientId=self.client)
        return min(point[8] for point in found)

    def free_half_width(self, z: float) -> float:
        """How far from the middle a ray at a height z meets the fingers, on the nearer side."""
        start, hits = [0.0, 0.0, z], []
        for side in (-1.0, 1.0):
            end = [0.0, 0.2 * side, z]
            (hit,) = pybullet.rayTestBatch([start], [end], physicsClientId=self.client)
            hits.append(0.2 * hit[2])
        return min(hits)


def measured(path: Path, text: str) -> tuple[Hand, RobotModel]:
    path.write_text(text)
    model = RobotModel(path)
    return measure_hand(model), model


@given(
    st.fixed_dictionaries(dict.fromkeys(JOINTS, st.sampled_from([-1, 1]))),
    st.booleans(),
    st.floats(-0.7, 0.7),
    st.sampled_from([0.0, 0.001, 0.004, 0.01]),
)
@settings(max_examples=12, phases=[Phase.generate])
def test_the_pads_stand_as_far_apart_as_asked(tmp_path_factory, signs, chained, offset, root):
    path = tmp_path_factory.mktemp("hand") / "linkage.urdf"
    hand, model = measured(path, linkage_hand(signs, chained, offset, root))
    assert model.joint_names == ("crank_l",)
    assert list(hand.joints) == ["crank_l"]
    assert set(hand.touch_links) == set(JOINTS)
    placed = Placed(model, signs, offset)
    try:
        placed.set_crank(0.0)
        assert placed.gap() + 2 * root == pytest.approx(2 * (PIVOT_Y + CRANK * np.sin(TILT) - FACE), abs=1e-4)
        assert -1e-3 <= hand.max_opening - placed.gap() - 2 * root <= 1e-4  # roots may be a little in the way
        assert hand.min_opening == 0.0
        assert hand.tool is not None
        top = hand.tool.position[2]
        for opening in np.linspace(0.02, hand.max_opening, 7):
            placed.set_crank(hand.joint_values(opening)["crank_l"])
            if root < 0.004:  # thick ones may be what an object touches first
                assert placed.gap() + 2 * root == pytest.approx(opening, abs=4e-4)
            radius = opening / 2
            axis = hand.standoff(radius)
            for z in np.linspace(-radius, radius, 21)[1:-1]:  # the object's outline at heights over the tool
                half_width = np.sqrt(radius**2 - z**2)
                assert placed.free_half_width(top + axis + z) > half_width - 4e-4
    finally:
        pybullet.disconnect(placed.client)


def rooted(opening: float, step: float) -> str:
    """Two sliding fingers with pads from 60 to 100 mm and roots from 30 to 60 mm that stand further in."""
    links = f"<link name='palm'>{box([0.03, 0.16, 0.02], [0, 0, 0.01])}</link>"
    joints = ""
    for side, name in ((1, "a"), (-1, "b")):
        pad = box([0.02, 0.01, 0.04], [0, side * (opening / 2 + 0.005), 0.08])
        root = box([0.02, 0.01, 0.03], [0, side * (opening / 2 + 0.005 - step), 0.045])
        links += f"<link name='{name}'>{pad}{root if step else ''}</link>"
        joints += (
            f"<joint name='slide_{name}' type='prismatic'><parent link='palm'/><child link='{name}'/>"
            f"<axis xyz='0 {side} 0'/><limit lower='0' upper='0.0425' effort='1' velocity='1'/></joint>"
        )
    return f"<robot name='rooted'>{links}{joints}</robot>"


@pytest.mark.parametrize("closed", [0.0, 0.08])
@pytest.mark.parametrize("step", [0.001, 0.004, 0.008])
def test_roots_that_no_round_object_reaches_change_nothing(closed, step, tmp_path):
    """An object is thinner where it reaches back to them than roots are closer together than pads."""
    widest = min(closed + 0.085, 2 * (0.066 + 0.01))  # its axis is no further out than the tips
    hand, _ = measured(tmp_path / "rooted.urdf", rooted(closed, step))
    plain, _ = measured(tmp_path / "plain.urdf", rooted(closed, 0.0))
    assert (hand.min_opening, hand.max_opening) == (closed, pytest.approx(widest, abs=1e-4))
    assert (hand.min_opening, hand.max_opening) == (plain.min_opening, plain.max_opening)
    assert hand.joint_values(closed + 0.03) == pytest.approx(plain.joint_values(closed + 0.03), abs=1e-4)
    assert hand.finger_depth == plain.finger_depth == 0.066


def test_roots_beside_the_pads_are_what_holds(tmp_path):
    """Right behind the tool frame, 10 mm behind the tips, the fingers stand 16 mm closer together."""
    text = rooted(0.0, 0.008).replace("0.02 0.01 0.04", "0.02 0.01 0.0095").replace("0.08'", "0.09525'")
    text = text.replace("0.02 0.01 0.03", "0.02 0.01 0.0605").replace("0.045'", "0.06025'")
    hand, _ = measured(tmp_path / "rooted.urdf", text)
    assert 0.069 <= hand.max_opening < 0.072  # of an object that stands out over them


def test_fingers_no_longer_than_the_palm_leave_no_hand(tmp_path):
    text = rooted(0.0, 0.0).replace("0.03 0.16 0.02", "0.03 0.16 0.18")
    with pytest.raises(UrdfError, match="finger depth"):
        measured(tmp_path / "short.urdf", text)


def test_a_mimic_joint_without_limits_moves_within_those_it_follows(tmp_path):
    signs: dict[str, int] = {**STRAIGHT, "crank_r": -1}
    path = tmp_path / "linkage.urdf"
    path.write_text(linkage_hand(signs, True, 0.3))
    joints = {joint.name: joint for joint in RobotModel(path).joints}
    assert (joints["crank_l"].lower, joints["crank_l"].upper) == (0.0, TURN)
    assert (joints["crank_r"].lower, joints["crank_r"].upper) == pytest.approx((0.3 - TURN, 0.3))
    assert (joints["finger_r"].lower, joints["finger_r"].upper) == pytest.approx((-TURN, 0.0))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text.replace("joint='crank_r'", "joint='bar_r'"), "mimic: 'bar_r': expected a joint"),
        (
            lambda text: text.replace("joint='crank_r'", "joint='crank_q'"),
            "mimic: 'crank_q': expected one of",
        ),
        (
            lambda text: text.replace("name='crank_r' type='revolute'", "name='crank_r' type='fixed'"),
            "mimic: 'crank_r': expected one of 'crank_l'",
        ),
        (lambda text: text.replace("multiplier='1.0'", "multiplier='inf'"), "expected finite numbers"),
    ],
)
def test_mimic_references_that_lead_nowhere(change: Callable[[str], str], message, tmp_path):
    path = tmp_path / "linkage.urdf"
    text = linkage_hand(STRAIGHT, True, 0.0)
    assert change(text) != text
    path.write_text(change(text))
    with pytest.raises(UrdfError, match=message) as caught:
        RobotModel(path)
    assert str(caught.value).startswith(str(path))
