"""What an arm of a scene holds with, and where: as its file has it."""

from __future__ import annotations

from symgrasp.robot.hand import HANDS
from symgrasp.scene.format import ArmFile
from symgrasp.scene.scene import Scene

__all__ = ["IN_URDF", "MOUNTABLE", "arm_file", "hand_option", "tool_link", "tool_links"]

IN_URDF = "as in the URDF"
"""The option for a hand that is part of the robot's URDF."""

MOUNTABLE = tuple(name for name, hand in HANDS.items() if hand.urdf)
"""Hands that can be mounted."""


def arm_file(scene: Scene, name: str) -> ArmFile:
    """Return an arm as the scene's file has it."""
    return next(arm for robot in scene.file.robots for arm in robot.arm_files() if arm.name == name)


def hand_option(scene: Scene, name: str) -> str:
    """Return the option in the menu of an arm's hand."""
    entry = arm_file(scene, name)
    return entry.hand if entry.mount and isinstance(entry.hand, str) else IN_URDF


def tool_link(scene: Scene, name: str) -> str:
    """Return the link of the robot's own URDF that an arm's hand is on."""
    entry = arm_file(scene, name)
    if entry.mount:
        return entry.mount.link
    tool = scene.arms[name].hand.tool
    return entry.tool or (tool.link if tool else scene.arms[name].tool)


def tool_links(scene: Scene, name: str) -> tuple[str, ...]:
    """Return the links of an arm that a hand may be on: those that its last joint moves, and no later one.

    They are links of the robot's own URDF.
    """
    arm, mount = scene.arms[name], arm_file(scene, name).mount
    model, last, hand = arm.robot.model, arm.joint_names[-1], arm.hand
    added = {*hand.links, arm.tool} if mount else {arm.tool} if hand.tool and not hand.tool.is_link else set()
    used, found = tool_link(scene, name), []
    for link in model.link_names:
        moved_by = [joint.name for joint in model.chain(link) if joint.source >= 0]
        if moved_by and moved_by[-1] == last and link not in added | set(hand.touch_links):
            found.append(link)
    return tuple(found) if used in found else (used, *found)
