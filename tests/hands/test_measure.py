from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from symgrasp.cli.main import main
from symgrasp.errors import UrdfError
from symgrasp.hands.measure import LENGTHS, hand_yaml, measure_hand
from symgrasp.poses import from_rotation, inverse, rpy
from symgrasp.references import resolve
from symgrasp.robot.hand import HANDS, SIDED_HANDS, Hand
from symgrasp.robot.model import RobotModel
from symgrasp.scene.scene import Scene
from tests.robot.hands import FLANGE, IIWA

PANDA = "package://pybullet_data/franka_panda/panda.urdf"
PR2 = "package://pybullet_data/pr2_gripper.urdf"
EXAMPLES = "package://example-robot-data/robots"
G1 = "g1_description/urdf/g1_29dof_with_hand_rev_1_0.urdf"
WSG = "package://static_scenes/hands/wsg50.urdf"


def model(reference: str) -> RobotModel:
    return RobotModel(resolve(reference, Path()) or Path())


@pytest.mark.parametrize(
    ("name", "reference", "tool"),
    [
        ("franka", PANDA, "panda_grasptarget"),
        ("wsg50", WSG, "wsg50_tool"),
        ("pr2", PR2, None),
        ("pr2_left", f"{EXAMPLES}/pr2_description/urdf/pr2.urdf", "l_gripper_tool_frame"),
        ("pr2_right", f"{EXAMPLES}/pr2_description/urdf/pr2.urdf", "r_gripper_tool_frame"),
        ("talos_left", f"{EXAMPLES}/talos_data/robots/talos_full_v2.urdf", "gripper_left_base_link"),
        ("talos_right", f"{EXAMPLES}/talos_data/robots/talos_full_v2.urdf", "gripper_right_base_link"),
        ("dex3_left", f"{EXAMPLES}/{G1}", "left_hand_palm_link"),
        ("dex3_right", f"{EXAMPLES}/{G1}", "right_hand_palm_link"),
    ],
)
def test_the_shipped_hands_are_as_measured(name, reference, tool):
    measured, shipped = measure_hand(model(reference), tool), {**HANDS, **SIDED_HANDS}[name]
    assert (set(measured.links), set(measured.touch_links)) == (set(shipped.links), set(shipped.touch_links))
    for field in LENGTHS:
        assert getattr(measured, field) == pytest.approx(getattr(shipped, field), abs=5e-4), field
    assert measured.tool is not None
    assert shipped.tool is not None
    assert measured.tool.link == shipped.tool.link
    np.testing.assert_allclose(measured.tool.matrix(), shipped.tool.matrix(), atol=1e-4)
    for opening in np.linspace(measured.min_opening + 0.003, measured.max_opening, 9):
        ours, theirs = shipped.joint_values(opening), measured.joint_values(opening)
        assert ours == pytest.approx(theirs, abs=2e-3)


@pytest.mark.parametrize(
    ("reference", "tool"),
    [
        (PANDA, "panda_grasptarget"),
        (WSG, "wsg50_tool"),
        (PR2, None),
        (f"{EXAMPLES}/pr2_description/urdf/pr2.urdf", "l_gripper_tool_frame"),
        (f"{EXAMPLES}/{G1}", "left_hand_palm_link"),
    ],
)
def test_fingers_are_as_wide_as_trimesh_cuts_them(reference, tool):
    """Convex hulls in front of the plane that objects reach back to, fingers closed, half open and open."""
    urdf = model(reference)
    hand = measure_hand(urdf, tool)
    assert hand.tool is not None
    widest = 0.0
    for opening in np.linspace(hand.min_opening, hand.max_opening, 3):
        q = urdf.default_values()
        for joint, value in hand.joint_values(opening).items():
            q[urdf.joint_names.index(joint)] = value
        poses = urdf.forward(q)
        T_tool_root = inverse(poses[urdf.link_index(hand.tool.link)] @ hand.tool.matrix())
        for link in hand.touch_links:
            for points in urdf.hulls(link):
                hull = trimesh.PointCloud(points).convex_hull
                hull.apply_transform(T_tool_root @ poses[urdf.link_index(link)])
                front = hull.slice_plane([0, 0, -hand.finger_depth], [0, 0, 1])
                if len(front.vertices):
                    widest = max(widest, 2 * float(np.abs(front.bounds[:, 0]).max()))
    assert hand.finger_width == pytest.approx(widest + 0.002, abs=5e-4)


def box(size: np.ndarray, at: np.ndarray) -> str:
    text = [" ".join(f"{v:.9g}" for v in values) for values in (size, at)]
    return f"<collision><origin xyz='{text[1]}'/><geometry><box size='{text[0]}'/></geometry></collision>"


