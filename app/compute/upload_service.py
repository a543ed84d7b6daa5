"""Reads what a browser uploads, and puts robots and hands into scenes; runs in that session's process.

The server itself parses nothing that comes from a browser: a file that breaks a parser, hangs it or takes
all memory ends this process only.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from symgrasp.progress import Progress, part_of
from symgrasp.robot.catalogue import CatalogueRobot
from symgrasp.scene.format import RobotFile
from symgrasp.scene.replacing import renamed, with_robot
from symgrasp.scene.scene import Scene
from symgrasp.world import placed, prepared

from ..choices.object_choice import ObjectChoice, from_mesh
from ..choices.scene_assets import BuiltScene, SceneAssets
from ..choices.uploaded_scene import UploadedScene
from ..files.archives import pack
from ..files.file_kinds import FileKind, file_kind
from ..files.robot_files import catalogue_entry, read_robot_entry, rearmed
from ..files.scene_files import read_scene, read_scene_archive
from ..scene3d.visual_meshes import built_to_show

__all__ = ["UploadService"]


class UploadService:
    """Reads scenes, robots and meshes, and puts robots and hands into scenes.

    Args:
        folders: where the files of an uploaded scene may lie.
    """

    def __init__(self, folders: tuple[Path, ...]) -> None:
        self._folders = folders

    def read_scene(self, name: str, content: bytes, folder: Path | None, progress: Progress) -> UploadedScene:
        """Build the scene in a file, and check its tasks and everything that the 3D view shows.

        Args:
            name: of the file.
            content: of the file.
            folder: an empty one to unpack an archive into; None where the file is no archive.
            progress: called with the finished share; may raise `Cancelled`.

        Raises:
            InputError: see `app.files.archives.unpack`.
            SceneError: see `app.files.scene_files.read_scene`; or the object collides in a task.
            UrdfError, ProfileError, MeshError: a file that it refers to is unusable.
        """
        progress(0.0)
        if folder:
            uploaded = read_scene_archive(name, content, folder, self._folders)
        else:
            uploaded = read_scene(name, content, self._folders)
        progress(0.3)
        built = _checked(uploaded.scene, progress)
        return replace(uploaded, scene=built.scene, assets=SceneAssets(built.visuals))

    def file_kind(self, content: bytes, progress: Progress) -> FileKind | None:
        """Return what a file is; see `app.files.file_kinds.file_kind`."""
        progress(0.0)
        return file_kind(content)

    def measure(
        self, name: str, content: bytes, scale: float, tolerance: float | None, progress: Progress
    ) -> ObjectChoice:
        """Measure the object of revolution in a mesh file; see `app.choices.object_choice.from_mesh`."""
        progress(0.0)
        return from_mesh(name, content, scale, tolerance)

    def mount(self, scene: Scene, arm: str, hand: str, progress: Progress) -> BuiltScene:
        """Return a scene with another hand on the mount of an arm.

        Raises:
            SymgraspError: see `Scene.with_hand`.
            MeshError: a mesh of the hand cannot be read.
        """
        progress(0.0)
        return _checked(scene.with_hand(arm, hand), progress)

    def rearm(self, scene: Scene, arm: str, link: str, hand: str | None, progress: Progress) -> BuiltScene:
        """Return a scene with a hand on a link of an arm; see `app.files.robot_files.rearmed`.

        Raises:
            SceneError, UrdfError, MeshError: no such hand is there, or it does not fit.
        """
        progress(0.0)
        robot = scene.arm(arm).robot.name
        return _checked(with_robot(scene, robot, rearmed(scene, arm, link, hand)), progress)

    def put_robot(
        self,
        scene: Scene,
        robot: str,
        other: CatalogueRobot | RobotFile,
        opened: Scene,
        progress: Progress,
    ) -> BuiltScene:
        """Return a scene with another robot in the place of one.

        Args:
            scene: the scene.
            robot: name of the robot to replace.
            other: a robot of the catalogue, or a robot as a scene file has it. Unless that says where it
                stands, it is placed; see `symgrasp.world.placing.placed`.
            opened: the scene as it was opened, with the robot that is well placed in the same position.
            progress: called with the finished share; may raise `Cancelled`.

        Raises:
            SceneError, UrdfError, MeshError: the robot is unusable, or its home is not free there.
        """
        progress(0.0)
        entry = catalogue_entry(other) if isinstance(other, CatalogueRobot) else other
        return self._put(scene, robot, entry, opened, progress)

    def read_robot(
        self,
        scene: Scene,
        robot: str,
        name: str,
        content: bytes,
        folder: Path,
        opened: Scene,
        progress: Progress,
    ) -> tuple[RobotFile, BuiltScene]:
        """Read an uploaded robot, and put it in the place of one of a scene.

        Args:
            scene: the scene.
            robot: name of the robot to replace.
            name: of the file: an archive, or a robot's file alone.
            content: of the file.
            folder: an empty one to unpack it into.
            opened: see `put_robot`.
            progress: called with the finished share; may raise `Cancelled`.

        Returns:
            The robot as a scene file has it, and the scene.

        Raises:
            InputError: see `app.files.robot_files.read_robot_entry`.
            SceneError, UrdfError, MeshError: the robot is unusable, or its home is not free there.
        """
        progress(0.0)
        if not name.lower().endswith(".zip"):  # a robot's file alone is like an archive of one file
            content = pack([(name, content)])
        entry = read_robot_entry(name, content, folder)
        progress(0.3)
        return entry, self._put(scene, robot, entry, opened, progress)

    def _put(
        self, scene: Scene, robot: str, entry: RobotFile, opened: Scene, progress: Progress
    ) -> BuiltScene:
        index = list(scene.robots).index(robot)
        changed = with_robot(scene, robot, renamed(scene, robot, entry))
        if "base" not in entry.model_fields_set:
            own = list(opened.robots.values())[index]
            old = next(arm for arm in opened.arms.values() if arm.robot is own)
            changed = placed(changed, list(changed.robots)[index], old)
        return _checked(changed, progress)


def _checked(scene: Scene, progress: Progress) -> BuiltScene:
    """Return a scene of which maps can be computed, with all that is read from its files to show it."""
    scene = prepared(scene, lambda _: progress(0.3))
    return built_to_show(scene, part_of(progress, 1, 2))
