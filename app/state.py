"""What one browser shows, as plain data, and every change to it: no widgets, no threads, no I/O.

The object stands at ``T_world_object = base · Rz(delta)``: the base pose is what a map is
computed for, and δ, the turn about the object's own axis, only shifts that map (equation 3).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from app.asking import Busy, Check, Explained, ExplainRequest, Request
from app.history import History
from app.looking import Looking
from app.motion import Motion
from app.plan_book import Kind, OpenedPlan, PlanBook
from app.scene_files import Loaded
from app.task_list import TaskList
from app.things import OWN, Thing
from app.values import MapRequest, MapResult, ObjectPose, PlanResult, RollChoice, moved
from symgrasp.errors import InputError
from symgrasp.explain import Explanation, Verdict
from symgrasp.feasibility import Cell, FeasibilityMap
from symgrasp.manifold import wrap
from symgrasp.plan import PlanTask
from symgrasp.planners.bimanual import ClimbStep
from symgrasp.poses import Array, rotation_z
from symgrasp.scene import Scene

__all__ = ["Pick", "State"]

GIZMO_NOISE = 1e-6
"""Change of position (m) or axis below which the gizmo only turned: browsers send rounded numbers."""


@dataclass(frozen=True)
class Pick:
    """A grasp that was picked, in the object's frame: h (m), θ (rad), and the roll unless open."""

    h: float
    theta: float
    roll: int | None = None