def box_hand(axes: np.ndarray, opens: tuple[int, int], sizes: dict[str, float], tool: str = "") -> str:
    """A palm and two fingers of boxes, closing along axes[1] and approaching along axes[2]."""
    depth, width, length, thick, stroke = (sizes[k] for k in ("depth", "width", "length", "thick", "stroke"))

    def placed(size: list[float], at: list[float]) -> str:
        return box(np.abs(axes @ size), axes @ at)

    links = f"<link name='palm'>{placed([width * 2, 0.12, depth], [0, 0, depth / 2])}</link>"
    joints = ""
    for side, name, way in ((1, "one", opens[0]), (-1, "two", opens[1])):
        shape = placed([width, thick, length], [0, side * thick / 2, depth + length / 2])
        links += f"<link name='{name}'>{shape}</link>"
        # A joint may open towards its upper limit or towards its lower one.
        axis = " ".join(f"{v:g}" for v in axes @ [0, side * way, 0])
        limits = f"lower='{min(0, way * stroke):g}' upper='{max(0, way * stroke):g}'"
        joints += (
            f"<joint name='slide_{name}' type='prismatic'><parent link='palm'/><child link='{name}'/>"
            f"<axis xyz='{axis}'/><limit {limits} effort='1' velocity='1'/></joint>"
        )
    return f"<robot name='boxes'>{links}{joints}{tool}</robot>"


directions = st.permutations([0, 1, 2]).flatmap(
    lambda order: st.tuples(*[st.sampled_from([-1.0, 1.0])] * 3).map(lambda s: np.diag(s)[:, order])
)


@given(
    directions,
    st.tuples(*[st.sampled_from([-1, 1])] * 2),
    st.fixed_dictionaries(
        {
            "depth": st.floats(0.03, 0.1),
            "width": st.floats(0.01, 0.04),
            "length": st.floats(0.03, 0.12),
            "thick": st.floats(0.005, 0.02),
            "stroke": st.floats(0.01, 0.06),
        }
    ),
)
@settings(max_examples=16, deadline=None)
def test_a_hand_of_boxes_is_measured_as_it_was_built(tmp_path_factory, axes, opens, sizes):
    path = tmp_path_factory.mktemp("hand") / "boxes.urdf"
    path.write_text(box_hand(axes, opens, sizes))
    hand = measure_hand(RobotModel(path))
    assert hand.links == ("palm", "one", "two")
    assert hand.touch_links == ("one", "two")
    assert hand.min_opening == 0.0
    depth = sizes["length"] - 0.01 - 0.004
    # The axis of an object is no further out than the tips of the fingers, 10 mm in front of the tool frame.
    assert hand.max_opening == pytest.approx(2 * min(sizes["stroke"], depth + 0.01), abs=1e-4)
    assert hand.finger_depth == pytest.approx(depth, abs=1e-4)
    assert hand.pad_width == pytest.approx(sizes["width"], abs=1e-4)
    assert hand.palm_width == pytest.approx(2 * sizes["width"], abs=1e-4)
    assert hand.finger_width == pytest.approx(sizes["width"] + 0.002, abs=1e-4)  # Bullet's margin of 1 mm
    for name, way in zip(("slide_one", "slide_two"), opens, strict=True):
        for opening in (0.0, 0.4 * hand.max_opening, hand.max_opening):
            assert hand.joint_values(opening)[name] == pytest.approx(way * opening / 2, abs=2e-4)
    assert hand.tool is not None
    tool = hand.tool.matrix()
    np.testing.assert_allclose(tool[:3, 2], axes[:, 2], atol=1e-9)
    np.testing.assert_allclose(np.abs(tool[:3, 1]), np.abs(axes[:, 1]), atol=1e-9)
    np.testing.assert_allclose(tool[:3, 3], axes[:, 2] * (sizes["depth"] + sizes["length"] - 0.01), atol=1e-4)
    assert hand.urdf == str(path)


SIZES = {"depth": 0.05, "width": 0.02, "length": 0.06, "thick": 0.01, "stroke": 0.04}


def test_a_tool_link_gives_the_origin_and_is_turned_where_its_axes_are_others(tmp_path):
    """The link's z closes the fingers; its origin is 20 mm behind the tips, 5 mm off the middle."""
    turned = from_rotation([[0, 1, 0], [0, 0, 1], [1, 0, 0]])
    tool = (
        "<link name='grasp'/><joint name='grasp_joint' type='fixed'><parent link='palm'/>"
        f"<child link='grasp'/><origin xyz='0.005 0 0.09' rpy='{' '.join(map(str, rpy(turned)))}'/></joint>"
    )
    path = tmp_path / "boxes.urdf"
    path.write_text(box_hand(np.eye(3), (1, 1), SIZES, tool))
    hand = measure_hand(RobotModel(path), "grasp")
    assert hand.tool is not None
    assert (hand.tool.link, hand.tool.position) == ("grasp", (0.0, 0.0, 0.0))
    np.testing.assert_allclose(turned[:3, :3] @ hand.tool.matrix()[:3, :3], np.eye(3), atol=1e-9)
    assert hand.finger_depth == pytest.approx(0.09 - 0.05 - 0.004, abs=2e-4)


