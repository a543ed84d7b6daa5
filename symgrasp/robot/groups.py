"""The arms that the groups of an SRDF name (https://wiki.ros.org/srdf)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from symgrasp.descriptions.srdf import EndEffector, Group
from symgrasp.robot.arm_joints import MOST_JOINTS, revolute_joints, turns
from symgrasp.robot.model import RobotModel

__all__ = ["ArmGroup", "arm_group", "arm_groups", "group_links"]

LEAST_JOINTS, ENOUGH = 5, 6
"""Fewest joints of a group that is an arm, and as many as are preferred to fewer."""


@dataclass(frozen=True)
class ArmGroup:
    """A group that is an arm: its joints that turn follow each other.

    Attributes:
        name: its name in the SRDF.
        joints: the joints that turn, from base to tip.
        tip: the link at the end of its chain, or that its last joint moves.
        end_effector: what the SRDF says is on it, None where it says nothing.
    """

    name: str
    joints: tuple[str, ...]
    tip: str
    end_effector: EndEffector | None


def arm_groups(model: RobotModel) -> list[ArmGroup]:
    """Return the groups of a robot's SRDF that are arms or legs, one for each last joint.

    Of several that end at the same joint, as where one has the torso too, the one with fewest joints counts.
    """
    if model.srdf is None:
        return []
    found: dict[str, ArmGroup] = {}
    for name in model.srdf.groups:
        group = _as_arm(model, name)
        if group is None:
            continue
        other = found.get(group.joints[-1])
        if other is None or _rank(group) < _rank(other):
            found[group.joints[-1]] = group
    return list(found.values())


def arm_group(model: RobotModel, chain: Sequence[str]) -> ArmGroup | None:
    """Return the group whose joints a chain of joints ends with, None where there is none."""
    for group in arm_groups(model):
        if group.joints == tuple(chain[-len(group.joints) :]):
            return group
    return None


def group_links(model: RobotModel, name: str) -> list[str]:
    """Return the links of a group in the model's order: named, or moved by its joints."""
    joints = _joints(model, name)
    links = {model.link_names[joint.child] for joint in model.joints if joint.name in joints}
    links.update(link for group in _with_subgroups(model, name) for link in group.links)
    return [link for link in model.link_names if link in links]


def _rank(group: ArmGroup) -> tuple[bool, int]:
    return len(group.joints) < ENOUGH, len(group.joints)


def _as_arm(model: RobotModel, name: str) -> ArmGroup | None:
    """Return a group as an arm, None where its joints do not follow each other or are too few or many."""
    joints = _joints(model, name)
    turning = [model.link_names[joint.child] for joint in model.joints
               if joint.name in joints and turns(model, joint)]  # fmt: skip
    if not LEAST_JOINTS <= len(turning) <= MOST_JOINTS:
        return None
    names = tuple(revolute_joints(model, turning[-1])[-len(turning) :])
    if set(names) != {model.chain(link)[-1].name for link in turning}:
        return None
    assert model.srdf is not None
    tips = [tip for group in _with_subgroups(model, name) for _, tip in group.chains]
    tip = next((tip for tip in tips if _last_joint(model, tip) == names[-1]), turning[-1])
    effector = next((e for e in model.srdf.end_effectors if _is_on(model, e, name, names[-1])), None)
    return ArmGroup(name, names, tip, effector)


def _is_on(model: RobotModel, effector: EndEffector, group: str, last: str) -> bool:
    """Whether an end effector is on an arm: by its name, or by the joint that moves its parent link."""
    if effector.parent_link not in model.link_names:
        return False
    return effector.parent_group == group or _last_joint(model, effector.parent_link) == last


def _last_joint(model: RobotModel, link: str) -> str | None:
    """Return the last joint before a link that turns."""
    names = revolute_joints(model, link) if link in model.link_names else []
    return names[-1] if names else None


def _joints(model: RobotModel, name: str) -> set[str]:
    """Return the joints of a group: named, on its chains, or before its links."""
    found: set[str] = set()
    for group in _with_subgroups(model, name):
        found.update(group.joints)
        found.update(_before(model, group.links))
        for base, tip in group.chains:
            if base in model.link_names and tip in model.link_names:
                above = {joint.name for joint in model.chain(base)}
                found.update(joint.name for joint in model.chain(tip) if joint.name not in above)
    return found


def _before(model: RobotModel, links: Iterable[str]) -> list[str]:
    """Return the joints that links hang on."""
    wanted = frozenset(links)
    return [joint.name for joint in model.joints if model.link_names[joint.child] in wanted]


def _with_subgroups(model: RobotModel, name: str) -> list[Group]:
    """Return a group and those in it; what the SRDF does not have is no error."""
    groups: Mapping[str, Group] = model.srdf.groups if model.srdf else {}
    names = [name] if name in groups else []
    for at in names:
        names += [other for other in groups[at].groups if other in groups and other not in names]
    return [groups[at] for at in names]