@dataclass(frozen=True, eq=False)
class State:
    """One browser's scene, pose, map, pick and plan; a change returns a new one.

    Attributes:
        scene: the scene as loaded, with the object that was put into it.
        scene_name: what it was chosen by.
        task, arm: the names chosen.
        thing: the object that was put into the scene in place of its own.
        uploaded: the object that was uploaded last.
        roll: the rolls shown.
        poses: task → base pose, of the tasks that were moved.
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
        link: the address that was made last, to open the page as it was then.
        history: what can be undone and redone.
    """

    scene: Scene
    scene_name: str
    task: str
    arm: str
    thing: Thing | None = None
    uploaded: Thing | None = None
    roll: RollChoice = RollChoice.EITHER
    poses: Mapping[str, ObjectPose] = field(default_factory=dict)
    delta: float = 0.0
    result: MapResult | None = None
    refused: Request | None = None
    pick: Pick | None = None
    looking: Looking = field(default_factory=Looking)
    book: PlanBook = field(default_factory=PlanBook)
    step: int | None = None
    busy: Busy | None = None
    problem: str = ""
    gizmo: bool = False
    errors: bool = False
    board: bool = True
    dark: bool = False
    loaded: Loaded | None = None
    link: str = ""
    history: History = field(default_factory=History)

    @staticmethod
    def of(scene: Scene, name: str) -> State:
        """Return the first state of a scene."""
        task = scene.task()
        return State(scene, name, task.name, task.arms[0])

    # -- what follows from it ---------------------------------------------------------------

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
        return self.thing.choice if self.thing else OWN

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
        return self.looking.unmet(self.request, self.delta, self.base_cell)

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
            self.step, self.gizmo, self.errors, self.board, self.dark, self.thing, self.uploaded, self.loaded,
            *self.looking.inputs,
            *self.book.inputs,
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
        found = self.looking.explained
        if found is None or not self.is_current or self.base_cell is None:
            return None
        return found.explanation if found.request == ExplainRequest(self.request, self.base_cell) else None

    @property
    def candidate(self) -> int | None:
        """Index of the candidate shown: the one chosen, else the map's witness or what came closest."""
        if self.explanation is None or not self.explanation.verdicts:
            return None
        if self.looking.candidate is not None:
            return min(self.looking.candidate, len(self.explanation.verdicts) - 1)
        witness = self.map.witness(self.cell) if self.map and self.cell else None
        picks = [(verdict.sample, verdict.branch) for verdict in self.explanation.verdicts]
        pick = witness and (witness.sample, witness.branch)
        return picks.index(pick) if pick in picks else 0

    @property
    def verdict(self) -> Verdict | None:
        """The candidate shown."""
        if self.explanation is None or self.candidate is None:
            return None
        return self.explanation.verdicts[self.candidate]

    @property
    def contacts(self) -> tuple[str, ...]:
        """What the object is inside of."""
        return self.result.contacts if self.result and self.is_current else ()

    @property
    def plan(self) -> PlanResult | None:
        """The plan that is shown, or was until the person moved on."""
        return self.book.plan

    @cached_property
    def shown(self) -> PlanTask | None:
        """The task of the plan that is shown."""
        return self.plan.plan.tasks[self.step] if self.plan and self.step is not None else None

    @cached_property
    def motion(self) -> Motion | None:
        """Where the play is, while it is between two tasks."""
        if self.plan is None or self.step is None or not self.book.is_between:
            return None
        start, share = self.book.leg
        before, after = self.plan.plan.tasks[start : start + 2]
        return Motion(self.scene, before, after, share)

    @cached_property
    def T_world_seen(self) -> Array:
        """Where the object is drawn (4, 4): in the hand, while the arms are played."""
        return self.motion.T_world_object if self.motion else self.T_world_object

    @cached_property
    def climbed(self) -> ClimbStep | None:
        """The step of the hill climbing that is shown, if nothing else is."""
        climb, frame = self.book.climb, self.book.frame
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

    # -- changes ----------------------------------------------------------------------------

    def open_scene(self, scene: Scene, name: str) -> State:
        """Show another scene; what belongs to none stays."""
        return replace(
            State.of(scene, name),
            uploaded=self.uploaded,
            loaded=self.loaded,
            looking=self.looking.elsewhere(),
            board=self.board,
            dark=self.dark,
            history=self.history,
        )

    def load_scene(self, loaded: Loaded) -> State:
        """Show a scene that was uploaded."""
        return replace(self, loaded=loaded).open_scene(loaded.scene, loaded.choice)

    def choose_object(self, scene: Scene, thing: Thing | None) -> State:
        """Show the scene with another object in it, or with its own again (None)."""
        uploaded = thing if thing and thing.measurement else self.uploaded
        state = replace(self._without_plan(), busy=None, result=None, pick=None)
        return replace(state, scene=scene, thing=thing, uploaded=uploaded, errors=False)

    def choose_task(self, name: str) -> State:
        """Show another task, with its first arm unless the chosen one takes part."""
        task = self.scene.task(name)
        if name == self.task:
            return self
        arm = self.arm if self.arm in task.arms else task.arms[0]
        return replace(self, task=name, arm=arm, delta=0.0, step=None, problem="")

    def choose_arm(self, name: str) -> State:
        """Show another arm's map; of a plan that is shown, that arm's grasp."""
        state = replace(self, arm=self.scene.arm(name).name, problem="")
        in_plan = self.shown and any(hold.arm == name for hold in self.shown.holds)
        return state.show_step(self.step or 0) if in_plan else replace(state, step=None)

    def choose_roll(self, roll: RollChoice) -> State:
        """Show other rolls; a pick keeps its place and takes the roll shown."""
        pick = replace(self.pick, roll=None) if self.pick else None
        return replace(self, roll=roll, pick=pick, looking=self.looking.another_cell())

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
        return replace(self, book=self.book.cleared(), step=None, busy=busy, refused=None, problem="")

    def choose(self, h: float, theta: float) -> State:
        """Pick the grasp at height h (m) and angle θ (rad) in the object's frame."""
        profile = self.scene.profile
        if not profile.h_min <= _finite("h", h) <= profile.h_max:
            expected = f"{100 * profile.h_min:g} to {100 * profile.h_max:g} cm"
            raise InputError("grasp", "h (cm)", round(100 * h, 3), expected)
        theta = float(wrap(_finite("θ", theta)))
        looking = self.looking.another_cell()
        return replace(self, pick=Pick(float(h), theta), looking=looking, step=None, problem="")

    def choose_candidate(self, candidate: int) -> State:
        """Show a candidate of the picked cell, by its index; the best is the first."""
        return replace(self, looking=self.looking.choose_candidate(candidate), step=None)

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
        return replace(self, pick=None, looking=self.looking.another_cell(), step=None)

    def started(self, ticket: int, label: str, request: Request | None = None) -> State:
        """A computation began; it replaces the one before."""
        problem = self.problem if request else ""
        return replace(self, busy=Busy(ticket, label, request), problem=problem)

    def progressed(self, ticket: int, share: float, late: bool = False) -> State:
        """The computation is this far, and so late by now that the page says so."""
        if self.busy is None or self.busy.ticket != ticket:
            return self
        return replace(self, busy=replace(self.busy, share=share, late=late or self.busy.late))

    def map_arrived(self, ticket: int, result: MapResult) -> State:
        """Take a map: that of the object's pose, or on the way there that of an earlier one."""
        is_awaited = self.busy is not None and self.busy.ticket == ticket
        state = replace(self, busy=None) if is_awaited else self
        follows = is_awaited and not self.is_current and result.request.differs_in_pose(self.request)
        if result.request != self.request and not follows:
            return state
        return replace(state, result=result, refused=None)

    def found(self, ticket: int, found: Check | Explained) -> State:
        """Take what was found out about the map, unless it is about an earlier one."""
        if self.busy is None or self.busy.ticket != ticket:
            return self
        looking = self.looking.take(found) if found.request.map == self.request else self.looking
        return replace(self, busy=None, looking=looking)

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
        return replace(
            self._without_plan(),
            scene=after.scene,
            poses=after.poses,
            task=after.task,
            arm=self.arm if self.arm in arms else arms[0],
            delta=self.delta if stays else 0.0,
        )

    def add_task(self) -> State:
        """Add a task with the object where it stands."""
        pose = self.request.T_world_object
        return self.change_tasks(lambda tasks: tasks.added(pose))

    def booked(self, ticket: int, book: PlanBook) -> State:
        """Take what a planner found and show its first task, unless nobody waits for it any more."""
        if self.busy is None or self.busy.ticket != ticket:
            return self
        return replace(self, book=book, busy=None, problem="", step=None, pick=None).show_step(0)

    def listed(self, ticket: int, plans: tuple[PlanResult, ...], more: bool) -> State:
        """Take further plans of the list and show the first of them."""
        if self.busy is None or self.busy.ticket != ticket:
            return self
        state = replace(self, book=self.book.extended(plans, more=more), busy=None, problem="")
        return state.choose_plan(len(self.book.plans)) if plans else state

    def opened(self, opened: OpenedPlan, scene: Loaded | None, plan: PlanResult | None) -> State:
        """Take a plan from a file, with its scene; one that does not hold is only reported."""
        if scene is None or plan is None:
            return replace(self, busy=None, problem="", book=replace(self.book, opened=opened))
        book = PlanBook(self.book.sequence_method, self.book.hands_method, self.book.seed)
        book = replace(book.found(plan.plan.kind, (plan,), more=False), opened=opened)
        return replace(self.load_scene(scene), book=book).show_step(0)

    def turn_book(self, change: Callable[[PlanBook], PlanBook]) -> State:
        """Change what is shown of the plans, if that is all that changes."""
        book = change(self.book)
        return self if book is self.book else replace(self, book=book)

    def choose_plan(self, page: int) -> State:
        """Show another plan of the list, at the same task."""
        step = self.step or 0
        return replace(self, book=self.book.turned_to(page)).show_step(step)

    def show_step(self, step: int) -> State:
        """Show a task of the plan: the object turned by δᵢ and the grasp on its map."""
        return self.show_position(step)

    def show_position(self, position: float) -> State:
        """Show the plan at a position of the play: the task nearest to it, the arms maybe between two."""
        if self.plan is None:
            return self
        book = self.book.at(position)
        step = book.nearest
        task = self.plan.plan.tasks[step]
        hold = next((h for h in task.holds if h.arm == self.arm), task.holds[0])
        pick = Pick(hold.grasp.h, hold.grasp.theta, 0 if np.cos(hold.grasp.roll) > 0 else 1)
        return replace(
            self,
            book=book,
            step=step,
            task=task.name,
            arm=hold.arm,
            delta=task.delta,
            pick=pick,
            looking=self.looking.another_cell(),
            result=self.plan.maps[task.name, hold.arm],
            problem="",
        )

    def show_frame(self, frame: int) -> State:
        """Show a step of the hill climbing: the hands on the maps as they were computed."""
        climb = self.book.climb
        if climb is None:
            return self
        arm = self.arm if self.arm in climb.arms else climb.arms[0]
        return replace(
            self,
            book=self.book.at_frame(frame),
            step=None,
            task=climb.task,
            arm=arm,
            delta=0.0,
            pick=None,
            result=self.book.maps[climb.task, arm],
            problem="",
        )

    def play_arms(self) -> State:
        """Start or stop the play of the plan."""
        return replace(self, book=self.book.play_arms())._followed()

    def play_climb(self) -> State:
        """Start or stop the replay of the hill climbing."""
        return replace(self, book=self.book.play_climb())._followed()

    def played(self, seconds: float) -> State:
        """Let what is played go on; it stops where the person has moved on to something else."""
        moving = self.book.moving
        if not moving:
            return self
        if (self.step if moving == "arms" else self.climbed) is None:
            return self.turn_book(PlanBook.still)
        return replace(self, book=self.book.advanced(seconds))._followed()

    def _followed(self) -> State:
        """Show what the book is open at."""
        if self.book.moving == "climb" or self.book.frame is not None:
            return self.show_frame(self.book.frame or 0)
        return self.show_position(self.book.position)


def _finite(name: str, value: float) -> float:
    if not np.isfinite(value):
        raise InputError("page", name, value, "a finite number")
    return value
