"""Robots from uploaded archives, and other hands on the arms of a scene, as entries of scene files."""

from __future__ import annotations

import itertools
import os
import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from symgrasp.descriptions.description import read_description
from symgrasp.descriptions.srdf import find_srdf, srdf_text
from symgrasp.descriptions.xml_file import LARGEST_XML
from symgrasp.errors import InputError, SceneError, UrdfError
from symgrasp.feasibility.starter import robot_content
from symgrasp.files import read_file
from symgrasp.found_arms import find_arms
from symgrasp.hands.measure import hand_yaml, measure_hand
from symgrasp.references import package_dirs, resolve, sought
from symgrasp.robot.catalogue import CatalogueRobot
from symgrasp.robot.model import RobotModel
from symgrasp.scene.format import ArmFile, HandFile, MountFile, RobotFile, xacro_texts
from symgrasp.scene.scene import Scene

from ..choices.robot_arms import arm_file, tool_link
from .archives import unpack

__all__ = ["catalogue_entry", "plain_urdf", "read_robot_entry", "rearmed"]


def read_robot_entry(name: str, content: bytes, folder: Path) -> RobotFile:
    """Unpack the archive of a robot, and return the robot as a scene file has it.

    Args:
        name: of the archive.
        content: of the archive.
        folder: an empty one to unpack it into.

    Raises:
        InputError: see `app.files.archives.unpack`; or it is not clear which file in it is the robot's.
        UrdfError, MeshError: the robot is unusable, or it is not clear what it grasps with.
    """
    path = plain_urdf(_robot_file(name, unpack(name, content, folder), folder), folder)
    called = re.sub(r"\W+", "_", path.stem).strip("_")[:50] or "robot"
    return _entry(called, str(path), RobotModel(path, srdf=find_srdf(path)))


def _robot_file(name: str, files: list[Path], folder: Path) -> Path:
    """Return the file of the robot in an archive: a URDF, or else a xacro or MJCF file.

    Of several xacro or MJCF files it is the one that no other one includes.
    """
    for ending in (".urdf", ".xacro", ".xml"):
        found = [path for path in files if path.suffix.lower() == ending]
        if ending != ".urdf":
            texts = {path: read_file(path, LARGEST_XML).decode("utf-8", "replace") for path in found}
            found = [
                path for path in found
                if (ending == ".xacro" or "<mujoco" in texts[path])
                and not any(_includes(texts[other], path) for other in found if other != path)
            ]  # fmt: skip
        if len(found) == 1:
            return found[0].resolve()
        if found:
            names = [path.relative_to(folder).as_posix() for path in found]
            raise InputError(name, "files", names, f"one {ending} file, with its meshes")
    raise InputError(name, "files", "no .urdf file", "one .urdf, .xacro or MJCF file, with its meshes")


def _includes(text: str, path: Path) -> bool:
    """Return whether a file includes another one, by its name."""
    return re.search(rf"""include[^>]*["'/]{re.escape(path.name)}["']""", text) is not None


def catalogue_entry(robot: CatalogueRobot) -> RobotFile:
    """Return a robot of the catalogue as a scene file has it.

    Raises:
        UrdfError: its package is not installed, or none of its arms can grasp.
    """
    path = resolve(robot.urdf, Path())
    if path is None:
        expected = f"{sought(robot.urdf, Path(), 'URDF')}; `pip install {robot.package}` installs it"
        raise UrdfError(robot.name, "urdf", robot.urdf, expected)
    model = RobotModel(path, follow_up_axis=robot.follow_up_axis)
    return _entry(robot.name, robot.urdf, model, robot.reading)


def _entry(name: str, urdf: str, model: RobotModel, reading: Mapping[str, Any] | None = None) -> RobotFile:
    arms = find_arms(model)
    usable = [arm for arm in arms if arm.joints and arm.hand is not None]
    if not usable:
        trouble = "; ".join(arm.trouble for arm in arms if arm.trouble) or "no arm"
        raise UrdfError(model.path.name, "arms", trouble, "an arm of five or more joints with a hand")
    return RobotFile.model_validate(robot_content(name, urdf, usable, reading))


def plain_urdf(path: Path, folder: Path, xacro_args: Mapping[str, str] | None = None) -> Path:
    """Return the URDF that the file of a robot in an unpacked archive is, or is made.

    What is made is written beside the file, so that it is expanded once, here, where nothing outside of the
    archive is read.

    Args:
        path: the file.
        folder: that of the archive.
        xacro_args: values of the arguments of a xacro file.

    Raises:
        UrdfError: the file cannot be read, or refers to a file neither in the folder nor of an installed
            package. The text does not say whether there is such a file elsewhere.
    """
    description = read_description(path, xacro_args, folder)
    robot = description.urdf
    inside = folder.resolve()
    for element in robot.iter():
        reference = element.get("filename")
        if reference is None or element.tag not in ("mesh", "texture"):
            continue
        found = resolve(reference, path.parent)
        roots = (inside, *(place.resolve() for place in package_dirs(reference)))
        if found is None or not any(found.resolve().is_relative_to(place) for place in roots):
            expected = "a file of the archive, or of an installed package"
            raise UrdfError(path.name, element.tag, reference, expected)
        if found.resolve().is_relative_to(inside):  # wherever the archive is unpacked
            element.set("filename", os.path.relpath(found.resolve(), path.resolve().parent))
    if not description.made:
        return path
    stem = path.stem.removesuffix(".urdf")
    plain = path.with_name(f"{stem}.urdf")
    for k in itertools.count(2):
        if not plain.exists():
            break
        plain = path.with_name(f"{stem}_{k}.urdf")
    plain.write_bytes(ET.tostring(robot))
    if description.srdf is not None and find_srdf(plain) is None:
        plain.with_suffix(".srdf").write_bytes(srdf_text(description.srdf))
    return plain


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
        args, follow = xacro_texts(entry.xacro_args), bool(entry.follow_up_axis)
        measured = measure_hand(RobotModel(path, xacro_args=args, follow_up_axis=follow), link)
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
