"""Links that open the page as it is now: scene, object, hands, tasks, grasp and camera in the address.

A link is readable, so that people may write one by hand; lengths are in cm, angles in degrees.

    ?scene=pick_pour_place&task=pour&arm=panda&turn=30&at.pour=50,10,30,110,90,0&h=12&theta=-40
    ?tasks=pick,twist,place&at.twist=50,10,30,110,90,0&arms.twist=iiwa,panda

``tasks`` names all tasks in order. One that the scene on the server has is as it is there, but for ``at.``
(where it was moved to) and ``arms.``. Any other is a new one: ``at.`` is its own pose, and its arms are
those of the scene's first task unless ``arms.`` names them. A link contains nothing that was uploaded.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any
from urllib.parse import parse_qsl, urlencode

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError

from symgrasp.errors import InputError, one_of
from symgrasp.feasibility.color_by import ColorBy
from symgrasp.scene.parts import Task
from symgrasp.scene.scene import Scene

from ..state import changes
from ..state.map_view_state import NOISE, RollChoice
from ..state.object_pose import ObjectPose
from ..state.page_link import Camera
from ..state.state import State
from .link_values import CameraView, Colors, Names, Noise, Number, Pose, Rolls, Side, Switch

__all__ = ["Link"]

LONGEST = 4000
"""Most characters of a link: browsers tell the server of no address above 4096."""

VISER = ("websocket", "darkMode", "showStats", "hideViserLogo", "fixedDpr")
"""What viser's own page understands in an address, beside keys that begin with initialCamera."""

SAME = 1e-9
"""Difference that rounding may cause: of heights (m), and of entries of pose matrices."""


