"""Robots from uploaded archives, and other hands on the arms of a scene, as entries of scene files."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from pathlib import Path

import yaml

from symgrasp.errors import InputError, SceneError, UrdfError
from symgrasp.feasibility.starter import robot_content
from symgrasp.hands.measure import hand_yaml, measure_hand
from symgrasp.references import package_dirs, resolve, sought
from symgrasp.robot.catalogue import CatalogueRobot
from symgrasp.robot.model import RobotModel
from symgrasp.scene.format import ArmFile, HandFile, MountFile, RobotFile
from symgrasp.scene.scene import Scene
from symgrasp.survey import find_arms

from ..choices.robot_arms import arm_file, tool_link
from .archives import unpack

__all__ = ["catalogue_entry", "check_inside", "read_robot_entry", "rearmed"]


def read_robot_entry(name: str, content: bytes, folder: Path) -> RobotFile:
    """Unpack the archive of a robot, and return the robot as a scene file has it.

    Args:
        name: of the archive.
        content: of the archive.
        folder: an empty one to unpack it into.

    Raises:
        InputError: see `app.files.archives.unpack`; or there is not exactly one URDF in it.
        UrdfError, MeshError: the robot is unusable, or it is not clear what it grasps with.
    """
    files = unpack(name, content, folder)
    urdfs = [path for path in files if path.suffix.lower() == ".urdf"]
    if len(urdfs) != 1:
        found = [path.relative_to(folder).as_posix() for path in urdfs]
        raise InputError(name, "files", found or "no .urdf file", "one .urdf file, with its meshes")
    path = urdfs[0].resolve()
    check_inside(path, folder)
    called = re.sub(r"\W+", "_", path.stem).strip("_")[:50] or "robot"
    return _entry(called, str(path), RobotModel(path))


def catalogue_entry(robot: CatalogueRobot) -> RobotFile:
    """Return a robot of the catalogue as a scene file has it.

    Raises:
        UrdfError: its package is not installed, or none of its arms can grasp.
    """
    path = resolve(robot.urdf, Path())
    if path is None:
        expected = f"{sought(robot.urdf, Path(), 'URDF')}; `pip install {robot.package}` installs it"
        raise UrdfError(robot.name, "urdf", robot.urdf, expected)
    return _entry(robot.name, robot.urdf, RobotModel(path))


def _entry(name: str, urdf: str, model: RobotModel) -> RobotFile:
    arms = find_arms(model)
    usable = [arm for arm in arms if arm.joints and arm.hand is not None]
    if not usable:
        trouble = "; ".join(arm.trouble for arm in arms if arm.trouble) or "no arm"
        raise UrdfError(model.path.name, "arms", trouble, "an arm of five or more joints with a hand")
    return RobotFile.model_validate(robot_content(name, urdf, usable))


def check_inside(urdf: Path, folder: Path) -> None:
    """Check that a URDF refers to no file but those in a folder and of installed packages.

    Raises:
        UrdfError: it does, or is no XML. The text does not say whether there is such a file elsewhere.
    """
    try:
        root = ET.fromstring(urdf.read_bytes())
    except (ET.ParseError, ValueError, LookupError) as error:
        raise UrdfError(urdf.name, "urdf", str(error), "a valid URDF document") from None
    inside = folder.resolve()
    for element in root.iter():
        reference = element.get("filename")
        if reference is None or element.tag not in ("mesh", "texture"):
            continue
        found = resolve(reference, urdf.parent)
        roots = (inside, *(place.resolve() for place in package_dirs(reference)))
        if found is None or not any(found.resolve().is_relative_to(place) for place in roots):
            expected = "a file of the archive, or of an installed package"
            raise UrdfError(urdf.name, element.tag, reference, expected)


def rearmed(scene: Scene, arm: str, link: str, hand: str | None) -> RobotFile:
    """Return the robot of an arm as the scene's file has it, with a hand on a link of the arm.

    Args:
        scene: the scene.
        arm: the arm.
        link: a link of the robot's own URDF.
        hand: name of a hand to mount there; None for the one of the URDF at that link, which is measured.

    Raises:
        UrdfError: there is no such link, or no hand that can be measured.
    """
    entry = scene.file.robots[list(scene.robots).index(scene.arm(arm).robot.name)]
    old = arm_file(scene, arm)
    path = resolve(entry.urdf, Path())
    if path is None:
        raise SceneError(scene.source, "urdf", entry.urdf, "an existing file")
    if hand is None:
        measured = measure_hand(RobotModel(path), link)
        held = HandFile.model_validate(yaml.safe_load(hand_yaml(measured))["hand"])
        mount, tool = None, None if measured.tool else link
    else:
        same = old.mount is not None and link == tool_link(scene, arm)
        mount = old.mount if same else MountFile(link=link, prefix=f"{arm}_")
        held, tool = hand, None
    new = old.model_copy(update={"hand": held, "mount": mount, "tool": tool})
    return _with_arm(entry, new)


def _with_arm(entry: RobotFile, arm: ArmFile) -> RobotFile:
    if entry.arms is None:
        keys = ("hand", "mount", "tool", "joints")
        return entry.model_copy(update={key: getattr(arm, key) for key in keys})
    arms = tuple(arm if other.name == arm.name else other for other in entry.arms)
    return entry.model_copy(update={"arms": arms})