def test_a_palm_to_one_side_counts_for_what_it_covers_on_both(tmp_path):
    """A palm 40 mm wide, 12 mm off the middle of the fingers, reaches 8 mm on the narrow side."""
    text = box_hand(np.eye(3), (1, 1), SIZES)
    shape = box(np.array([0.04, 0.12, 0.05]), np.array([0, 0, 0.025]))
    assert shape in text
    path = tmp_path / "boxes.urdf"
    path.write_text(text.replace(shape, box(np.array([0.04, 0.12, 0.05]), np.array([0.012, 0, 0.025]))))
    assert measure_hand(RobotModel(path)).palm_width == pytest.approx(0.016, abs=1e-4)


def test_of_several_hands_one_must_be_named(tmp_path):
    one = box_hand(np.eye(3), (1, 1), SIZES).removeprefix("<robot name='boxes'>").removesuffix("</robot>")
    two = one
    for name in ("palm", "one", "two"):
        two = two.replace(f"'{name}'", f"'other_{name}'").replace(f"'slide_{name}'", f"'other_slide_{name}'")
    wrists = "".join(
        f"<joint name='wrist_{name}' type='revolute'><parent link='torso'/><child link='{name}'/>"
        "<axis xyz='0 0 1'/><limit lower='-1' upper='1' effort='1' velocity='1'/></joint>"
        for name in ("palm", "other_palm")
    )
    path = tmp_path / "two.urdf"
    path.write_text(f"<robot name='two'><link name='torso'/>{one}{two}{wrists}</robot>")
    with pytest.raises(UrdfError, match=r"2 hands.*--tool, one of 'other_palm', 'palm'"):
        measure_hand(RobotModel(path))
    hand = measure_hand(RobotModel(path), "other_palm")
    assert hand.links == ("other_palm", "other_one", "other_two")
    assert hand.urdf is None  # it comes with the robot
    assert hand.tool is not None
    assert hand.tool.position == pytest.approx((0, 0, 0.1))  # the palm's own origin is no place for it
    with pytest.raises(UrdfError, match="fingers or a jaw hang on"):
        measure_hand(RobotModel(path), "other_one")


PIECES = (
    f"<link name='tip'>{box(np.full(3, 0.01), np.zeros(3))}</link><joint name='off' type='fixed'>"
    "<parent link='one'/><child link='tip'/><origin xyz='0 0 0.165'/></joint></robot>"
)
"""A finger tip that is 50 mm beyond the finger."""


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("type='prismatic'", "type='fixed'"), "two or more fingers, or --tool"),
        (("lower='0' upper='0.009'", "lower='0' upper='0'"), "joints that part the fingers"),
        ((r"xyz='0 (-?)1 0'", r"xyz='\g<1>1 0 0'"), "fingers that part as their joints move"),
        (("type='prismatic'", "type='continuous'"), "joints, with limits"),
        (("</robot>", PIECES), "gap between the shapes of one and tip .mm.: 50.0"),
    ],
)
def test_what_is_no_parallel_hand(change, message, tmp_path):
    old, new = change
    text = re.sub(old, new, box_hand(np.eye(3), (1, 1), {**SIZES, "stroke": 0.009}))
    path = tmp_path / "boxes.urdf"
    path.write_text(text)
    with pytest.raises(UrdfError, match=message) as caught:
        measure_hand(RobotModel(path))
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def hand_of(text: str) -> Hand:
    """Paste what the command printed under a robot, and read the scene."""
    robot = {"name": "iiwa", "urdf": IIWA, "mount": FLANGE, **yaml.safe_load(text)}
    content = {
        "schema_version": 1,
        "name": "pasted",
        "robots": [robot],
        "object": {"name": "bar", "profile": [[0, 0.02], [0.5, 0.02]]},
        "tasks": [{"name": "hold", "pose": {}}],
    }
    return Scene.from_content(content).arm().hand


@pytest.mark.parametrize("reference", [PR2, WSG])
def test_the_command_prints_a_hand_that_a_scene_takes(reference, capsys):
    assert main(["hand", reference]) == 0
    printed = hand_of(capsys.readouterr().out)
    measured = measure_hand(model(reference))
    assert printed.urdf == reference
    assert printed.joint_values(0.03) == measured.joint_values(0.03)
    assert printed.tool is not None
    assert measured.tool is not None
    np.testing.assert_allclose(printed.tool.matrix(), measured.tool.matrix(), atol=1e-6)
    fields = (
        "links",
        "touch_links",
        "min_opening",
        "max_opening",
        "palm_width",
        "palm_depth",
        "finger_width",
    )
    for field in fields:
        assert getattr(printed, field) == getattr(measured, field)


def test_the_command_prints_one_hand_for_each_tool(capsys):
    assert main(["hand", PANDA, "--tool", "panda_grasptarget", "panda_hand"]) == 0
    assert capsys.readouterr().out.count("hand:") == 2
    assert main(["hand", "no.urdf"]) == 2
    assert (
        capsys.readouterr().err
        == "symgrasp: command line: URDF: 'no.urdf': expected an existing URDF file; there is no no.urdf\n"
    )


def test_a_shipped_hand_survives_its_notation():
    for hand in HANDS.values():
        content = yaml.safe_load(hand_yaml(hand))["hand"]
        assert content["max_opening"] == hand.max_opening
        assert content.get("urdf") == hand.urdf
