"""Every change to what one browser shows: no widgets, no threads, no I/O."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from app.state.facts import Pick
from app.state.map_view_state import RollChoice
from app.state.object_choice import ObjectChoice
from app.state.object_pose import ObjectPose
from app.state.page_link import Camera, MadeLink
from app.state.plan_changes import Leafing
from app.state.plan_results import PlanFileReport, PlanResult, PlanResults
from app.state.requests import Busy, Comparison, ExplainResult, MapResult, Request
from app.state.task_list import TaskList
from app.state.uploaded_scene import UploadedScene
from symgrasp.errors import InputError, one_of
from symgrasp.object.manifold import wrap
from symgrasp.poses import Array
from symgrasp.scene.scene import Scene

__all__ = ["Pick", "State"]

GIZMO_NOISE = 1e-6
"""Change of position (m) or axis below which the gizmo only turned: browsers send rounded numbers."""

CAMERA_NOISE = 1e-3
"""How much (m) the camera may move before a link made of it is an earlier one: what links are rounded to."""


@dataclass(frozen=True, eq=False)
class State(Leafing):
    """One browser's scene, pose, map, pick and plan; a change returns a new one."""

    @staticmethod
    def of(scene: Scene, name: str) -> State:
        """Return the first state of a scene."""
        task = scene.task()
        return State(scene, name, task.name, task.arms[0])

    def open_scene(self, scene: Scene, name: str) -> State:
        """Show another scene; what belongs to none stays."""
        return replace(
            State.of(scene, name),
            uploaded=self.uploaded,
            loaded=self.loaded,
            map_view=self.map_view.elsewhere(),
            flat_map=self.flat_map,
            dark=self.dark,
            history=self.history,
        )

    def load_scene(self, loaded: UploadedScene) -> State:
        """Show a scene that was uploaded."""
        return replace(self, loaded=loaded).open_scene(loaded.scene, loaded.choice)

    def choose_object(self, scene: Scene, object_choice: ObjectChoice | None) -> State:
        """Show the scene with another object in it, or with its own again (None)."""
        uploaded = object_choice if object_choice and object_choice.measurement else self.uploaded
        state = replace(self._without_plan(), busy=None, result=None, pick=None)
        return replace(state, scene=scene, object_choice=object_choice, uploaded=uploaded, errors=False)

    def choose_task(self, name: str) -> State:
        """Show another task, with its first arm unless the chosen one takes part."""
        task = self.scene.task(name)
        if name == self.task:
            return self
        arm = self.arm if self.arm in task.arms else task.arms[0]
        before = self.poses.get(name)
        return replace(self, task=name, arm=arm, before=before, delta=0.0, step=None, problem="")

    def choose_arm(self, name: str) -> State:
        """Show the map of another arm of the task; of a plan that is shown, that arm's grasp."""
        arms = self.scene.task(self.task).arms
        if name not in arms:
            raise InputError("page", "arm", name, one_of(arms, name))
        state = replace(self, arm=name, problem="")
        in_plan = self.shown and any(hold.arm == name for hold in self.shown.holds)
        return state.show_step(self.step or 0) if in_plan else replace(state, step=None)

    def choose_roll(self, roll: RollChoice) -> State:
        """Show other rolls; a pick keeps its place and takes the roll shown."""
        pick = replace(self.pick, roll=None) if self.pick else None
        return replace(self, roll=roll, pick=pick, map_view=self.map_view.another_cell())

    def turn(self, delta: float) -> State:
        """Turn the object to δ (rad) about its axis: nothing is recomputed."""
        return replace(self, delta=float(_finite("rotation", delta)), step=None, problem="")

    def move(self, **changes: float) -> State:
        """Move the object: fields of `ObjectPose`, in m and rad. A plan for other poses is dropped."""
        for name, value in changes.items():
            _finite(name, value)
        pose = replace(self.base, **changes)
        if pose == self.base:
            return self
        return replace(self._without_plan(), poses={**self.poses, self.task: pose})

    def drag(self, pose: Array) -> State:
        """Take over the pose (4, 4) of the gizmo; a turn about the axis alone becomes δ."""
        new = ObjectPose.of(pose)
        delta = float(wrap(new.spin - self.base.spin))
        shift = np.linalg.norm(pose[:3, 3] - self.T_world_object[:3, 3])
        tilt = np.linalg.norm(pose[:3, 2] - self.T_world_object[:3, 2])
        if max(shift, tilt) < GIZMO_NOISE:
            return self.turn(delta)
        state = self.move(x=new.x, y=new.y, z=new.z, lean=new.lean, towards=new.towards)
        return replace(state, delta=delta)

    def reset_pose(self) -> State:
        """Put the object of this task back where the scene has it."""
        poses = {name: pose for name, pose in self.poses.items() if name != self.task}
        state = self if len(poses) == len(self.poses) else self._without_plan()
        return replace(state, poses=poses, delta=0.0, step=None, problem="")

    def _without_plan(self) -> State:
        """Drop the plan, also one that is being made."""
        busy = self.busy if self.busy and self.busy.request else None
        return replace(
            self, plan_results=self.plan_results.cleared(), step=None, busy=busy, refused=None, problem=""
        )

    def choose(self, h: float, theta: float) -> State:
        """Pick the grasp at height h (m) and angle θ (rad) in the object's frame."""
        profile = self.scene.profile
        if not profile.h_min <= _finite("h", h) <= profile.h_max:
            expected = f"{100 * profile.h_min:g} to {100 * profile.h_max:g} cm"
            raise InputError("grasp", "h (cm)", round(100 * h, 3), expected)
        theta = float(wrap(_finite("θ", theta)))
        map_view = self.map_view.another_cell()
        return replace(self, pick=Pick(float(h), theta), map_view=map_view, step=None, problem="")

    def choose_candidate(self, candidate: int) -> State:
        """Show a candidate of the picked cell, by its index; the best is the first."""
        return replace(self, map_view=self.map_view.choose_candidate(candidate), step=None)

    def choose_cell(self, row: int, column: int) -> State:
        """Pick the centre of a cell of the map as it is shown."""
        if self.map is None:
            return self
        manifold = self.map.manifold
        return self.choose(float(manifold.h[row]), float(manifold.theta[column]))

    def choose_surface_cell(self, row: int, column: int) -> State:
        """Pick a cell as it lies on the object's surface, whose colours do not turn with the object."""
        if self.result is None:
            return self
        _, turned = self.result.map.manifold.shift(self.delta)
        return self.choose_cell(row, (column - turned) % self.result.map.manifold.angles)

    def clear_pick(self) -> State:
        """Let go: the arms park."""
        return replace(self, pick=None, map_view=self.map_view.another_cell(), step=None)

    def started(self, ticket: int, label: str, request: Request | None = None) -> State:
        """A computation began; it replaces the one before."""
        problem = self.problem if request else ""
        return replace(self, busy=Busy(ticket, label, request), problem=problem)

    def progressed(self, ticket: int, share: float, late: bool = False) -> State:
        """The computation is this far, and so late by now that the page says so."""
        busy = self.busy
        if busy is None or busy.ticket != ticket:
            return self
        late = late or busy.late
        if (share, late) == (busy.share, busy.late):
            return self
        return replace(self, busy=replace(busy, share=share, late=late))

    def compiles(self, ticket: int) -> State:
        """The computation waits for code that is compiled, now and perhaps once more before it ends."""
        return self.compiles_now() if self.busy and self.busy.ticket == ticket else self

    def compiles_now(self) -> State:
        """What is under way waits for code that is compiled."""
        return replace(self, busy=replace(self.busy, late=True, compiling=True)) if self.busy else self

    def map_arrived(self, ticket: int, result: MapResult) -> State:
        """Take a map: that of the object's pose, or on the way there that of an earlier one."""
        is_awaited = self.busy is not None and self.busy.ticket == ticket
        state = replace(self, busy=None) if is_awaited else self
        follows = is_awaited and not self.is_current and result.request.differs_in_pose(self.request)
        if result.request != self.request and not follows:
            return state
        return replace(state, result=result, refused=None)

    def found(self, ticket: int, found: Comparison | ExplainResult) -> State:
        """Take what was found out about the map, unless it is about an earlier one."""
        if self.busy is None or self.busy.ticket != ticket:
            return self
        map_view = self.map_view.take(found) if found.request.map == self.request else self.map_view
        return replace(self, busy=None, map_view=map_view)

    def stopped(self, ticket: int, problem: str = "") -> State:
        """The computation was cancelled or failed: do not begin it again by itself."""
        if self.busy is None or self.busy.ticket != ticket:
            return self
        refused = self.unmet
        if problem and self.busy.request is None:  # it was not the map that failed
            refused = self.refused
        return replace(self, busy=None, refused=refused, problem=problem)

    def failed(self, problem: str) -> State:
        """Something that was asked for cannot be done; nothing else changes."""
        return replace(self, problem=problem)

    def retry(self) -> State:
        """Compute the map after all."""
        return replace(self, refused=None, problem="")

    def change_tasks(self, change: Callable[[TaskList], TaskList]) -> State:
        """Add, remove, rename or reorder tasks. A plan for the others is dropped."""
        before = TaskList(self.scene, self.poses, self.task)
        after = change(before)
        if after == before:
            return self
        arms = after.scene.task(after.task).arms
        stays = np.array_equal(after.T_world_object, before.T_world_object)
        is_same = len(after.scene.tasks) == len(before.scene.tasks)
        return replace(
            self._without_plan(),
            scene=after.scene,
            poses=after.poses,
            task=after.task,
            arm=self.arm if self.arm in arms else arms[0],
            before=self.before if is_same else after.poses.get(after.task),
            delta=self.delta if stays else 0.0,
        )

    def add_task(self) -> State:
        """Add a task with the object where it stands; that of the chosen task was only moved for this."""
        pose = self.request.T_world_object
        return self.change_tasks(lambda tasks: tasks.added(pose, self.before))

    def linked(self, address: str, camera: Camera) -> State:
        """Take the link that was made of it."""
        return replace(self, link=MadeLink(address, self.told, camera), problem="")

    def seen_from(self, camera: Camera) -> State:
        """Look from somewhere: a link made elsewhere is no longer that of what is shown."""
        if self.link is None or not self.link.told:
            return self
        if np.allclose(camera, self.link.camera, rtol=0, atol=CAMERA_NOISE):
            return self
        return replace(self, link=replace(self.link, told=()))

    def opened(self, opened: PlanFileReport, scene: UploadedScene | None, plan: PlanResult | None) -> State:
        """Take a plan from a file, with its scene; one that does not hold is only reported."""
        if scene is None or plan is None:
            return replace(
                self, busy=None, problem="", plan_results=replace(self.plan_results, opened=opened)
            )
        plan_results = PlanResults(
            self.plan_results.sequence_method, self.plan_results.hands_method, self.plan_results.seed
        )
        plan_results = replace(plan_results.found(plan.plan.kind, (plan,), more=False), opened=opened)
        return replace(self.load_scene(scene), plan_results=plan_results).show_step(0)


def _finite(name: str, value: float) -> float:
    if not np.isfinite(value):
        raise InputError("page", name, value, "a finite number")
    return value
