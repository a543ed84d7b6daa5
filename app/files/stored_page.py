"""What a page showed, as files that outlive the server: settings in JSON, and the scene.

The scene is written and read as any that is saved and opened again, and the plan as a plan file, which is
verified; computed maps, further plans and undo steps are not part of it.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import asdict, replace
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, NonNegativeFloat, ValidationError

from symgrasp.errors import InputError, one_of
from symgrasp.feasibility.color_by import ColorBy
from symgrasp.survey.success import PoseNoise

from ..choices.object_choice import ObjectChoice, from_library, object_options
from ..choices.robot_choice import OWN_ROBOT, UploadedRobot, robot_options
from ..choices.uploaded_scene import UploadedScene
from ..state import changes
from ..state.display import Display
from ..state.map_view_state import NOISE, RollChoice
from ..state.object_pose import ObjectPose
from ..state.page_link import Camera
from ..state.plans.plan_results import PlanResults
from ..state.state import State
from .scene_files import scene_archive, scene_yaml

__all__ = ["SOURCE", "StoredPage", "scene_file"]

SOURCE = "what this page showed"
"""What errors call it."""

Six = tuple[FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat]


class StoredGrasp(BaseModel):
    """A picked grasp: h (m), θ (rad), and the index of its roll; see `app.state.state.Pick`."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    h: FiniteFloat
    theta: FiniteFloat
    roll: Annotated[int, Field(ge=0, le=1)] | None


