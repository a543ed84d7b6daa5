"""Obstacles, tasks, and the parts that a scene is made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from symgrasp.errors import referred_to
from symgrasp.object.profile import Profile
from symgrasp.poses import Array
from symgrasp.robot.link_shapes import CollisionShape
from symgrasp.robot.model import RobotModel
from symgrasp.robot.robot import Arm, Robot
from symgrasp.scene.format import SceneFile

if TYPE_CHECKING:
    import trimesh

__all__ = ["Obstacle", "SceneParts", "Task"]


@dataclass(frozen=True, eq=False)
class Obstacle:
    """A body that does not move.

    Attributes:
        name: its name in the scene.
        kind: box, cylinder, sphere, mesh or urdf.
        size: box: full sizes (3,); cylinder: radius, height; sphere: radius; mesh: factors (3,); URDF: empty.
        path: the mesh or URDF file, otherwise None.
        T_world_obstacle: pose (4, 4) of its frame; boxes, cylinders and spheres are centred at the origin.
        model: the links of a URDF, otherwise None.
        file_sha256: SHA-256 of the mesh file, or of the URDF and its collision meshes; empty where the
            body has no file.
        reference: the scene file, and where in that the body is, for error messages.
    """

    name: str
    kind: str
    size: tuple[float, ...]
    path: Path | None
    T_world_obstacle: Array
    model: RobotModel | None = None
    file_sha256: str = ""
    reference: tuple[str, str] = ("", "obstacle")

    def mesh(self, link: str, shape: CollisionShape) -> trimesh.Trimesh:
        """Read the mesh of one of its shapes that is one, in the shape's own frame.

        Args:
            link: of the shape, see `shapes`.
            shape: the shape.

        Raises:
            MeshError: it cannot be read, or is too large or too small to be meant in metres.
        """
        with referred_to(*self.reference):
            return shape.mesh(f"link {link}" if link else "mesh")

    def shapes(self) -> list[tuple[str, CollisionShape]]:
        """Return all shapes, posed in the obstacle's frame, each with the name of its link.

        The joints of a URDF are at their default values; the name is empty where there is no URDF.
        """
        if self.model is None:
            return [("", CollisionShape(self.kind, self.size, self.path, np.eye(4), upright=True))]
        poses = self.model.forward(self.model.default_values())
        return [
            (link, shape._replace(pose=pose @ shape.pose))
            for link, pose in zip(self.model.link_names, poses, strict=True)
            for shape in self.model.shapes(link)
        ]


@dataclass(frozen=True, eq=False)
class Task:
    """A pose of the object, and the arms that hold it there.

    Attributes:
        name: its name in the scene.
        arms: names of the arms that hold the object.
        T_world_object: object pose (4, 4); its rotation about the object's own z axis is free.
        supported: whether something must hold the object up where no hand does; None where the scene does not
            say so.
    """

    name: str
    arms: tuple[str, ...]
    T_world_object: Array
    supported: bool | None = None


class SceneParts(NamedTuple):
    """The parts of a scene; see `symgrasp.scene.scene.Scene` for the attributes."""

    file: SceneFile
    robots: Mapping[str, Robot]
    arms: Mapping[str, Arm]
    profile: Profile
    obstacles: tuple[Obstacle, ...]
    tasks: Mapping[str, Task]
    notes: tuple[str, ...]
