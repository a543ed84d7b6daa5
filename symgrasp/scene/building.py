"""Building robots, arms, obstacles and tasks from a scene file, with every name and file resolved."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from symgrasp.errors import InputError, MeshError, SceneError, one_of
from symgrasp.files import file_sha256
from symgrasp.object.library import library_objects, load_object
from symgrasp.object.profile import Profile
from symgrasp.poses import Array
from symgrasp.references import portable, resolve, sought
from symgrasp.robot.assembly import Mount
from symgrasp.robot.hand import HANDS, Hand
from symgrasp.robot.model import RobotModel
from symgrasp.robot.robot import Arm, Robot
from symgrasp.scene.format import (
    SHAPES,
    ArmFile,
    HandFile,
    ObjectFile,
    ObstacleFile,
    RobotFile,
    SceneFile,
    TaskFile,
)
from symgrasp.scene.parts import Obstacle, SceneParts, Task

__all__ = ["SceneBuilder"]


class SceneBuilder:
    """Builds the parts of a scene from its file.

    Args:
        file: the validated content of the file.
        source: its name for error messages.
        folder: the folder that file references are relative to.
    """

    def __init__(self, file: SceneFile, source: str, folder: Path) -> None:
        self.file, self.source, self.folder = file, source, folder
        self._models: dict[tuple[Path, tuple[Mount, ...]], RobotModel] = {}

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
        for i, entry in enumerate(file.robots):
            robot, own = self._robot(i, entry)
            robots[robot.name] = robot
            self._unique("arms", [*arms, *(arm.name for arm in own)])
            arms |= {arm.name: arm for arm in own}
        return SceneParts(
            file,
            robots,
            arms,
            profile,
            tuple(self._obstacle(o) for o in file.obstacles),
            {t.name: self._task(i, t, arms) for i, t in enumerate(file.tasks)},
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
        object_file = ObjectFile(name=self.file.object.name, profile=knots)
        update = {"robots": robots, "obstacles": tuple(obstacles), "object": object_file}
        return self.file.model_copy(update=update)

    def _absolute_robot(self, field: str, robot: RobotFile) -> RobotFile:
        update: dict[str, Any] = {"urdf": self._reference(f"{field}.urdf", robot.urdf, "URDF")}
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

    def _robot(self, i: int, entry: RobotFile) -> tuple[Robot, list[Arm]]:
        """Return the robot with index i in the file, and its arms."""
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
        model = self._model(self._path(entry.urdf), tuple(mounts))
        chains = [self._chain(f, tool, model) for f, tool in zip(fields, tools, strict=True)]
        shared = frozenset(n for k, c in enumerate(chains) for n in c for o in chains[:k] if n in o)
        home = self._home(i, entry, model, chains, shared, hands)
        robot = Robot(entry.name, model, entry.base.matrix(), home)
        parts = zip(files, tools, hands, strict=True)
        return robot, [Arm(a.name, robot, tool, hand, shared) for a, tool, hand in parts]

    def _model(self, path: Path, mounts: tuple[Mount, ...]) -> RobotModel:
        """Return the model of a URDF with mounts, shared by robots that are alike."""
        if (path, mounts) not in self._models:
            self._models[path, mounts] = RobotModel(path, mounts)
        return self._models[path, mounts]

    def _mount(self, field: str, arm: ArmFile, hand: Hand, robot: RobotFile) -> list[Mount]:
        """Return the mount of the arm's hand; none where the hand is part of the robot's URDF."""
        if arm.mount is None:
            return []
        if hand.urdf is None:
            raise SceneError(self.source, f"{field}.mount", hand.name, "a hand with a urdf of its own")
        bare = self._model(self._path(robot.urdf), ())
        if arm.mount.link not in bare.link_names:
            expected = f"a link of {bare.path.name}: " + one_of(bare.link_names, arm.mount.link)
            raise SceneError(self.source, f"{field}.mount.link", arm.mount.link, expected)
        return [Mount(arm.mount.frame(), self._path(hand.urdf), arm.mount.prefix)]

    def _tool(self, field: str, arm: ArmFile, hand: Hand) -> str:
        """Return the name of the link that is the arm's tool frame."""
        if arm.tool is not None:
            return arm.tool
        if hand.tool is None:
            raise SceneError(
                self.source, f"{field}.tool", None, f"a link; hand {hand.name} names none itself"
            )
        return hand.tool.link if hand.tool.is_link else f"{arm.name}_tool"

    def _chain(self, field: str, tool: str, model: RobotModel) -> list[str]:
        """Return the names of the revolute joints from the root to the tool link."""
        if tool not in model.link_names:
            expected = f"a link of {model.path.name}: " + one_of(model.link_names, tool)
            raise SceneError(self.source, f"{field}.tool", tool, expected)
        return [j.name for j in model.chain(tool) if j.source >= 0 and j.kind != "prismatic"]

    def _hand(self, field: str, arm: ArmFile) -> Hand:
        """Return an arm's hand, with the prefix of its mount."""
        if isinstance(arm.hand, str):
            if arm.hand not in HANDS:
                raise SceneError(self.source, f"{field}.hand", arm.hand, one_of(HANDS, arm.hand))
            hand = HANDS[arm.hand]
        else:
            tool = arm.hand.tool
            fields = {**dict(arm.hand), "tool": tool and tool.frame()}
            try:
                hand = Hand(**fields)
            except InputError as error:
                where = f"{field}.hand.{error.field}"
                raise SceneError(self.source, where, error.value, error.expected) from None
        return hand.prefixed(arm.mount.prefix) if arm.mount else hand

    def _home(
        self,
        i: int,
        entry: RobotFile,
        model: RobotModel,
        chains: list[list[str]],
        shared: frozenset[str],
        hands: list[Hand],
    ) -> Array:
        """Return the parked values (n,) of all joints of a robot.

        Args:
            i: index of the robot in the file.
            entry: the robot in the file.
            model: its URDF.
            chains: joint names of each arm.
            shared: names of the joints that several arms share.
            hands: the hand of each arm, open unless the file says otherwise.
        """
        field = f"robots[{i}].home"
        values = model.default_values()
        for hand in hands:
            for name, value in hand.joint_values(hand.max_opening).items():
                if name in model.joint_names:
                    values[model.joint_names.index(name)] = value
        order = [n for chain in chains for n in chain if n not in shared]
        given: Mapping[str, float]
        if entry.home is None:
            given = {}
        elif isinstance(entry.home, dict):
            given = entry.home
        elif len(entry.home) != len(order):
            raise SceneError(
                self.source, field, list(entry.home), f"{len(order)} values, for " + ", ".join(order)
            )
        else:
            given = dict(zip(order, entry.home, strict=True))
        for name, value in given.items():
            if name not in model.joint_names:
                raise SceneError(self.source, field, name, one_of(model.joint_names, name))
            k = model.joint_names.index(name)
            if not model.lower[k] <= value <= model.upper[k]:
                limits = f"{name} within [{model.lower[k]:g}, {model.upper[k]:g}]"
                raise SceneError(self.source, field, value, limits)
            values[k] = value
        values.setflags(write=False)
        return values

    def _obstacle(self, o: ObstacleFile) -> Obstacle:
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
            model = self._model(path, ())
            digest = model.sha256
        else:
            size = 3 * (1.0 if o.scale is None else o.scale,)
            path = self._path(o.mesh or "")
            try:
                digest = file_sha256(path)
            except OSError as error:
                raise MeshError(path, f"obstacle {o.name}", str(error), "a readable mesh file") from error
        return Obstacle(o.name, kind, size, path, o.pose.matrix(), model, digest)

    def _task(self, i: int, t: TaskFile, arms: Mapping[str, Arm]) -> Task:
        names = t.arms or (next(iter(arms)),)
        for name in names:
            if name not in arms:
                raise SceneError(self.source, f"tasks[{i}].arms", name, one_of(arms, name))
        self._unique(f"tasks[{i}].arms", names)
        return Task(t.name, names, t.pose.matrix())
