"""Building object, obstacles and tasks from a scene file, with every name and file resolved."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from symgrasp.errors import SceneError, one_of, referred_to
from symgrasp.files import file_sha256
from symgrasp.object.library import library_objects, load_object
from symgrasp.object.manifold import ROLLS, Manifold
from symgrasp.object.profile import Profile
from symgrasp.references import portable, resolve, sought
from symgrasp.robot.robot import Arm, Robot
from symgrasp.scene.format import (
    SHAPES,
    HandFile,
    MapSettings,
    ObjectFile,
    ObstacleFile,
    RobotFile,
    SceneFile,
    TaskFile,
)
from symgrasp.scene.parts import Obstacle, SceneParts, Task
from symgrasp.scene.robots import RobotBuilder

__all__ = ["SceneBuilder", "check_settings"]

MOST_PARTS = 2_000_000
"""Most parts that the cells of a map are split into."""


def check_settings(source: str, arms: Iterable[Arm], profile: Profile, settings: MapSettings) -> None:
    """Check that maps can be computed as settings ask for.

    Raises:
        SceneError: an arm cannot follow the approach, because it has five joints, which do not keep the
            direction of its hand along a line; or maps have too many parts at the resolution.
    """
    for arm in arms:
        if arm.pitched and settings.approach:
            raise SceneError(
                source, "map.approach", settings.approach, f"0 with an arm of five joints, {arm.name}"
            )
    grid = Manifold(profile, settings.heights, settings.angles)
    parts = [len(ROLLS) * finer.heights * finer.angles for finer in settings.finer(grid)]
    if settings.resolution is not None and max(parts, default=0) > MOST_PARTS:
        expected = f"a resolution at which a map has at most {MOST_PARTS:,} parts, not {parts[-1]:,}"
        raise SceneError(source, "map.resolution", settings.resolution.model_dump(), expected)


class SceneBuilder:
    """Builds the parts of a scene from its file.

    Args:
        file: the validated content of the file.
        source: its name for error messages.
        folder: the folder that file references are relative to.
    """

    def __init__(self, file: SceneFile, source: str, folder: Path) -> None:
        self.file, self.source, self.folder = file, source, folder
        self._robots = RobotBuilder(source, folder)

    def build(self) -> SceneParts:
        """Resolve names and files, load robots and object, and check what the format alone cannot.

        Raises:
            SceneError: a name or a file is unknown, a name is used twice, or a value is out of range.
            UrdfError: a robot's URDF is unusable.
            ProfileError: the object's profile is unusable.
            MeshError: the object's mesh is unusable.
        """
        profile = self._profile(self.file.object)
        self.file = file = self._absolute(profile)
        self._unique("robots", (r.name for r in file.robots))
        self._unique("obstacles", (o.name for o in file.obstacles))
        self._unique("tasks", (t.name for t in file.tasks))
        names = [r.name for r in file.robots] + [o.name for o in file.obstacles] + [file.object.name]
        self._unique("robots, obstacles and object", names)
        robots: dict[str, Robot] = {}
        arms: dict[str, Arm] = {}
        entries, notes = [], []
        for i, entry in enumerate(file.robots):
            built = self._robots.build(i, entry)
            robots[built.robot.name] = built.robot
            self._unique("arms", [*arms, *(arm.name for arm in built.arms)])
            arms |= {arm.name: arm for arm in built.arms}
            entries.append(built.file)
            notes += built.notes
        check_settings(self.source, arms.values(), profile, file.map)
        return SceneParts(
            file.model_copy(update={"robots": tuple(entries)}),
            robots,
            arms,
            profile,
            tuple(self._obstacle(i, o) for i, o in enumerate(file.obstacles)),
            {t.name: self._task(i, t, arms) for i, t in enumerate(file.tasks)},
            tuple(notes),
        )

    def _unique(self, field: str, names: Iterable[str]) -> None:
        """Raise SceneError if a name occurs twice."""
        seen: set[str] = set()
        for name in names:
            if name in seen:
                raise SceneError(self.source, f"{field}: name", name, "a name that is not used twice")
            seen.add(name)

    def _profile(self, entry: ObjectFile) -> Profile:
        """Return the object's profile: as given, from the library, or measured from a mesh."""
        if entry.profile is not None:
            return Profile(entry.profile, self.source + ": object")
        if entry.library is not None:
            library = library_objects()
            if entry.library not in library:
                expected = one_of(library, entry.library)
                raise SceneError(self.source, "object.library", entry.library, expected)
            return load_object(entry.library)[1]
        path = self._path(self._reference("object.mesh", entry.mesh or "", "mesh"))
        with referred_to(self.source, "object.mesh"):
            return Profile.from_mesh(path, entry.scale, tolerance=entry.tolerance, flip=bool(entry.flip))

    def _absolute(self, profile: Profile) -> SceneFile:
        """Return the file with absolute references and the profile's knots, valid from any folder.

        Raises:
            SceneError: a referenced file does not exist.
        """
        robots = tuple(self._absolute_robot(f"robots[{i}]", r) for i, r in enumerate(self.file.robots))
        obstacles = []
        for i, o in enumerate(self.file.obstacles):
            kind = "mesh" if o.mesh is not None else "urdf"
            reference = getattr(o, kind)
            if reference is not None:
                reference = self._reference(f"obstacles[{i}].{kind}", reference, kind)
                o = o.model_copy(update={kind: reference})
            obstacles.append(o)
        knots = [tuple(p) for p in profile.points.tolist()]
        object_file = ObjectFile(name=self.file.object.name, profile=knots, mass=self.file.object.mass)
        update = {"robots": robots, "obstacles": tuple(obstacles), "object": object_file}
        return self.file.model_copy(update=update)

    def _absolute_robot(self, field: str, robot: RobotFile) -> RobotFile:
        update: dict[str, Any] = {"urdf": self._reference(f"{field}.urdf", robot.urdf, "URDF")}
        if robot.srdf is not None:
            update["srdf"] = self._reference(f"{field}.srdf", robot.srdf, "SRDF")
        if robot.hand is not None:
            update["hand"] = self._absolute_hand(f"{field}.hand", robot.hand)
        if robot.arms is not None:
            hands = [self._absolute_hand(f"{field}.arms[{k}].hand", a.hand) for k, a in enumerate(robot.arms)]
            arms = zip(robot.arms, hands, strict=True)
            update["arms"] = tuple(a.model_copy(update={"hand": hand}) for a, hand in arms)
        return robot.model_copy(update=update)

    def _absolute_hand(self, field: str, hand: str | HandFile) -> str | HandFile:
        if isinstance(hand, str) or hand.urdf is None:
            return hand
        return hand.model_copy(update={"urdf": self._reference(f"{field}.urdf", hand.urdf, "URDF")})

    def _reference(self, field: str, reference: str, kind: str) -> str:
        """Return a file reference made valid from any folder; raise SceneError if there is no such file."""
        path = resolve(reference, self.folder)
        if path is None:
            raise SceneError(self.source, field, reference, sought(reference, self.folder, kind))
        return portable(reference, path) or str(path.resolve())

    def _path(self, reference: str) -> Path:
        """Return the file of a reference that `_reference` has checked."""
        path = resolve(reference, self.folder)
        assert path is not None  # checked by _reference
        return path

    def _obstacle(self, i: int, o: ObstacleFile) -> Obstacle:
        kind = next(k for k in SHAPES if getattr(o, k) is not None)
        size: tuple[float, ...] = ()
        path = model = None
        digest = ""
        if o.box is not None:
            size = o.box
        elif o.cylinder is not None:
            size = (o.cylinder.radius, o.cylinder.height)
        elif o.sphere is not None:
            size = (o.sphere.radius,)
        elif o.urdf is not None:
            path = self._path(o.urdf)
            model = self._robots.model(path)
            digest = model.sha256
        else:
            size = 3 * (1.0 if o.scale is None else o.scale,)
            path = self._path(o.mesh or "")
            try:
                digest = file_sha256(path)
            except OSError as error:
                where = f"obstacles[{i}].mesh"
                raise SceneError(self.source, where, error.strerror, "a readable mesh file") from error
        reference = self.source, f"obstacles[{i}].{kind}"
        return Obstacle(o.name, kind, size, path, o.pose.matrix(), model, digest, reference)

    def _task(self, i: int, t: TaskFile, arms: Mapping[str, Arm]) -> Task:
        names = t.arms or (next(iter(arms)),)
        for name in names:
            if name not in arms:
                raise SceneError(self.source, f"tasks[{i}].arms", name, one_of(arms, name))
        self._unique(f"tasks[{i}].arms", names)
        return Task(t.name, names, t.pose.matrix(), t.supported)
