"""Robots that can take the place of a scene's own: those of the catalogue, and uploaded ones."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from symgrasp.errors import InputError, one_of
from symgrasp.references import resolve
from symgrasp.robot.catalogue import CATALOGUE, CatalogueRobot
from symgrasp.scene.format import RobotFile

from .scene_assets import UploadFolder

__all__ = ["OWN_ROBOT", "UploadedRobot", "catalogue_robot", "installed_robots", "robot_options"]

OWN_ROBOT = "the scene's own"
"""The option for the robot that the scene's file has."""


@dataclass(frozen=True, eq=False)
class UploadedRobot:
    """An uploaded robot.

    Attributes:
        option: its name in the menu of the page.
        entry: the robot as a scene file has it.
        folder: where its files are.
    """

    option: str
    entry: RobotFile
    folder: UploadFolder


@cache
def installed_robots() -> Mapping[str, CatalogueRobot]:
    """Return option → robot, of the robots of the catalogue whose packages are installed."""
    return {robot.title: robot for robot in CATALOGUE if resolve(robot.urdf, Path())}


def robot_options(uploaded: UploadedRobot | None = None) -> tuple[str, ...]:
    """Return all options: the scene's own robot, the catalogue, and the uploaded one if any."""
    return (OWN_ROBOT, *installed_robots(), *([uploaded.option] if uploaded else []))


def catalogue_robot(option: str) -> CatalogueRobot:
    """Return the robot of an option.

    Raises:
        InputError: there is none.
    """
    robots = installed_robots()
    if option not in robots:
        raise InputError("page", "robot", option, one_of(robots, option))
    return robots[option]
