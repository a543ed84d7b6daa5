"""Files for MoveIt, read by Pinocchio (SRDF), and as MoveIt's loader reads them (planning scene)."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator

import numpy as np
import pytest

from symgrasp.cli.main import main
from symgrasp.errors import PlanError
from symgrasp.motion.moveit import to_planning_scene, to_srdf
from symgrasp.plan.plan import Plan
from symgrasp.poses import Array, from_position_quat, xyzw_to_wxyz
from symgrasp.scene.scene import Scene
from symgrasp.world import own_pairs
from tests.motion.recorded import recorded_motion, recorded_plan
from tests.plan.test_plan import bimanual

pinocchio = pytest.importorskip("pinocchio")


def numbers(lines: Iterator[str]) -> list[float]:
    return [float(part) for part in next(lines).split()]


def pose(lines: Iterator[str]) -> Array:
    return from_position_quat(numbers(lines), xyzw_to_wxyz(numbers(lines)))


def read_scene(text: str) -> dict[str, list[tuple[str, Array, Array]]]:
    """Return name → (kind, sizes or vertices, pose in the world) of each shape, as MoveIt reads it."""
    lines = iter(text.splitlines())
    next(lines)
    found: dict[str, list[tuple[str, Array, Array]]] = {}
    for head in lines:
        if head == ".":
            return found
        assert head.startswith("* ")
        T, shapes = pose(lines), []
        for _ in range(int(next(lines))):
            kind = next(lines)
            if kind == "mesh":
                vertices, triangles = (int(n) for n in next(lines).split())
                size = np.array([numbers(lines) for _ in range(vertices)])
                faces = np.array([numbers(lines) for _ in range(triangles)])
                assert faces.max() < vertices
            else:
                size = np.array(numbers(lines))
            shapes.append((kind, size, T @ pose(lines)))
            assert next(lines) == "0 0 0 0"
        assert next(lines) == "0"
        found[head[2:]] = shapes
    raise AssertionError("no end")


def test_the_planning_scene_has_the_bodies_where_they_are():
    scene = recorded_motion().scene
    found = read_scene(to_planning_scene(recorded_plan()))
    assert list(found) == [*(o.name for o in scene.obstacles), scene.file.object.name]
    for obstacle in scene.obstacles:
        for (kind, size, T), (_, shape) in zip(found[obstacle.name], obstacle.shapes(), strict=True):
            assert kind == shape.kind
            np.testing.assert_allclose(T, obstacle.T_world_obstacle @ shape.pose, atol=1e-12)
            if kind == "mesh":
                assert np.ptp(size, axis=0) == pytest.approx(shape.mesh("bowl").extents)
            else:
                np.testing.assert_array_equal(size, shape.size)
    ((_, vertices, T),) = found[scene.file.object.name]
    np.testing.assert_allclose(T, recorded_motion().poses[0], atol=1e-12)
    assert np.hypot(*vertices[:, :2].T).max() == pytest.approx(scene.profile.points[:, 1].max())


def test_the_planning_scene_is_in_the_frame_of_the_robot_s_root():
    """MoveIt's planning frame; with the base moved, what stands in the world is elsewhere in it."""
    content = recorded_plan().model_dump(mode="json")
    moved = from_position_quat([0.3, -0.2, 0.1], [np.cos(0.4), 0.0, 0.0, np.sin(0.4)])
    scene = content["scene"]["content"]
    assert scene["robots"][0]["base"] == {"position": [0.0, 0.0, 0.0]}
    scene["robots"][0]["base"] = {"position": [0.3, -0.2, 0.1], "rpy_deg": [0, 0, float(np.rad2deg(0.8))]}
    found, before = read_scene(to_planning_scene(Plan.model_validate(content))), recorded_plan()
    for name, shapes in read_scene(to_planning_scene(before)).items():
        for (kind, _, T), (same, _, now) in zip(shapes, found[name], strict=True):
            assert kind == same
            np.testing.assert_allclose(moved @ now, T, atol=1e-9)


def test_pinocchio_reads_the_srdf(tmp_path):
    scene = recorded_motion().scene
    robot = scene.arm().robot
    urdf, srdf = tmp_path / "robot.urdf", tmp_path / "robot.srdf"
    urdf.write_bytes(robot.model.urdf)
    srdf.write_text(to_srdf(recorded_plan()))
    model = pinocchio.buildModelFromUrdf(str(urdf))
    pinocchio.loadReferenceConfigurations(model, str(srdf), False)
    states = {"panda_home": scene.arm().joint_names, "panda_hand_home": tuple(scene.arm().hand.joints)}
    assert {entry.key() for entry in model.referenceConfigurations} == {*states}
    assert {name for names in states.values() for name in names} == {*robot.model.joint_names}
    for name, value in zip(robot.model.joint_names, robot.home, strict=True):
        home = model.referenceConfigurations[next(state for state, names in states.items() if name in names)]
        assert home[model.joints[model.getJointId(name)].idx_q] == pytest.approx(value)
    geometry = pinocchio.buildGeomFromUrdf(model, str(urdf), pinocchio.GeometryType.COLLISION)
    geometry.addAllCollisionPairs()
    pinocchio.removeCollisionPairs(model, geometry, str(srdf), False)
    names = [model.frames[o.parentFrame].name for o in geometry.geometryObjects]
    kept = {frozenset((names[p.first], names[p.second])) for p in geometry.collisionPairs}
    expected = {frozenset(pair) for pair in own_pairs(scene, robot.name)}
    assert {pair for pair in kept if len(pair) == 2} == expected


def test_the_root_of_the_robot_is_fixed_in_the_world():
    """As Pinocchio has it: the parent of all its joints and of no link's own."""
    model = pinocchio.buildModelFromXML(recorded_motion().scene.arm().robot.model.urdf.decode())
    (joint,) = ET.fromstring(to_srdf(recorded_plan())).iter("virtual_joint")
    assert (joint.get("type"), joint.get("parent_frame")) == ("fixed", "world")
    child = model.frames[model.getFrameId(joint.get("child_link"))]
    bodies = [frame for frame in model.frames if frame.type == pinocchio.FrameType.BODY]
    assert child.name == bodies[0].name
    assert child.parentJoint == 0


def test_several_robots_have_no_srdf_together():
    with pytest.raises(PlanError, match="one robot"):
        to_srdf(bimanual())
    assert set(read_scene(to_planning_scene(bimanual()))) >= {
        o.name for o in Scene.from_content(bimanual().scene.content).obstacles
    }


@pytest.mark.parametrize("name", ["moveit-scene", "srdf"])
def test_on_the_command_line(name, tmp_path):
    recorded_plan().save(tmp_path / "plan.json")
    assert main(["export", name, str(tmp_path / "plan.json"), "--out", str(tmp_path / "out")]) == 0
    assert (tmp_path / "out").stat().st_size > 500
