"""Which joints between a robot's base and a tool are the arm's; the others of the chain rest at home.

Where they are not named, they are all revolute joints of the chain as long as these are at most
`MOST_JOINTS`. Of a longer chain the first ones are taken for a torso: those before the last fork behind which
both this arm and another branch of the tree have `BRANCH` revolute joints or more. They rest, as long as
that leaves 6 or 7 joints; a chain that it does not decide is refused.
"""

from __future__ import annotations

from symgrasp.errors import UrdfError, one_of
from symgrasp.robot.joint import Joint
from symgrasp.robot.model import RobotModel

__all__ = [
    "BRANCH",
    "MOST_JOINTS",
    "guess_arm_joints",
    "joints_between",
    "joints_outwards",
    "revolute_joints",
    "turns",
]

MOST_JOINTS = 7
"""Most joints of an arm."""

BRANCH = 5
"""A branch of the tree with so many revolute joints in a row is another arm or a leg; fingers have fewer."""


def revolute_joints(model: RobotModel, tool: str) -> list[str]:
    """Return the joints from the root to a link that turn and take a value, in this order.

    Raises:
        UrdfError: there is no such link.
    """
    return [joint.name for joint in model.chain(tool) if turns(model, joint)]


def guess_arm_joints(model: RobotModel, tool: str, others: frozenset[str] = frozenset()) -> list[str]:
    """Return the joints of the arm that holds a tool, from base to tool.

    Args:
        model: the robot.
        tool: the tool link.
        others: joints that are not the arm's: shared with another arm, or of its hand.

    Raises:
        UrdfError: there is no such link, or the chain is long and it is not clear which joints are the arm's.
    """
    names = [name for name in revolute_joints(model, tool) if name not in others]
    if len(names) <= MOST_JOINTS:
        return names
    before = _before_last_fork(model, tool)
    arm = [name for name in names if name not in before]
    if len(arm) not in (MOST_JOINTS - 1, MOST_JOINTS):
        expected = f"joints: [first, last] in the scene; {len(names)} joints turn from the base to {tool}"
        raise UrdfError(model.path, f"arm at {tool}", names, expected)
    return arm


def joints_between(model: RobotModel, tool: str, first: str, last: str) -> list[str]:
    """Return the joints of a chain from one to another that turn and take a value.

    Args:
        model: the robot.
        tool: the link at the end of the chain.
        first: name of the first joint of the arm.
        last: name of its last joint.

    Raises:
        UrdfError: there is no such link, or the joints are not in that order on the chain.
    """
    names = revolute_joints(model, tool)
    for name in (first, last):
        if name not in names:
            expected = f"a joint that turns between the base and {tool}: " + one_of(names, name)
            raise UrdfError(model.path, "joints", name, expected)
    k, m = names.index(first), names.index(last)
    if k > m:
        raise UrdfError(model.path, "joints", [first, last], "first the one that is nearer to the base")
    return names[k : m + 1]


def joints_outwards(model: RobotModel) -> list[int]:
    """Return for each link the most joints that turn on the way from it to the end of a branch."""
    longest = [0] * len(model.link_names)
    for joint in reversed(model.joints):  # children before their parents
        longest[joint.parent] = max(longest[joint.parent], longest[joint.child] + turns(model, joint))
    return longest


def turns(model: RobotModel, joint: Joint) -> bool:
    """Whether a joint turns and takes a value of its own."""
    return joint.kind in ("revolute", "continuous") and model.joint_names[joint.source] == joint.name


def _before_last_fork(model: RobotModel, tool: str) -> set[str]:
    """Return the joints of a chain before the last fork into two branches of `BRANCH` joints or more."""
    longest = joints_outwards(model)
    chain = model.chain(tool)
    branches: dict[int, list[tuple[int, Joint]]] = {joint.parent: [] for joint in chain}
    for joint in model.joints:
        if joint.parent in branches:
            branches[joint.parent].append((longest[joint.child] + turns(model, joint), joint))
    left = len(revolute_joints(model, tool))
    before: list[str] = []
    result: set[str] = set()
    for joint in chain:
        others = [length for length, other in branches[joint.parent] if other is not joint]
        if left >= BRANCH and max(others, default=0) >= BRANCH:
            result = set(before)
        before.append(joint.name)
        left -= turns(model, joint)
    return result
