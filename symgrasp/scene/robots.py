"""Building robots and their arms from a scene file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from symgrasp.descriptions.srdf import find_srdf, misnamed_srdf
from symgrasp.errors import InputError, SceneError, UrdfError, one_of
from symgrasp.poses import Array
from symgrasp.references import resolve
from symgrasp.robot.arm_joints import guess_arm_joints, joints_between, revolute_joints
from symgrasp.robot.assembly import Mount
from symgrasp.robot.groups import arm_group
from symgrasp.robot.hand import HANDS, SIDED_HANDS, Hand
from symgrasp.robot.model import RobotModel
from symgrasp.robot.robot import DEFAULT_ACCELERATION, Arm, Robot
from symgrasp.robot.support import area_of_corners, area_of_feet
from symgrasp.robot.torso import Torso
from symgrasp.scene.format import ArmFile, RobotFile, xacro_texts

__all__ = ["BuiltRobot", "RobotBuilder"]


class BuiltRobot(NamedTuple):
    """A robot, and what the file did not say of it.

    Attributes:
        file: its entry in the file, with what was guessed.
        robot: the robot.
        arms: its arms.
        notes: what was guessed, in words.
    """

    file: RobotFile
    robot: Robot
    arms: list[Arm]
    notes: list[str]


class RobotBuilder:
    """Builds the robots of a scene.

    Args:
        source: name of the scene file for error messages.
        folder: the folder that file references are relative to.
    """

    def __init__(self, source: str, folder: Path) -> None:
        self._source, self._folder = source, folder
        self._models: dict[tuple[object, ...], RobotModel] = {}

    def build(self, i: int, entry: RobotFile) -> BuiltRobot:
        """Return the robot with index i in the file, and its arms.

        Args:
            i: the index, for error messages.
            entry: the robot in the file, whose references have been checked.

        Raises:
            SceneError: a name is unknown, or a value is out of range.
            UrdfError: the URDF is unusable, or it is not clear which joints are an arm's.
        """
        field = f"robots[{i}]"
        fields = [field] if entry.arms is None else [f"{field}.arms[{k}]" for k in range(len(entry.arms))]
        files = entry.arm_files()
        hands = [self._hand(f, a) for f, a in zip(fields, files, strict=True)]
        mounts, tools = [], []
        for f, a, hand in zip(fields, files, hands, strict=True):
            mounts += self._mount(f, a, hand, entry)
            tools.append(self._tool(f, a, hand))
            if a.tool is None and hand.tool is not None and not hand.tool.is_link:
                mounts.append(Mount(hand.tool, None, tools[-1]))
        urdf = self._path(entry.urdf)
        srdf = self._path(entry.srdf) if entry.srdf else find_srdf(urdf)
        model = self.model(
            urdf,
            tuple(mounts),
            srdf,
            xacro_texts(entry.xacro_args),
            follow_up_axis=bool(entry.follow_up_axis),
        )
        chains = [self._chain(f, tool, model) for f, tool in zip(fields, tools, strict=True)]
        torso = self._torso(field, entry, model, tools)
        shared = frozenset(n for k, c in enumerate(chains) for n in c for o in chains[:k] if n in o)
        shared |= frozenset(torso.joint_names if torso else ())
        joints, notes = [], []
        if srdf and not entry.srdf:
            entry = entry.model_copy(update={"srdf": _beside(entry.urdf, urdf, srdf)})
            allowed = len(model.allowed_pairs())
            touch = f"{srdf.name}, which lets {allowed} pairs of links touch"
            misnamed = misnamed_srdf(urdf)
            notes.append(f"{entry.name}: srdf: {touch}" + (f"; {misnamed}" if misnamed else ""))
        elif srdf is None and (allowed := len(model.allowed_pairs())):
            notes.append(f"{entry.name}: {urdf.name} lets {allowed} pairs of links touch")
        if srdf is None and (misnamed := misnamed_srdf(urdf)):
            notes.append(f"{entry.name}: srdf: not the one beside it: {misnamed}")
        for k, (f, a, hand) in enumerate(zip(fields, files, hands, strict=True)):
            joints.append(self._joints(f, a, tools[k], model, shared, hand))
            resting = [n for n in chains[k] if n not in (*joints[k], *shared, *hand.joints)]
            if a.joints is None and resting:
                ends = (joints[k][0], joints[k][-1])
                files = (*files[:k], a.model_copy(update={"joints": ends}), *files[k + 1 :])
                group = arm_group(model, joints[k])
                source = f", group {group.name} of the SRDF" if group else ""
                rest = f"{', '.join(resting)} rest at home"
                notes.append(f"{a.name}: joints: [{', '.join(ends)}]{source}; {rest}")
        home = self._home(f"{field}.home", entry, model, [name for names in joints for name in names], hands)
        base = entry.base.matrix()
        support = self._support(field, entry, model, home, base)
        acceleration = entry.acceleration or DEFAULT_ACCELERATION
        fastest = entry.velocity or np.inf
        robot = Robot(entry.name, model, base, home, torso, support, acceleration, fastest)
        arms = [
            Arm(a.name, robot, tool, hand, frozenset(chain) - frozenset(names))
            for a, tool, hand, chain, names in zip(files, tools, hands, chains, joints, strict=True)
        ]
        guessed = {"joints": files[0].joints} if entry.arms is None else {"arms": files}
        return BuiltRobot(entry.model_copy(update=guessed), robot, arms, notes)

    def model(
        self,
        path: Path,
        mounts: tuple[Mount, ...] = (),
        srdf: Path | None = None,
        xacro_args: Mapping[str, str] | None = None,
        *,
        follow_up_axis: bool = False,
    ) -> RobotModel:
        """Return the model of a URDF with mounts, shared by robots and obstacles that are alike."""
        key = path, mounts, srdf, tuple(sorted((xacro_args or {}).items())), follow_up_axis
        if key not in self._models:
            self._models[key] = RobotModel(path, mounts, srdf, xacro_args, follow_up_axis=follow_up_axis)
        return self._models[key]

    def _path(self, reference: str) -> Path:
        """Return the file of a reference that has been checked."""
        path = resolve(reference, self._folder)
        assert path is not None
        return path

    def _mount(self, field: str, arm: ArmFile, hand: Hand, robot: RobotFile) -> list[Mount]:
        """Return the mount of the arm's hand; none where the hand is part of the robot's URDF."""
        if arm.mount is None:
            return []
        if hand.urdf is None:
            raise SceneError(self._source, f"{field}.mount", hand.name, "a hand with a urdf of its own")
        bare = self.model(self._path(robot.urdf), xacro_args=xacro_texts(robot.xacro_args))
        if arm.mount.link not in bare.link_names:
            expected = f"a link of {bare.path.name}: " + one_of(bare.link_names, arm.mount.link)
            raise SceneError(self._source, f"{field}.mount.link", arm.mount.link, expected)
        return [Mount(arm.mount.frame(), self._path(hand.urdf), arm.mount.prefix)]

    def _tool(self, field: str, arm: ArmFile, hand: Hand) -> str:
        """Return the name of the link that is the arm's tool frame."""
        if arm.tool is not None:
            return arm.tool
        if hand.tool is None:
            raise SceneError(
                self._source, f"{field}.tool", None, f"a link; hand {hand.name} names none itself"
            )
        return hand.tool.link if hand.tool.is_link else f"{hand.tool.link}_tool"

    def _chain(self, field: str, tool: str, model: RobotModel) -> list[str]:
        """Return the names of the revolute joints from the root to the tool link."""
        if tool not in model.link_names:
            expected = f"a link of {model.path.name}: " + one_of(model.link_names, tool)
            raise SceneError(self._source, f"{field}.tool", tool, expected)
        return revolute_joints(model, tool)

    def _torso(self, field: str, entry: RobotFile, model: RobotModel, tools: Sequence[str]) -> Torso | None:
        """Return the torso of a robot, whose joints must stand between its base and its arms."""
        if entry.torso is None:
            return None
        before = [j.name for tool in tools for j in model.chain(tool) if j.name in model.joint_names]
        for name in entry.torso:
            if name not in before:
                expected = "a joint between base and arms: " + one_of(dict.fromkeys(before), name)
                raise SceneError(self._source, f"{field}.torso", name, expected)
        return Torso.of(model, entry.torso)

    def _support(
        self, field: str, entry: RobotFile, model: RobotModel, home: Array, T_world_base: Array
    ) -> Array | None:
        """Return the corners (k, 2) of what a robot stands on, None where it cannot fall."""
        if entry.support is None:
            return None
        field = f"{field}.support"
        feet = [part for part in entry.support if isinstance(part, str)]
        for link in feet:
            if link not in model.link_names:
                raise SceneError(self._source, field, link, one_of(model.link_names, link))
        if not model.masses()[0].any():
            raise SceneError(self._source, field, list(entry.support), "a URDF with the masses of its links")
        if feet:
            area = area_of_feet(feet, model, home, T_world_base)
        else:
            corners = [part for part in entry.support if not isinstance(part, str)]
            area = area_of_corners(corners, T_world_base)
        if area is None:
            expected = "corners [x, y] around an area, or links with soles"
            raise SceneError(self._source, field, list(entry.support), expected)
        return area

    def _joints(
        self, field: str, arm: ArmFile, tool: str, model: RobotModel, shared: frozenset[str], hand: Hand
    ) -> list[str]:
        """Return the names of an arm's joints: as the file names them, or guessed."""
        if arm.joints is None:
            others = shared | frozenset(hand.joints)
            group = arm_group(model, [name for name in revolute_joints(model, tool) if name not in others])
            return list(group.joints) if group else guess_arm_joints(model, tool, others)
        field = f"{field}.joints"
        try:
            names = joints_between(model, tool, *arm.joints)
        except UrdfError as error:
            raise SceneError(self._source, field, error.value, error.expected) from None
        for name in names:
            if name in shared or name in hand.joints:
                raise SceneError(
                    self._source, field, name, "joints that move neither another arm nor fingers"
                )
        return names

    def _hand(self, field: str, arm: ArmFile) -> Hand:
        """Return an arm's hand, with the prefix of its mount."""
        if isinstance(arm.hand, str):
            named = {**HANDS, **SIDED_HANDS}
            if arm.hand not in named:
                raise SceneError(self._source, f"{field}.hand", arm.hand, one_of(named, arm.hand))
            hand = named[arm.hand]
        else:
            tool = arm.hand.tool
            fields = {**dict(arm.hand), "tool": tool and tool.frame()}
            try:
                hand = Hand(**fields)
            except InputError as error:
                where = f"{field}.hand.{error.field}"
                raise SceneError(self._source, where, error.value, error.expected) from None
        return hand.prefixed(arm.mount.prefix) if arm.mount else hand

    def _home(
        self, field: str, entry: RobotFile, model: RobotModel, order: list[str], hands: Iterable[Hand]
    ) -> Array:
        """Return the parked values (n,) of all joints of a robot.

        Args:
            field: where the file has them, for error messages.
            entry: the robot in the file.
            model: its URDF.
            order: the joints of all its arms, for which the file may list values.
            hands: the hand of each arm, open unless the file says otherwise.
        """
        values = model.default_values()
        for hand in hands:
            for name, value in hand.joint_values(hand.max_opening).items():
                if name in model.joint_names:
                    values[model.joint_names.index(name)] = value
        given: Mapping[str, float]
        if entry.home is None:
            given = {}
        elif isinstance(entry.home, dict):
            given = entry.home
        elif len(entry.home) != len(order):
            raise SceneError(
                self._source, field, list(entry.home), f"{len(order)} values, for " + ", ".join(order)
            )
        else:
            given = dict(zip(order, entry.home, strict=True))
        for name, value in given.items():
            if name not in model.joint_names:
                raise SceneError(self._source, field, name, one_of(model.joint_names, name))
            k = model.joint_names.index(name)
            if not model.lower[k] <= value <= model.upper[k]:
                limits = f"{name} within [{model.lower[k]:g}, {model.upper[k]:g}]"
                raise SceneError(self._source, field, value, limits)
            values[k] = value
        values.setflags(write=False)
        return values


def _beside(reference: str, urdf: Path, srdf: Path) -> str:
    """Return a reference to the SRDF that was found for a URDF, given the reference to that one."""
    folder = reference.rpartition("/")[0]
    if srdf.parent != urdf.parent:
        folder = folder.rpartition("/")[0] + "/srdf"
    return f"{folder}/{srdf.name}"
