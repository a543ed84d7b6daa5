"""A scene as MoveIt takes it: its bodies as a planning scene file, and the groups of a robot as an SRDF."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from itertools import combinations

import numpy as np

from symgrasp.errors import PlanError
from symgrasp.plan.plan import Plan
from symgrasp.poses import Array, inverse, quat_wxyz, wxyz_to_xyzw
from symgrasp.scene.parts import Obstacle
from symgrasp.scene.scene import Scene
from symgrasp.world import own_pairs

__all__ = ["srdf_of", "to_planning_scene", "to_srdf"]


def to_planning_scene(plan: Plan) -> str:
    """Return the obstacles, and the object in the first task, as MoveIt's text format of planning scenes.

    RViz opens it as ``.scene`` file ("Import From Text" of the tab Scene Objects). MoveIt takes poses to be
    in its planning frame, which is the root link of the robot: so are those of a scene with one robot. With
    several, of which MoveIt needs one model, they are in the world. Lengths are in m, quaternions xyzw.

    Raises:
        MeshError: a mesh of an obstacle cannot be read.
    """
    scene = Scene.from_content(plan.scene.content, "plan: scene.content")
    bases = [robot.T_world_base for robot in scene.robots.values()]
    T_frame_world = inverse(bases[0]) if len(bases) == 1 else np.eye(4)
    lines = [" ".join(scene.name.split())]
    for obstacle in scene.obstacles:
        lines += _object_lines(obstacle, T_frame_world @ obstacle.T_world_obstacle)
    mesh = scene.profile.mesh()
    T_object = T_frame_world @ plan.tasks[0].object_pose_turned.array()
    lines += ["* " + scene.file.object.name, *_pose_lines(T_object), "1"]
    lines += [*_mesh_lines(mesh.vertices, mesh.faces), *_pose_lines(np.eye(4)), "0 0 0 0", "0"]
    return "\n".join([*lines, "."]) + "\n"


def _object_lines(obstacle: Obstacle, pose: Array) -> list[str]:
    shapes = obstacle.shapes()
    lines = ["* " + obstacle.name, *_pose_lines(pose), str(len(shapes))]
    for link, shape in shapes:
        if shape.kind == "mesh":
            mesh = obstacle.mesh(link, shape)
            lines += _mesh_lines(mesh.vertices, mesh.faces)
        else:
            lines += [shape.kind, _numbers(shape.size)]
        lines += [*_pose_lines(shape.pose), "0 0 0 0"]  # no colour of its own
    return [*lines, "0"]  # no frames


def _mesh_lines(vertices: Array, faces: np.ndarray) -> list[str]:
    rows = [*map(_numbers, vertices), *(" ".join(str(int(k)) for k in face) for face in faces)]
    return ["mesh", f"{len(vertices)} {len(faces)}", *rows]


def _pose_lines(pose: Array) -> list[str]:
    return [_numbers(pose[:3, 3]), _numbers(wxyz_to_xyzw(quat_wxyz(pose)))]


def _numbers(values: Sequence[float] | Array) -> str:
    return " ".join(repr(float(value)) for value in values)


def to_srdf(plan: Plan) -> str:
    """Return an SRDF of the robot: its arms and hands as groups, home, and the links that may touch.

    A fixed virtual joint has its root in the frame ``world``; MoveIt's planning frame stays the root.

    Raises:
        PlanError: the scene has several robots, of which each would need a file of its own.
    """
    scene = Scene.from_content(plan.scene.content, "plan: scene.content")
    if len(scene.robots) > 1:
        raise PlanError("plan", "scene.content.robots", list(scene.robots), "one robot, for an SRDF")
    return srdf_of(scene)


def srdf_of(scene: Scene) -> str:
    """Return an SRDF of the only robot of a scene; see `to_srdf`."""
    (robot,) = scene.robots.values()
    model = robot.model
    root = ET.Element("robot", name=model.name)
    ET.SubElement(
        root, "virtual_joint", name="world_joint", type="fixed", parent_frame="world", child_link=model.root
    )
    for arm in scene.arms.values():
        ET.SubElement(
            ET.SubElement(root, "group", name=arm.name), "chain", base_link=model.root, tip_link=arm.tool
        )
        hand = ET.SubElement(root, "group", name=f"{arm.name}_hand")
        for link in arm.hand.links:
            ET.SubElement(hand, "link", name=link)
        ET.SubElement(
            root, "end_effector", name=f"{arm.name}_tool", group=hand.get("name", ""), parent_link=arm.tool,
            parent_group=arm.name,
        )  # fmt: skip
        for group, joints in ((arm.name, arm.joint_names), (f"{arm.name}_hand", tuple(arm.hand.joints))):
            state = ET.SubElement(root, "group_state", name=f"{group}_home", group=group)
            for joint in joints:
                value = robot.home[model.joint_names.index(joint)]
                ET.SubElement(state, "joint", name=joint, value=repr(float(value)))
    checked = {frozenset(pair) for pair in own_pairs(scene, robot.name)}
    neighbours = model.neighbours()
    for a, b in combinations(model.colliding_links(), 2):
        if frozenset((a, b)) not in checked:
            reason = "Adjacent" if frozenset((a, b)) in neighbours else "Default"
            ET.SubElement(root, "disable_collisions", link1=a, link2=b, reason=reason)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode", xml_declaration=True) + "\n"
