"""What a URDF holds: the arms that it seems to have, with their tools and hands."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from symgrasp.errors import InputError, SymgraspError
from symgrasp.hands.measure import measure_hand
from symgrasp.hands.structure import find_hand_structure, jaw_candidates, palm_candidates
from symgrasp.references import resolve
from symgrasp.robot.arm_joints import guess_arm_joints, joints_between, joints_outwards, revolute_joints
from symgrasp.robot.catalogue import CATALOGUE, CatalogueArm, CatalogueRobot
from symgrasp.robot.groups import ArmGroup, arm_groups, group_links
from symgrasp.robot.hand import HANDS, SIDED_HANDS, Hand
from symgrasp.robot.model import RobotModel

__all__ = ["FoundArm", "find_arms", "in_catalogue"]

LEAST_JOINTS = 5
"""A chain of fewer revolute joints than this is no arm."""

LEGS = ("leg", "foot", "ankle", "hip", "knee", "toe", "head", "neck", "camera", "wheel", "caster")
"""A chain whose last joint or link has one of these in its name is no arm."""

FLANGES = ("tool0", "tcp", "eef", "ee_link", "flange", "grasp")
"""Of several links at the end of an arm, one with one of these in its name is its tool, in this order."""


@dataclass(frozen=True)
class FoundArm:
    """An arm that a URDF seems to have.

    Attributes:
        name: what it is called in a scene.
        tool: the link that its hand is on.
        joints: its joints, from base to tool.
        resting: the joints before them that turn, a torso's.
        hand: its hand.
        named: whether the hand is a named one with a URDF of its own, to be mounted on the tool.
        mount: where it is mounted: position (m) and roll, pitch and yaw (degrees).
        trouble: what is wrong with the hand or the joints; empty where nothing is.
        source: the group of an SRDF that says so; empty where the arm is a guess.
    """

    name: str
    tool: str
    joints: tuple[str, ...]
    resting: tuple[str, ...]
    hand: Hand | None
    named: bool = False
    mount: tuple[tuple[float, float, float], tuple[float, float, float]] = ((0, 0, 0), (0, 0, 0))
    trouble: str = ""
    source: str = ""


def in_catalogue(path: Path) -> CatalogueRobot | None:
    """Return the robot of the catalogue that a URDF is, if any."""
    for robot in CATALOGUE:
        own = resolve(robot.urdf, Path())
        if own is not None and own.resolve() == path.resolve():
            return robot
    return None


def find_arms(model: RobotModel) -> list[FoundArm]:
    """Return the arms of a robot: of the catalogue, else of the SRDF, else those with hands or long chains.

    An arm without a hand that can be measured gets a gripper, the WSG 50, mounted on its last link. The only
    arm of a robot is called what the robot is, where that is a plain word.
    """
    known = in_catalogue(model.path)
    if known is not None:
        return [_known_arm(model, arm) for arm in known.arms]
    arms = (
        _arms_of_groups(model)
        or _with_hands(model, palm_candidates(model))
        or _with_hands(model, jaw_candidates(model))
        or _with_other_hands(model)
        or [_arm(model, link, mounted=True) for link in _ends(model)]
    )
    name = model.name if re.fullmatch(r"\w{1,50}", model.name) else "arm"
    return arms if len(arms) != 1 else [_renamed(arms[0], name)]


def _arms_of_groups(model: RobotModel) -> list[FoundArm]:
    """Return the arms that the groups of the SRDF are, with the hands that its end effectors are."""
    groups = [
        group for group in arm_groups(model) if not (_is_leg(model, group.tip) or _names_leg(group.name))
    ]
    return [_arm_of_group(model, group) for group in groups]


def _arm_of_group(model: RobotModel, group: ArmGroup) -> FoundArm:
    """Return the arm that a group is: with its end effector or what is at its tip, or a WSG 50 mounted."""
    effector, places = group.end_effector, [group.tip]
    if effector is not None:
        places = [effector.parent_link, *group_links(model, effector.group), group.tip]
    tool, hand, named, trouble = group.tip, HANDS["wsg50"], True, ""
    for place in places:
        if place not in model.link_names or group.joints[-1] not in [j.name for j in model.chain(place)]:
            continue  # it is part of the arm
        try:
            tool = find_hand_structure(model, place).base
        except SymgraspError:
            continue  # there are no fingers
        found, trouble = _measured(model, tool)
        hand, named = (hand, True) if found is None else (found, False)
        break
    tool = group.tip if named else tool
    resting = [name for name in revolute_joints(model, tool) if name not in (*group.joints, *hand.joints)]
    source = f"group {group.name} of {model.srdf.path.name}" if model.srdf else ""
    return FoundArm(
        group.name, tool, group.joints, tuple(resting), hand, named, trouble=trouble, source=source
    )


def _with_hands(model: RobotModel, palms: Iterable[str]) -> list[FoundArm]:
    """Return the arms that end at some links and whose hands can be measured."""
    arms = [
        _arm(model, link)
        for link in palms
        if len(revolute_joints(model, link)) >= LEAST_JOINTS and not _is_leg(model, link)
    ]
    return [arm for arm in arms if arm.hand is not None]


def _with_other_hands(model: RobotModel) -> list[FoundArm]:
    """Return the arms that end at a palm whose fingers are no arms: with hands that cannot be measured."""
    longest = dict(zip(model.link_names, joints_outwards(model), strict=True))
    return [
        _arm(model, link)
        for link in palm_candidates(model)
        if len(revolute_joints(model, link)) >= LEAST_JOINTS > longest[find_hand_structure(model, link).base]
        and not _is_leg(model, link)
    ]


def _renamed(arm: FoundArm, name: str) -> FoundArm:
    return FoundArm(**{**arm.__dict__, "name": name})


def _known_arm(model: RobotModel, arm: CatalogueArm) -> FoundArm:
    """Return an arm of the catalogue; a hand in the URDF is measured."""
    joints = tuple(joints_between(model, arm.tool, *arm.joints))
    resting = tuple(name for name in revolute_joints(model, arm.tool) if name not in joints)
    if arm.hand is not None:
        hand = {**HANDS, **SIDED_HANDS}[arm.hand]
        return FoundArm(arm.name, arm.tool, joints, resting, hand, hand.urdf is not None, arm.mount)
    hand, trouble = _measured(model, arm.tool)
    if hand is None:
        hand, named = HANDS["wsg50"], True
        return FoundArm(arm.name, arm.tool, joints, resting, hand, named, trouble=trouble)
    return FoundArm(arm.name, arm.tool, joints, resting, hand)


def _measured(model: RobotModel, link: str) -> tuple[Hand | None, str]:
    """Return the hand at a link, or why there is none."""
    try:
        return measure_hand(model, link), ""
    except InputError as error:
        return None, _trouble(model, error)


def _trouble(model: RobotModel, error: InputError) -> str:
    """Return what is wrong, with its source where that is not the robot, which has been named."""
    return error.without_source if error.source == str(model.path) else str(error)


def _arm(model: RobotModel, link: str, mounted: bool = False) -> FoundArm:
    """Return the arm that ends at a link, whose hand is measured, or the WSG 50 where it is to be mounted."""
    if mounted:
        hand, trouble = HANDS["wsg50"], ""
    else:
        link = find_hand_structure(model, link).base
        hand, trouble = _measured(model, link)
    others = frozenset(hand.joints) if hand and not mounted else frozenset[str]()
    turning = [name for name in revolute_joints(model, link) if name not in others]
    joints: list[str] = []
    try:
        joints = guess_arm_joints(model, link, others)
    except InputError as error:
        trouble = trouble or _trouble(model, error)
    resting = tuple(name for name in turning if name not in joints)
    return FoundArm(link, link, tuple(joints), resting if joints else (), hand, mounted, trouble=trouble)


def _ends(model: RobotModel) -> Iterator[str]:
    """Yield the link at the end of every chain that is long enough to be an arm."""
    parents = {joint.parent for joint in model.joints if joint.source >= 0}
    first = list(range(len(model.link_names)))  # link → the first of those that move with it
    rigid: dict[int, list[int]] = {}  # such a link → all that move with it
    for joint in model.joints:  # parents before children
        if joint.source < 0:
            first[joint.child] = first[joint.parent]
        rigid.setdefault(first[joint.child], []).append(joint.child)
    for joint in model.joints:
        if joint.source < 0 or not parents.isdisjoint(rigid[joint.child]):
            continue
        child = model.link_names[joint.child]
        if _is_leg(model, child):
            continue
        if len(revolute_joints(model, child)) >= LEAST_JOINTS:
            names = [model.link_names[k] for k in rigid[joint.child]]
            flange = [link for word in FLANGES for link in names if word in link.lower()]
            yield flange[0] if flange else child


def _is_leg(model: RobotModel, link: str) -> bool:
    return any(map(_names_leg, [link, *(joint.name for joint in model.chain(link)[-1:])]))


def _names_leg(name: str) -> bool:
    return any(word in name.lower() for word in LEGS)
