"""The 3D view of one browser."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress

import numpy as np
import viser

from symgrasp.poses import Array, from_position_quat
from symgrasp.scene.scene import Scene

from ..render.drawn_poses import drawn_joint_values
from ..state.page_link import Camera
from ..state.state import State
from .backdrop import add_floor, add_lights, add_obstacle
from .flat_map import FlatMap
from .following import followed, points_to_follow, unhidden, with_flat_map
from .ghost_view import GhostView
from .glide import Glide
from .nodes import set_pose
from .object_view import ObjectView
from .robot_view import RobotView
from .survey_view import SurveyView
from .tool_path import ToolPath
from .viewpoint import FIELD_OF_VIEW, Viewpoint, choose_viewpoint

__all__ = ["SceneView"]

SAME_CAMERA = 0.02
"""Cameras whose coordinates (m) differ by less are the same: browsers report them inexactly."""


class SceneView:
    """Shows a state in 3D.

    Args:
        client: the browser.
        size: width and height (px) of the view at first, which browsers report only after the panels are laid
            out; None for what they report.
        on_surface: called with the cell (row, column) that was clicked on the object.
        on_flat_map: called with the cell that was clicked on the flat map.
        on_drag: called with the pose (4, 4) that the object's gizmo was dragged to.
        on_base_drag: called with the pose (4, 4) that the robot's gizmo was dragged to.
        on_place: called with the index of a place of a survey that was clicked.
        on_stand: called with the index of one of the best bases that was clicked.

    Attributes:
        camera: the camera to show the next scene from; None for a viewpoint that suits the scene.
        is_close: whether that viewpoint is close to the object, for the next scene.
        flat_map: the flat map; None before a scene is shown.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        size: tuple[int, int] | None,
        on_surface: Callable[[int, int], None],
        on_flat_map: Callable[[int, int], None],
        on_drag: Callable[[Array], None],
        on_base_drag: Callable[[Array], None],
        on_place: Callable[[int], None] = lambda _: None,
        on_stand: Callable[[int], None] = lambda _: None,
    ) -> None:
        self.client = client
        self.on_surface, self.on_flat_map = on_surface, on_flat_map
        self.on_drag, self.on_base_drag = on_drag, on_base_drag
        self.on_place, self.on_stand = on_place, on_stand
        self._first_size = size
        self._scene: Scene | None = None
        self._builds = self._ghosts = 0
        self._dark = False
        self._followed: tuple[object, ...] = ()
        self._first_camera: Camera = (0.0,) * 6
        self._arrived = self._awaits_grasp = False
        self._aspect_built_for = 1.0
        self.camera: Camera | None = None
        self.is_close = False
        self._root = self._object_root = ""
        self.flat_map: FlatMap | None = None

    def show(self, state: State, *, move_gizmo: bool) -> None:
        """Update the view to a state.

        Args:
            state: the state.
            move_gizmo: move the gizmo as well; not while a person is dragging it.
        """
        if self._scene is None or not _same_bodies(state.scene, self._scene):
            self._build(state)
        elif (state.scene.profile, state.scene.settings) != (self._scene.profile, self._scene.settings):
            self._build_object(state)
        assert self._scene
        if state.scene.robots is not self._scene.robots:
            self._move_robots(state)
        if state.display.dark != self._dark:
            self._dark = state.display.dark
            add_floor(self.client, f"{self._root}/floor", state.scene, dark=state.display.dark)
        with self.client.atomic():
            if state.is_current or not state.busy:  # else the arms keep still until the map arrives
                self._picked, before = state.pick, self._picked
                goal = drawn_joint_values(state)
                self._glide.aim(goal, time.monotonic(), visibly=state.pick != before)
                self._show_arms()
            if state.missing_request is None or not state.busy:
                self.ghost.show(state)
            self.object.show(state, move_gizmo=move_gizmo)
            self.tool_path.show(state)
            self.survey.show(state)
            self.base_gizmo.visible = state.display.base_handles
            if move_gizmo:
                set_pose(self.base_gizmo, state.robot.T_world_base)
            if self.flat_map:
                self.flat_map.show(state)
            if self._awaits_grasp and not state.holds_first and state.is_current:
                self._awaits_grasp = False  # the arm has just taken it
                view = self._choose_viewpoint(state, self._aspect_built_for, close=True)
                self._look_from(view.camera(self._aspect_built_for))
            self._follow(state)
        if state.result is not None:  # cells may be pointed at: after all else, as nobody sees it yet
            self.ghost.prepare(state.robot.name)

    def wait(self) -> float | None:
        """Return the time (s) until `step` is due, which moves arms on their way to a grasp; else None."""
        return None if self._scene is None else self._glide.wait(time.monotonic())

    def step(self) -> None:
        """Move arms that are on their way by a frame."""
        self._glide.step(time.monotonic())
        with self.client.atomic():
            self._show_arms()

    def _show_arms(self) -> None:
        for name, values in self._glide.values.items():
            self.robots[name].show(values)

    def camera_moved(self, camera: Camera) -> None:
        """Turn the flat map to the camera where it can no longer be read from there; on any thread.

        What a browser says before it is where it was put at first is from before the scene was there.
        Whoever looks elsewhere before the first grasp is there is not turned back to it.
        """
        if np.allclose(camera, self._first_camera, atol=SAME_CAMERA):
            self._arrived = True
        elif self._arrived:
            self._awaits_grasp = False
            if self.flat_map:
                with suppress(RuntimeError):  # it was removed: another is about to take its place
                    self.flat_map.face(camera)

    def _build(self, state: State) -> None:
        """Replace all nodes by those of another scene."""
        client, scene = self.client, state.scene
        root = self._root = self._replace(self._root, "/scene")
        self._object_root = ""
        given, self.camera = self.camera, None
        self._followed = _shown_of_plan(state) if given or self.is_close else ()
        values = drawn_joint_values(state)
        close, self.is_close = self.is_close, False
        aspect = self._aspect_built_for = self._aspect()
        view = self._choose_viewpoint(state, aspect, close=close)
        view = self._viewpoint = view.seen_from(given) if given else view
        camera = given or view.camera(aspect)
        self._first_camera, self._arrived = camera, False
        self._awaits_grasp = close and not given
        with client.atomic():
            client.camera.fov = FIELD_OF_VIEW
            client.camera.up_direction = (0.0, 0.0, 1.0)
            self._look_from(camera)
        client.scene.add_frame(root, show_axes=False)
        add_lights(client, root, view)
        self._dark = state.display.dark
        add_floor(client, f"{root}/floor", scene, dark=state.display.dark)
        visuals = state.assets.visuals
        for k, obstacle in enumerate(scene.obstacles):
            add_obstacle(client, f"{root}/obstacle{k}", obstacle, k, visuals)
        self._build_object(state)
        self.robots = {
            name: RobotView(client, f"{root}/robot{k}", robot, values[name], visuals)
            for k, (name, robot) in enumerate(scene.robots.items())
        }
        self._glide, self._picked = Glide(values), state.pick
        self.tool_path = ToolPath(client, root)
        self.survey = SurveyView(client, f"{root}/survey", self.on_place, self.on_stand)
        self.base_gizmo = client.scene.add_transform_controls(
            f"{root}/base_gizmo", scale=0.3, line_width=3.0, depth_test=False, visible=False
        )

        @self.base_gizmo.on_update
        async def _(event: viser.TransformControlsEvent) -> None:  # at once, while the pose is this event's
            self.on_base_drag(from_position_quat(event.target.position, event.target.wxyz))

    def _move_robots(self, state: State) -> None:
        """Put the robots where they stand now."""
        for name, robot in state.scene.robots.items():
            set_pose(self.robots[name].base, robot.T_world_base)
        add_floor(self.client, f"{self._root}/floor", state.scene, dark=state.display.dark)
        self._ghosts += 1
        self.client.scene.remove_by_name(self.ghost.root)
        self.ghost = GhostView(self.client, f"{self._object_root}/ghost{self._ghosts}", state.scene)
        self._scene = state.scene

    def _build_object(self, state: State) -> None:
        """Replace the nodes of the object, its map and the ghost."""
        root = self._object_root = self._replace(self._object_root, f"{self._root}/object")
        self.client.scene.add_frame(root, show_axes=False)
        self.object = ObjectView(self.client, root, state.scene, self.on_surface, self.on_drag)
        self.ghost = GhostView(self.client, f"{root}/ghost", state.scene)
        self.flat_map = FlatMap(self.client, f"{root}/flat_map", state, self._viewpoint, self.on_flat_map)
        self._scene = state.scene

    def _follow(self, state: State) -> None:
        """Move the camera where what is shown of a plan has changed and would be out of view or hidden."""
        before, self._followed = self._followed, _shown_of_plan(state)
        if state.shown_task is None or self._followed == before:
            return
        camera = self.client.camera
        now = tuple(float(v) for v in (*camera.position, *camera.look_at))
        aspect = camera.image_width / max(camera.image_height, 1)
        flat_map = self.flat_map if state.display.flat_map else None
        if self._followed[:-1] == before[:-1]:  # it is being played: to be turned around would confuse
            after = followed(now, with_flat_map(points_to_follow(state), flat_map, now), aspect)
        else:
            after = unhidden(now, state, aspect, flat_map)
        if after != now:
            self._look_from(after)

    def _choose_viewpoint(self, state: State, aspect: float, *, close: bool) -> Viewpoint:
        return choose_viewpoint(
            state.scene, state.T_world_object, drawn_joint_values(state), aspect,
            close=close, flat_map=state.display.flat_map,
        )  # fmt: skip

    def _look_from(self, camera: Camera) -> None:
        self.client.camera.position, self.client.camera.look_at = np.array(camera[:3]), np.array(camera[3:])

    def _replace(self, old: str, new: str) -> str:
        """Remove a node and return an unused path for its successor: browsers keep the pose of a path."""
        if old:
            self.client.scene.remove_by_name(old)
        self._builds += 1
        return f"{new}{self._builds}"

    def _aspect(self) -> float:
        """Return the ratio of width to height of the 3D view."""
        camera = self.client.camera
        width, height = self._first_size or (camera.image_width, camera.image_height)
        self._first_size = None
        return width / max(height, 1)


def _shown_of_plan(state: State) -> tuple[object, ...]:
    """Return what differs where something else of a plan is shown."""
    return state.scene, state.step, state.plan, state.plan_results.position


def _same_bodies(a: Scene, b: Scene) -> bool:
    """Return whether two scenes have the same robots and obstacles, wherever the robots stand."""
    models = [[(name, robot.model) for name, robot in scene.robots.items()] for scene in (a, b)]
    homes = zip(a.robots.values(), b.robots.values(), strict=False)
    return (
        models[0] == models[1]
        and a.obstacles is b.obstacles
        and all(one.home is other.home for one, other in homes)
    )