class Link(BaseModel):
    """The settings of an address, in the order in which they are written.

    Attributes:
        scene: name of the scene; the server's first if None.
        object: name of an object of the library; the scene's own if None.
        hand: arm → name of the hand mounted on it.
        task, arm: the names chosen; the first ones if None.
        tasks: names of all tasks; those of the scene on the server if None.
        arms: task → names of its arms.
        at: task → pose of the object.
        turn: turn of the object about its axis (degrees).
        roll, view: which rolls the map shows, and what its colours stand for.
        noise: how uncertain the object's pose is where they stand for probabilities (mm, degrees).
        board, gizmo, dark: `Display.flat_map`, `Display.drag_handles` and `Display.dark`.
        camera: see `Camera`; the page's own if None.
        h, theta: the picked grasp (cm, degrees); none is picked if h is None.
        side: index of its roll; open if None.
    """

    model_config = ConfigDict(frozen=True)

    scene: str | None = None
    object: str | None = None
    hand: dict[str, str] = {}
    task: str | None = None
    arm: str | None = None
    tasks: Names | None = None
    arms: dict[str, Names] = {}
    at: dict[str, Pose] = {}
    turn: Number = 0.0
    roll: Rolls = RollChoice.EITHER
    view: Colors = ColorBy.REASON
    noise: Noise = NOISE
    board: Switch = True
    gizmo: Switch = False
    dark: Switch = False
    camera: CameraView | None = None
    h: Number | None = None
    theta: Number | None = None
    side: Side | None = None

    @classmethod
    def parse(cls, query: str) -> Link:
        """Read what stands behind the ``?`` of an address; what only viser understands is left out.

        Raises:
            InputError: it is too long, or a setting is unknown, given twice or has an unusable value.
        """
        if len(query) > LONGEST:
            raise InputError("link", "length", len(query), f"at most {LONGEST} characters")
        settings: dict[str, Any] = {}
        for key, text in parse_qsl(query, keep_blank_values=True):
            if key in VISER or key.startswith("initialCamera"):
                continue
            field, dot, name = key.partition(".")
            if field + dot not in KEYS:
                raise InputError("link", key, text, one_of((k + KEYS[k] for k in KEYS), key))
            holder, name = (settings.setdefault(field, {}), name) if dot else (settings, field)
            if name in holder:
                raise InputError("link", key, text, "every setting once")
            holder[name] = text
        if "h" not in settings:  # then there is no grasp, whatever these say
            settings |= {"theta": None, "side": None}
        return cls._checked(settings)

    @classmethod
    def of(cls, state: State, served: Scene, camera: Camera | None = None) -> Link:
        """Return the link that opens a state again.

        Args:
            state: what is shown.
            served: its scene as the server has it.
            camera: where it is looked at from.

        Raises:
            InputError: something that was uploaded is shown, or a number is too large for a link.
        """
        choice, tasks, known = state.object_choice, state.scene.tasks, served.tasks
        for key, upload in (("scene", state.shown_upload), ("object", choice and choice.measurement)):
            if upload:
                expected = "something the server has; save the scene instead"
                raise InputError("link", key, "an upload", expected)
        own = [robot.T_world_base for robot in served.robots.values()]
        now = [robot.T_world_base for robot in state.scene.robots.values()]
        if state.robot_options or state.changed_arms or not np.allclose(own, now, rtol=0, atol=SAME):
            chosen = sorted({*state.robot_options.values()}) or "moved, or with another tool"
            expected = "the robots of the scene on the server, as they are there; save the scene instead"
            raise InputError("link", "robot", chosen, expected)
        arms, at = {}, {}
        for name, task in tasks.items():
            own = known.get(name)
            if task.arms != (own or served.task()).arms:
                arms[name] = task.arms
            if name in state.poses:
                at[name] = state.poses[name]
            elif not own or not np.allclose(own.T_world_object, task.T_world_object, rtol=0, atol=SAME):
                at[name] = ObjectPose.of(task.T_world_object)
        display, view = state.display, state.map_view
        settings: dict[str, Any] = {
            "scene": state.scene_name, "object": choice and choice.option,
            "hand": state.scene.replaceable_hands, "task": state.task, "arm": state.arm,
            "tasks": None if list(tasks) == list(known) else tasks, "arms": arms, "at": at,
            "turn": np.rad2deg(state.delta), "roll": view.roll, "view": view.color_by,
            "noise": view.noise,
            "board": display.flat_map, "gizmo": display.drag_handles, "dark": display.dark,
            "camera": camera,
        }  # fmt: skip
        if pick := state.pick:
            settings |= {"h": 100 * pick.h, "theta": np.rad2deg(pick.theta), "side": pick.roll}
        return cls._checked(settings)

    @classmethod
    def _checked(cls, settings: Mapping[str, Any]) -> Link:
        try:
            return cls.model_validate(settings)
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
        value, expected = first.get("ctx", {})["error"].args  # see `link_values`
        raise InputError("link", ".".join(map(str, first["loc"])), value, expected)

    def query(self) -> str:
        """Return what stands behind the ``?`` of the address: the settings that are not default.

        Raises:
            InputError: it would be too long to be read.
        """
        texts = self.model_dump(exclude_defaults=True)
        parts: dict[str, str] = {}
        for key, text in texts.items():
            if key in ("arms", "at"):  # those of a task stand together
                names = (*(self.tasks or ()), *self.at, *self.arms)
                each = [(k, name) for name in names for k in ("arms", "at") if name in getattr(self, k)]
                parts |= {f"{k}.{name}": texts[k][name] for k, name in each}
            elif key == "hand":
                parts |= {f"hand.{arm}": hand for arm, hand in text.items()}
            else:
                parts[key] = text
        query = urlencode(parts, safe=",°")
        if len(query) > LONGEST:
            expected = f"at most {LONGEST} characters; save the scene instead"
            raise InputError("link", "length", len(query), expected)
        return query

    def apply(self, state: State) -> State:
        """Return the first state of the link's scene with its object and hands, set up as the link says.

        The order of the settings in the address does not matter.

        Raises:
            SymgraspError: the scene has no such tasks or arms, or the object no such height.
        """
        state = self._with_tasks(state)
        if self.task is not None:
            state = changes.choose_task(state, self.task)
        if self.arm is not None:
            arms = state.scene.task(state.task).arms
            if self.arm not in arms:
                raise InputError("link", "arm", self.arm, one_of(arms, self.arm))
            state = changes.choose_arm(state, self.arm)
        state = changes.switched(state, flat_map=self.board, drag_handles=self.gizmo, dark=self.dark)
        state = replace(
            state, map_view=replace(state.map_view, roll=self.roll, color_by=self.view, noise=self.noise)
        )
        state = changes.turn(state, np.deg2rad(self.turn))
        if self.h is None:
            return state
        h, profile = self.h / 100, state.scene.profile
        inside = float(np.clip(h, profile.h_min, profile.h_max))
        state = changes.choose(state, inside if abs(inside - h) < SAME else h, np.deg2rad(self.theta or 0.0))
        return replace(state, pick=state.pick and replace(state.pick, roll=self.side))

    def _with_tasks(self, state: State) -> State:
        """Return the first state of a scene with the tasks of the link; the first of them is shown."""
        scene, known = state.scene, state.scene.tasks
        names = tuple(known) if self.tasks is None else self.tasks
        for name in self.arms:
            if name not in names:
                text = self.model_dump()["arms"][name]
                raise InputError("link", f"arms.{name}", text, f"arms of a task: {one_of(names, name)}")
        tasks = []
        for name in names:
            if name not in known and name not in self.at:
                raise InputError("link", "tasks", name, f"{one_of(known, name)}; a new task needs at.<task>")
            own = known.get(name) or Task(name, scene.task().arms, self.at[name].matrix())
            for arm in self.arms.get(name, ()):
                if arm not in scene.arms:
                    raise InputError("link", f"arms.{name}", arm, one_of(scene.arms, arm))
            tasks.append(replace(own, arms=self.arms.get(name, own.arms)))
        if self.tasks is not None or self.arms:
            scene = scene.with_tasks(tasks)
        poses = {name: pose for name, pose in self.at.items() if scene.task(name).name in known}
        task = scene.task()
        state = replace(state, scene=scene, task=task.name, arm=task.arms[0])
        return replace(state, poses=poses, pose_when_chosen=poses.get(task.name))


NAMED = {"hand": "<arm>", "arms": "<task>", "at": "<task>"}

KEYS = {f"{field}." if field in NAMED else field: NAMED.get(field, "") for field in Link.model_fields}
"""Key of a setting, up to a dot → what follows the dot."""
