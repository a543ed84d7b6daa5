"""The state of one browser as one immutable value, and what is derived from it.

The object is at ``T_world_object = base · Rz(delta)``: the base pose is what a map is computed for,
and δ, the turn about the object's own axis, only shifts that map (equation 3). The changes are functions
from state to state, in `app.state.changes`, `app.state.job_changes`, `app.state.plans.plan_changes` and
`app.state.undo`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from symgrasp.feasibility.cell import Cell
from symgrasp.feasibility.explain import CandidateResult, Explanation
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.plan.plan import PlanTask
from symgrasp.planners.bimanual import ClimbStep
from symgrasp.poses import Array, rotation_z
from symgrasp.reason import Reason
from symgrasp.robot.robot import Robot
from symgrasp.scene.scene import Scene

from ..choices.object_choice import OWN, ObjectChoice
from ..choices.robot_choice import OWN_ROBOT, UploadedRobot
from ..choices.scene_assets import NO_ASSETS, SceneAssets
from ..choices.uploaded_scene import UploadedScene
from .cached import cached
from .display import Display
from .history import History
from .map_view_state import MapViewState
from .object_pose import ObjectPose, with_poses
from .page_link import PageLink
from .plans.plan_results import PlanKind, PlanResult, PlanResults
from .requests import (
    SAME_PHI,
    Busy,
    ElbowMotion,
    ElbowRequest,
    ExplainRequest,
    MapRequest,
    MapResult,
    Probability,
    Request,
)
from .surveys.survey import Places, SurveyRequest, SurveyState

__all__ = ["Pick", "State"]


@dataclass(frozen=True)
class Pick:
    """A picked grasp in the object's frame.

    Attributes:
        h: height (m).
        theta: angle θ (rad).
        roll: index of the roll; None for the one that `MapViewState.roll` shows.
    """

    h: float
    theta: float
    roll: int | None = None


@dataclass(frozen=True, eq=False)
class State:
    """One browser's scene, object pose, map, pick and plan.

    Attributes:
        scene: the scene with the chosen object, hands and tasks, at the poses of its file.
        scene_name: its option in the menu.
        task, arm: names of those chosen.
        object_choice: the object that replaces the scene's own; None for its own.
        uploaded_object: the object that was uploaded last.
        uploaded_scene: the scene that was uploaded last.
        assets: what belongs to the scene.
        robot_options: robot → its option in the menu, of those that replace robots of the scene's file.
        uploaded_robot: the robot that was uploaded last.
        changed_arms: the arms whose tool link or hand was chosen in a way that no link can carry.
        poses: task → base pose of the object, of the tasks that were moved.
        pose_when_chosen: the entry of `poses` for the chosen task when it was chosen, if there was one.
        delta: turn (rad) of the object about its axis.
        result: the newest map, which may be of an earlier pose.
        pick: the picked grasp.
        holds_first: whether the grasp with the most room is picked as soon as the map is there.
        map_view: how the map is shown, and what was computed for it.
        plan_results: the results of planners, and which part is shown.
        step: index of the plan's task that is shown; None once something else is shown.
        survey: what is known and shown of surveys.
        busy: the computation under way.
        refused: the request that was cancelled or failed and is not restarted by itself.
        problem: one line about the last error.
        display: display options of the page.
        link: the link that was made last.
        press: number of the press of the pointer under way on the page; 0 for none.
        tour: how often the tour was asked for from the palette.
        history: what can be undone and redone.
    """

    scene: Scene
    scene_name: str
    task: str
    arm: str
    object_choice: ObjectChoice | None = None
    uploaded_object: ObjectChoice | None = None
    uploaded_scene: UploadedScene | None = None
    assets: SceneAssets = NO_ASSETS
    robot_options: Mapping[str, str] = field(default_factory=dict)
    uploaded_robot: UploadedRobot | None = None
    changed_arms: frozenset[str] = frozenset()
    poses: Mapping[str, ObjectPose] = field(default_factory=dict)
    pose_when_chosen: ObjectPose | None = None
    delta: float = 0.0
    result: MapResult | None = None
    pick: Pick | None = None
    holds_first: bool = False
    map_view: MapViewState = field(default_factory=MapViewState)
    plan_results: PlanResults = field(default_factory=PlanResults)
    step: int | None = None
    survey: SurveyState = field(default_factory=SurveyState)
    busy: Busy | None = None
    refused: Request | None = None
    problem: str = ""
    display: Display = field(default_factory=Display)
    link: PageLink | None = None
    press: int = 0
    tour: int = 0
    history: History[State] = field(default_factory=History)

    @staticmethod
    def of(scene: Scene, name: str) -> State:
        """Return the first state of a scene."""
        task = scene.task()
        return State(scene, name, task.name, task.arms[0])

    @property
    def input_values(self) -> tuple[object, ...]:
        """All values that a widget or the gizmo shows and can change."""
        return (
            self.scene, self.scene_name, self.task, self.arm, self.base, self.delta, self.pick, self.step,
            self.display, self.object_choice, self.uploaded_object, self.uploaded_scene,
            self.robot_options, self.uploaded_robot,
            *self.map_view.input_values,
            *self.plan_results.input_values,
        )  # fmt: skip

    @property
    def link_values(self) -> tuple[object, ...]:
        """All values that a link contains, except the camera."""
        return (
            self.scene, self.scene_name, self.object_choice, self.task, self.arm, self.poses, self.delta,
            self.map_view.roll, self.pick, self.map_view.color_by, self.map_view.noise,
            self.display,
        )  # fmt: skip

    # -- scene and object -------------------------------------------------------------------

    @property
    def object_option(self) -> str:
        """The object's option in the menu."""
        return self.object_choice.option if self.object_choice else OWN

    @property
    def robot(self) -> Robot:
        """The robot of the chosen arm."""
        return self.scene.arm(self.arm).robot

    @property
    def robot_option(self) -> str:
        """The option in the menu of the robot of the chosen arm."""
        return self.robot_options.get(self.robot.name, OWN_ROBOT)

    @property
    def shown_upload(self) -> Scene | None:
        """The uploaded scene as it was read, if it is the one shown."""
        uploaded = self.uploaded_scene
        return uploaded.scene if uploaded and uploaded.option == self.scene_name else None

    @cached
    def base(self) -> ObjectPose:
        """The object's base pose, without δ."""
        return self.request.pose or ObjectPose.of(self.request.T_world_object)

    @cached
    def T_world_object(self) -> Array:
        """Pose (4, 4) of the object, turned by δ."""
        return self.request.T_world_object @ rotation_z(self.delta)

    def moved_scene(self) -> Scene:
        """Return the scene with all tasks at the poses they were moved to."""
        return with_poses(self.scene, self.poses)

    # -- what is computed -------------------------------------------------------------------

    @cached
    def request(self) -> MapRequest:
        """The request for the map of the chosen task and arm at the base pose."""
        return MapRequest(self.scene, self.arm, self.task, self.poses.get(self.task))

    @property
    def is_current(self) -> bool:
        """Whether the newest map is the exact one for the object's pose."""
        return self.result is not None and self.result.request == self.request and not self.is_preliminary

    @property
    def is_preliminary(self) -> bool:
        """Whether the newest map is shown only until the exact one is computed."""
        return self.result is not None and self.result.preliminary

    @property
    def missing_request(self) -> Request | None:
        """The first request whose result is missing, None if there is none."""
        if not self.is_current:
            return self.request
        return self.map_view.missing_request(self.request, self.delta, self.base_cell)

    @property
    def pending_request(self) -> Request | None:
        """The missing request, unless it was cancelled or failed."""
        return None if self.missing_request == self.refused else self.missing_request

    @property
    def next_request(self) -> Request | None:
        """The pending request to start now; None while another computation goes first, such as a planner."""
        pending = self.pending_request
        return None if pending is None or (self.busy and self.busy.goes_before(pending)) else pending

    @property
    def is_obsolete(self) -> bool:
        """Whether the request being computed is no longer needed."""
        return bool(self.busy and self.busy.request) and self.pending_request is None

    @property
    def is_stopped(self) -> bool:
        """Whether a result is missing and nothing is computed until a person restarts it."""
        return self.busy is None and self.missing_request is not None

    @property
    def is_waiting(self) -> bool:
        """Whether the page shows a computation as running."""
        return self.busy is not None and (self.busy.request is None or self.busy.late or self.result is None)

    @property
    def is_fresh(self) -> bool:
        """Whether the newest map is for the object's pose, or a quick computation will replace it."""
        if self.is_current or self.result is None or self.result.map.preliminary:
            return self.is_current
        follows = self.result.request.differs_only_in_pose(self.request)
        return follows and self.busy is not None and not self.is_waiting

    # -- surveys ----------------------------------------------------------------------------

    @cached
    def survey_request(self) -> SurveyRequest:
        """The survey of what is shown now."""
        kind = self.survey.kind
        return SurveyRequest(self.scene, self.poses, self.task, self.arm, kind, self.survey.spacing[kind])

    @cached
    def shown_places(self) -> Places | None:
        """What is known of places, if it is about what is shown now."""
        survey = self.survey
        if survey.places is None or survey.request is None:
            return None
        return survey.places if survey.request.subject == self.survey_request.subject else None

    # -- the map and the picked grasp -------------------------------------------------------

    @property
    def probability(self) -> Probability | None:
        """How probable the grasps of the map are, where that is shown and known."""
        return self.map_view.probability_of(self.request) if self.is_current else None

    @cached
    def base_map(self) -> FeasibilityMap | None:
        """The newest map before it is shifted by δ, with the probabilities or windows that are shown."""
        if self.result is None:
            return None
        windows = self.map_view.windows_of(self.request) if self.is_current else None
        if windows is not None:
            return replace(self.result.map, widest=windows.widest)
        if self.probability is None:
            return self.result.map
        return replace(self.result.map, probability=self.probability.feasible / self.probability.draws)

    @cached
    def map(self) -> FeasibilityMap | None:
        """The newest map, shifted by δ."""
        return self.base_map.shift(self.delta) if self.base_map else None

    @property
    def contacts(self) -> tuple[str, ...]:
        """A phrase for each obstacle that the object is inside of."""
        return self.result.contacts if self.result and self.is_current else ()

    @cached
    def cell(self) -> Cell | None:
        """The cell of `map` that contains the picked grasp."""
        if self.pick is None or self.map is None:
            return None
        row, column = self.map.manifold.cell(self.pick.h, self.pick.theta)
        roll = self.pick.roll
        if roll is None:
            roll = self.map_view.roll.roll(self.map, row, column)
        return Cell(roll, row, column)

    @cached
    def base_cell(self) -> Cell | None:
        """The cell of the unshifted map with the same tool pose as `cell`."""
        if self.cell is None or self.result is None:
            return None
        grid = self.result.map.manifold
        return self.cell.turned(grid.shift(self.delta)[1], grid.angles)

    @property
    def explanation(self) -> Explanation | None:
        """The results of all candidates of the picked cell, once they are computed."""
        explained = self.map_view.explained
        if explained is None or not self.is_current or self.base_cell is None:
            return None
        request = ExplainRequest(self.request, self.base_cell)
        return explained.explanation if explained.request == request else None

    @property
    def candidate(self) -> int | None:
        """Index of the candidate shown: the one chosen, else the map's witness, else the best."""
        if self.explanation is None or not self.explanation.candidates:
            return None
        if self.map_view.candidate is not None:
            return min(self.map_view.candidate, len(self.explanation.candidates) - 1)
        witness = self.map.witness(self.cell) if self.map and self.cell else None
        if witness is None:
            return 0
        # By its value: a value that is not among the samples has other indices on the map and here.
        same = (
            k
            for k, candidate in enumerate(self.explanation.candidates)
            if candidate.branch == witness.branch and abs(candidate.phi - witness.phi) < SAME_PHI
        )
        return next(same, 0)

    @property
    def shown_candidate(self) -> CandidateResult | None:
        """The candidate shown."""
        if self.explanation is None or self.candidate is None:
            return None
        return self.explanation.candidates[self.candidate]

    @property
    def has_elbow(self) -> bool:
        """Whether a grasp leaves the chosen arm a motion: it has seven joints, those of a torso aside."""
        return not self.scene.arm(self.arm).pitched and self.scene.arm(self.arm).dof - self._torso_dof > 6

    @property
    def _torso_dof(self) -> int:
        return len(self.robot.torso.joint_names) if self.robot.torso else 0

    @property
    def are_elbow_motions_known(self) -> bool:
        """Whether it is known how the elbow may move at the picked cell, where that is asked for."""
        found, explanation = self.map_view.elbow_motions, self.explanation
        if not self.map_view.moves_elbow or found is None or explanation is None or self.base_cell is None:
            return False
        return found.request == ElbowRequest(self.request, self.base_cell)

    @property
    def elbow_motion(self) -> ElbowMotion | None:
        """The motion of the elbow from the candidate shown, if that is feasible and it is asked for."""
        candidate = self.shown_candidate
        if candidate is None or candidate.reason != Reason.FEASIBLE or not self.are_elbow_motions_known:
            return None
        assert self.map_view.elbow_motions
        motions = self.map_view.elbow_motions.motions
        return next((motion for motion in motions if motion.holds(candidate, self._torso_dof)), None)

    @property
    def elbow(self) -> float | None:
        """Where the elbow was moved to: the redundancy (rad); None where it was not."""
        return self.map_view.elbow if self.elbow_motion else None

    @property
    def shown_values(self) -> Array | None:
        """Joint values (n,) of the candidate shown, with the elbow where it was moved to."""
        if self.shown_candidate is None:
            return None
        if self.elbow_motion is None or self.elbow is None:
            return self.shown_candidate.q
        return self.elbow_motion.at(self.elbow)

    # -- plans ------------------------------------------------------------------------------

    @property
    def plan(self) -> PlanResult | None:
        """The plan that is chosen, also while something else is shown."""
        return self.plan_results.plan

    @cached
    def shown_task(self) -> PlanTask | None:
        """The task of the plan that is shown."""
        return self.plan.plan.tasks[self.step] if self.plan and self.step is not None else None

    @cached
    def climb_step(self) -> ClimbStep | None:
        """The step of the hill climbing that is shown, None while something else is."""
        climb, frame = self.plan_results.climb, self.plan_results.frame
        if climb is None or frame is None or self.task != climb.task or self.delta or self.pick:
            return None
        return climb.steps[frame]

    def can_plan(self, kind: PlanKind) -> bool:
        """Return whether the scene has tasks for a kind of planner."""
        tasks = self.scene.tasks.values()
        if kind == "sequential":
            return any(task.arms == (self.arm,) for task in tasks)
        if kind == "bimanual":
            return any(len(task.arms) > 1 for task in tasks)
        return len(tasks) > 1 and len({arm for task in tasks for arm in task.arms}) > 1

    @property
    def bimanual_task(self) -> str:
        """Name of the task for several arms to plan: the chosen one if it is such a task, else the first."""
        names = [task.name for task in self.scene.tasks.values() if len(task.arms) > 1]
        return self.task if self.task in names or not names else names[0]