class StoredPage(BaseModel):
    """The settings, format version 1.

    Attributes:
        scene_sha256: SHA-256 of the file of the scene, see `scene_file`.
        scene_name, task, arm, delta, changed_arms: as in `State`.
        object: option of the object that replaces the scene's own.
        robots: `State.robot_options`.
        poses: task → x, y, z (m), lean, its direction and spin (rad), of the tasks that were moved.
        grasp: the picked grasp.
        roll, color_by, handprint, compare: as in `MapViewState`.
        noise: position (m) and tilt (rad) of `MapViewState.noise`.
        sequence_method, hands_method, seed, position: as in `PlanResults`.
        plan: the plan that is chosen, as a plan file.
        planned: whether a task of it is shown.
        display: the options of `Display`.
        camera: see `Camera`.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    version: Literal[1] = 1
    scene_sha256: str
    scene_name: str
    task: str
    arm: str
    delta: FiniteFloat
    object: str | None
    robots: dict[str, str]
    changed_arms: frozenset[str]
    poses: dict[str, Six]
    grasp: StoredGrasp | None
    roll: RollChoice
    color_by: ColorBy
    noise: tuple[NonNegativeFloat, NonNegativeFloat] = (NOISE.position, NOISE.tilt)
    handprint: bool
    compare: bool
    sequence_method: str
    hands_method: str
    seed: int
    plan: str | None
    position: FiniteFloat
    planned: bool
    display: dict[str, bool]
    camera: Six | None

    @classmethod
    def of(cls, state: State, camera: Camera | None, scene: bytes, plan: str | None) -> StoredPage:
        """Return the settings of a state.

        Args:
            state: what is shown.
            camera: where it is looked at from.
            scene: its `scene_file`.
            plan: the plan file of the chosen plan.
        """
        view, results, pick = state.map_view, state.plan_results, state.pick
        return cls(
            scene_sha256=hashlib.sha256(scene).hexdigest(),
            scene_name=state.scene_name,
            task=state.task,
            arm=state.arm,
            delta=state.delta,
            object=state.object_choice.option if state.object_choice else None,
            robots=dict(state.robot_options),
            changed_arms=state.changed_arms,
            poses={name: (p.x, p.y, p.z, p.lean, p.towards, p.spin) for name, p in state.poses.items()},
            grasp=StoredGrasp(h=pick.h, theta=pick.theta, roll=pick.roll) if pick else None,
            roll=view.roll,
            color_by=view.color_by,
            noise=(view.noise.position, view.noise.tilt),
            handprint=view.handprint,
            compare=view.compare,
            sequence_method=results.sequence_method,
            hands_method=results.hands_method,
            seed=results.seed,
            plan=plan,
            position=results.position,
            planned=state.step is not None,
            display=asdict(state.display),
            camera=_six(camera) if camera else None,
        )

    @classmethod
    def parse(cls, content: bytes, scene: bytes) -> StoredPage:
        """Read the settings, and check that they belong to the file of a scene.

        Raises:
            InputError: they are damaged or of another format.
        """
        try:
            page = cls.model_validate_json(content)
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            field = ".".join(map(str, first["loc"])) or "file"
            raise InputError(
                SOURCE, field, first["input"], f"a page that was stored ({first['msg']})"
            ) from None
        if hashlib.sha256(scene).hexdigest() != page.scene_sha256:
            raise InputError(SOURCE, "scene", "another file", "the scene that was stored with it")
        return page

    def applied(self, uploaded: UploadedScene, served: Iterable[str]) -> State:
        """Return the state of these settings, without a plan.

        Args:
            uploaded: the scene, as it was read.
            served: names of the scenes that the server has.

        Raises:
            InputError: the scene has no such tasks or arms, or the object no such height.
        """
        scene = uploaded.scene
        known = set(object_options())
        choice = None
        if self.object is not None:
            library = self.object in known
            own = ObjectChoice(self.object, scene.file.object.name, scene.profile)
            choice = from_library(self.object) if library else own
        for name in (*self.poses, self.task):
            if name not in scene.tasks:
                raise InputError(SOURCE, "tasks", name, one_of(scene.tasks, name))
        if self.arm not in scene.tasks[self.task].arms:
            raise InputError(SOURCE, "arm", self.arm, one_of(scene.tasks[self.task].arms, self.arm))
        state = replace(
            State.of(scene, self.scene_name),
            uploaded_scene=None if self.scene_name in served else replace(uploaded, option=self.scene_name),
            assets=uploaded.assets,
            object_choice=choice,
            uploaded_object=choice if self.object is not None and self.object not in known else None,
            robot_options={name: option for name, option in self.robots.items() if name in scene.robots},
            uploaded_robot=self._uploaded_robot(uploaded),
            changed_arms=self.changed_arms,
            poses={name: ObjectPose(*values) for name, values in self.poses.items()},
        )
        state = replace(state, pose_when_chosen=state.poses.get(state.task))
        state = changes.choose_arm(changes.choose_task(state, self.task), self.arm)
        on = {name: value for name, value in self.display.items() if name in Display.__dataclass_fields__}
        view = replace(state.map_view, roll=self.roll, color_by=self.color_by, handprint=self.handprint)
        view = replace(view, noise=PoseNoise(*self.noise))
        state = replace(
            state,
            display=Display(**on | {"symmetry_error": False}),  # the mesh is not stored
            map_view=replace(view, compare=self.compare),
            plan_results=PlanResults(self.sequence_method, self.hands_method, self.seed),
        )
        state = changes.turn(state, self.delta)
        if self.grasp is None:
            return state
        profile = scene.profile
        h = float(np.clip(self.grasp.h, profile.h_min, profile.h_max))
        state = changes.choose(state, h, self.grasp.theta)
        return replace(state, pick=state.pick and replace(state.pick, roll=self.grasp.roll))

    def _uploaded_robot(self, uploaded: UploadedScene) -> UploadedRobot | None:
        """Return the robot of the scene that was uploaded, if there is one."""
        if not uploaded.assets.folders:
            return None
        entries = {entry.name: entry for entry in uploaded.scene.file.robots}
        for name, option in self.robots.items():
            if option != OWN_ROBOT and option not in robot_options() and name in entries:
                return UploadedRobot(option, entries[name], uploaded.assets.folders[0])
        return None


def _six(values: Camera) -> Six:
    a, b, c, d, e, f = values
    return a, b, c, d, e, f


def scene_file(state: State) -> bytes:
    """Return the file with a state's scene: an archive where robots were uploaded."""
    folders = [folder.path for folder in state.assets.folders]
    return scene_archive(state.scene, "scene.yaml", folders) if folders else scene_yaml(state.scene).encode()
