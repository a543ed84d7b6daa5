"""What one browser shows, as plain data, and what follows from it.

The object stands at ``T_world_object = base · Rz(delta)``: the base pose is what a map is
computed for, and δ, the turn about the object's own axis, only shifts that map (equation 3).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

from app.render.playback import PlaybackFrame
from app.state.history import History
from app.state.map_view_state import MapViewState, RollChoice
from app.state.object_choice import OWN, ObjectChoice
from app.state.object_pose import ObjectPose, moved
from app.state.page_link import MadeLink
from app.state.plan_results import Kind, PlanResult, PlanResults
from app.state.requests import Busy, ExplainRequest, MapRequest, MapResult, Request
from app.state.uploaded_scene import UploadedScene
from symgrasp.feasibility.cell import Cell
from symgrasp.feasibility.explain import CandidateResult, Explanation
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.plan.plan import PlanTask
from symgrasp.planners.bimanual import ClimbStep
from symgrasp.poses import Array, rotation_z
from symgrasp.scene.scene import Scene

__all__ = ["Facts", "Pick"]


@dataclass(frozen=True)
class Pick:
    """A grasp that was picked, in the object's frame: h (m), θ (rad), and the roll unless open."""

    h: float
    theta: float
    roll: int | None = None


@dataclass(frozen=True, eq=False)
class Facts:
    """One browser's scene, pose, map, pick and plan.

    Attributes:
        scene: the scene as loaded, with the object that was put into it.
        scene_name: what it was chosen by.
        task, arm: the names chosen.
        thing: the object that was put into the scene in place of its own.
        uploaded: the object that was uploaded last.
        roll: the rolls shown.
        poses: task → base pose, of the tasks that were moved.
        before: that of the chosen task when it was chosen; None where it had not been moved.
        delta: turn (rad) of the object about its axis.
        result: the newest map, maybe of an earlier request.
        refused: what was cancelled or failed: not tried again unasked.
        pick: the grasp picked.
        looking: how the map is looked at, and what was found out about it for that.
        book: the plans that were found, and how they are leafed through.
        step: which task of the plan is shown; None once the person has moved on.
        busy: what is being computed.
        problem: one line about what went wrong last.
        gizmo: whether the handles that drag the object are seen.
        errors: whether the object's surface shows the symmetry error of its mesh and not the map.
        board: whether the map is laid out in the scene as well.
        dark: whether the page is dark.
        loaded: the scene that was uploaded last.
        link: the one that was made last, to open the page as it was then.
        history: what can be undone and redone.
    """

    scene: Scene
    scene_name: str
    task: str
    arm: str
    object_choice: ObjectChoice | None = None
    uploaded: ObjectChoice | None = None
    roll: RollChoice = RollChoice.EITHER
    poses: Mapping[str, ObjectPose] = field(default_factory=dict)
    before: ObjectPose | None = None
    delta: float = 0.0
    result: MapResult | None = None
    refused: Request | None = None
    pick: Pick | None = None
    map_view: MapViewState = field(default_factory=MapViewState)
    plan_results: PlanResults = field(default_factory=PlanResults)
    step: int | None = None
    busy: Busy | None = None
    problem: str = ""
    gizmo: bool = False
    errors: bool = False
    flat_map: bool = True
    dark: bool = False
    loaded: UploadedScene | None = None
    link: MadeLink | None = None
    history: History = field(default_factory=History)

    @cached_property
    def request(self) -> MapRequest:
        """The map that belongs to the task, arm and base pose."""
        return MapRequest(self.scene, self.arm, self.task, self.poses.get(self.task))

    @cached_property
    def base(self) -> ObjectPose:
        """The object's base pose."""
        return self.request.pose or ObjectPose.of(self.request.T_world_object)

    @cached_property
    def T_world_object(self) -> Array:
        """Where the object stands (4, 4)."""
        return self.request.T_world_object @ rotation_z(self.delta)

    @property
    def choice(self) -> str:
        """What the object was chosen by."""
        return self.object_choice.choice if self.object_choice else OWN

    @property
    def own_scene(self) -> Scene | None:
        """The uploaded scene, if that is the one shown, whatever was put into it."""
        return self.loaded.scene if self.loaded and self.loaded.choice == self.scene_name else None

    @property
    def is_current(self) -> bool:
        """Whether the map shown is the one for the object's pose."""
        return self.result is not None and self.result.request == self.request

    @property
    def unmet(self) -> Request | None:
        """What is asked for first and not there."""
        if not self.is_current:
            return self.request
        return self.map_view.unmet(self.request, self.delta, self.base_cell)

    @property
    def lacking(self) -> Request | None:
        """The same, unless it was cancelled or failed: then everything waits."""
        return None if self.unmet == self.refused else self.unmet

    @property
    def wanted(self) -> Request | None:
        """What to begin computing now; while a plan is made, its maps are."""
        lacking = self.lacking
        return None if lacking is None or (self.busy and self.busy.goes_first(lacking)) else lacking

    @property
    def is_obsolete(self) -> bool:
        """Whether something is being computed that nobody waits for any more."""
        return bool(self.busy and self.busy.request) and self.lacking is None

    @property
    def is_stopped(self) -> bool:
        """Whether something is lacking that is not computed unless it is asked for again."""
        return self.busy is None and self.unmet is not None

    @property
    def is_waiting(self) -> bool:
        """Whether something is being computed that takes long enough to say so."""
        return self.busy is not None and (self.busy.request is None or self.busy.late or self.result is None)

    @property
    def is_fresh(self) -> bool:
        """Whether the map shown is the one for the object's pose, or will be in a moment."""
        if self.is_current:
            return True
        follows = self.result is not None and self.result.request.differs_in_pose(self.request)
        return follows and self.busy is not None and not self.is_waiting

    @property
    def inputs(self) -> tuple[object, ...]:
        """Everything that a widget or the gizmo shows and can change."""
        return (
            self.scene, self.scene_name, self.task, self.arm, self.roll, self.base, self.delta, self.pick,
            self.step, self.gizmo, self.errors, self.flat_map, self.dark, self.object_choice, self.uploaded,
            self.loaded,
            *self.map_view.inputs,
            *self.plan_results.inputs,
        )  # fmt: skip

    @property
    def told(self) -> tuple[object, ...]:
        """Everything that a link tells, but for the camera."""
        return (
            self.scene, self.scene_name, self.object_choice, self.task, self.arm, self.poses, self.delta,
            self.roll,
            self.pick, self.map_view.view, self.gizmo, self.flat_map, self.dark,
        )  # fmt: skip

    @cached_property
    def map(self) -> FeasibilityMap | None:
        """The map over the object as it is turned; it may be of an earlier pose."""
        return self.result.map.shift(self.delta) if self.result else None

    @cached_property
    def cell(self) -> Cell | None:
        """The cell of `map` that holds the pick."""
        if self.pick is None or self.map is None:
            return None
        row, column = self.map.manifold.cell(self.pick.h, self.pick.theta)
        roll = self.roll.roll(self.map, row, column) if self.pick.roll is None else self.pick.roll
        return Cell(roll, row, column)

    @cached_property
    def base_cell(self) -> Cell | None:
        """The same cell of the map before it is shifted: it has the same tool pose."""
        if self.cell is None or self.result is None:
            return None
        grid = self.result.map.manifold
        return self.cell.turned(grid.shift(self.delta)[1], grid.angles)

    @property
    def explanation(self) -> Explanation | None:
        """What becomes of the candidates of the picked cell, once that is known."""
        found = self.map_view.explained
        if found is None or not self.is_current or self.base_cell is None:
            return None
        return found.explanation if found.request == ExplainRequest(self.request, self.base_cell) else None

    @property
    def candidate(self) -> int | None:
        """Index of the candidate shown: the one chosen, else the map's witness or what came closest."""
        if self.explanation is None or not self.explanation.candidates:
            return None
        if self.map_view.candidate is not None:
            return min(self.map_view.candidate, len(self.explanation.candidates) - 1)
        witness = self.map.witness(self.cell) if self.map and self.cell else None
        picks = [
            (shown_candidate.sample, shown_candidate.branch)
            for shown_candidate in self.explanation.candidates
        ]
        pick = witness and (witness.sample, witness.branch)
        return picks.index(pick) if pick in picks else 0

    @property
    def shown_candidate(self) -> CandidateResult | None:
        """The candidate shown."""
        if self.explanation is None or self.candidate is None:
            return None
        return self.explanation.candidates[self.candidate]

    @property
    def contacts(self) -> tuple[str, ...]:
        """What the object is inside of."""
        return self.result.contacts if self.result and self.is_current else ()

    @property
    def plan(self) -> PlanResult | None:
        """The plan that is shown, or was until the person moved on."""
        return self.plan_results.plan

    @cached_property
    def shown(self) -> PlanTask | None:
        """The task of the plan that is shown."""
        return self.plan.plan.tasks[self.step] if self.plan and self.step is not None else None

    @cached_property
    def motion(self) -> PlaybackFrame | None:
        """Where the play is, while it is between two tasks."""
        if self.plan is None or self.step is None or not self.plan_results.is_between:
            return None
        start, share = self.plan_results.leg
        before, after = self.plan.plan.tasks[start : start + 2]
        return PlaybackFrame(self.scene, before, after, share)

    @cached_property
    def T_world_seen(self) -> Array:
        """Where the object is drawn (4, 4): in the hand, while the arms are played."""
        return self.motion.T_world_object if self.motion else self.T_world_object

    @cached_property
    def climbed(self) -> ClimbStep | None:
        """The step of the hill climbing that is shown, if nothing else is."""
        climb, frame = self.plan_results.climb, self.plan_results.frame
        if climb is None or frame is None or self.task != climb.task or self.delta or self.pick:
            return None
        return climb.steps[frame]

    def can_plan(self, kind: Kind) -> bool:
        """Whether the scene has tasks for a planner."""
        tasks = self.scene.tasks.values()
        if kind == "sequential":
            return any(task.arms == (self.arm,) for task in tasks)
        if kind == "bimanual":
            return any(len(task.arms) > 1 for task in tasks)
        return len(tasks) > 1 and len({arm for task in tasks for arm in task.arms}) > 1

    @property
    def together(self) -> str:
        """The task for several arms that is planned: the chosen one, or the first."""
        names = [task.name for task in self.scene.tasks.values() if len(task.arms) > 1]
        return self.task if self.task in names or not names else names[0]

    def moved_scene(self) -> Scene:
        """Return the scene with all tasks where they were moved to."""
        return moved(self.scene, self.poses)
