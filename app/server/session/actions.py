"""The actions of one browser besides those about plans: scenes, objects, hands, files, links."""

from __future__ import annotations

import re
from collections.abc import Callable

import viser

from symgrasp.errors import InputError, SymgraspError
from symgrasp.progress import Progress
from symgrasp.scene.scene import Scene

from ...choices.object_choice import OWN, ObjectChoice, check_size, from_library
from ...choices.robot_arms import IN_URDF, hand_option, tool_link
from ...choices.robot_choice import OWN_ROBOT, UploadedRobot, catalogue_robot
from ...choices.scene_assets import BuiltScene, UploadFolder
from ...compute.cache import SharedCache
from ...compute.compute_process import ComputeProcess
from ...files.links import Link
from ...files.scene_files import MAX_NAME, scene_archive, scene_yaml
from ...render.map_picture import map_picture, picture_name
from ...state import changes, job_changes, robot_changes
from ...state.page_link import Camera
from ...state.state import State
from ..door.browser_messages import UploadButton
from ..door.viser_server import end_upload
from ..snapshot import snapshot_html
from .plan_actions import PlanActions
from .session_api import SessionApi
from .survey_actions import SurveyActions

__all__ = ["Actions", "camera_of"]

SceneWithObject = tuple[Scene, ObjectChoice | None]


class Actions:
    """The actions of one browser; see `app.panels.actions.Actions`.

    Args:
        session: the browser's session.
        client: the browser.
        cache: what all sessions share.
        process: computes for this session.
        surveys: the actions about surveys.
        address: that the page was opened at, without the query.
        upload_buttons: uuid → a button that takes files; they are added here.
    """

    def __init__(
        self,
        session: SessionApi,
        client: viser.ClientHandle,
        cache: SharedCache,
        process: ComputeProcess,
        surveys: SurveyActions,
        address: str,
        upload_buttons: dict[str, UploadButton],
    ) -> None:
        self._session, self._client, self._cache = session, client, cache
        self._process, self._address, self._upload_buttons = process, address, upload_buttons
        self.plans, self.surveys = PlanActions(session, process, cache), surveys
        self.change = session.change
        self._refused_mesh: tuple[str, bytes] | None = None

    # -- scene, object, hand ----------------------------------------------------------------

    def open_scene(self, name: str) -> None:
        """Open a scene by its name in the menu, which may be that of the uploaded one."""
        state = self._session.state
        uploaded = state.uploaded_scene if state else None
        if uploaded and uploaded.option == name:
            self.change(lambda state: changes.open_upload(state, uploaded))
            return
        self._session.submit(
            f"Loading {name}",
            lambda progress: self._cache.scene(name, progress),
            lambda state, scene: changes.open_scene(state, scene, name),
        )

    def upload_scene(self, name: str, content: bytes) -> None:
        """Open the scene in an uploaded file; or the plan, if it is one."""
        self.plans.open_file(name, content, "scene")

    def choose_object(self, option: str) -> None:
        """Replace the scene's object by an option of the menu."""
        if state := self._session.state:
            self._change_object(f"Loading {option}", lambda _: self._with_option(state, option))

    def upload_object(self, name: str, content: bytes, scale: float, tolerance: float | None) -> None:
        """Measure an uploaded mesh and put the object into the scene, see `app.panels.actions.Actions`."""
        state = self._session.state
        if state is None:
            return
        try:
            check_size(name, content)
        except SymgraspError as error:
            self._fail(error)
            return
        self._refused_mesh = name, content

        def run(progress: Progress) -> SceneWithObject:
            measured = self._process.measure(name, content, scale, tolerance, progress)
            self._refused_mesh = None
            return _with_object(state, measured)

        self._change_object(f"Measuring {name}", run)

    def measure_again(self, scale: float, tolerance: float | None) -> None:
        """Measure the mesh that was refused last in another way, see `app.panels.actions.Actions`."""
        if self._refused_mesh:
            self.upload_object(*self._refused_mesh, scale, tolerance)

    def choose_robot(self, option: str) -> None:
        """Replace the robot of the chosen arm by an option of the menu."""
        state = self._session.state
        if state is None:
            return
        name, uploaded = state.robot.name, state.uploaded_robot

        def run(progress: Progress) -> BuiltScene:
            opened = self._as_opened(state)
            if uploaded and option == uploaded.option:
                other = uploaded.entry
            elif option == OWN_ROBOT:
                other = opened.file.robots[list(state.scene.robots).index(name)]
            else:
                other = catalogue_robot(option)
            return self._process.put_robot(state.scene, name, other, opened, progress)

        again = uploaded if uploaded and option == uploaded.option else None
        self._session.submit(
            f"Loading {option}",
            run,
            lambda state, built: robot_changes.put_robot(state, built, name, option, again),
        )

    def upload_robot(self, name: str, content: bytes) -> None:
        """Put the robot in an uploaded archive in the place of that of the chosen arm."""
        state = self._session.state
        if state is None:
            return
        robot = state.robot.name

        def run(progress: Progress) -> tuple[BuiltScene, UploadedRobot]:
            folder = UploadFolder()
            option = f"{name[:MAX_NAME]} (upload)"
            entry, built = self._process.read_robot(
                state.scene, robot, name, content, folder.path, self._as_opened(state), progress
            )
            return built, UploadedRobot(option, entry, folder)

        def show(state: State, result: tuple[BuiltScene, UploadedRobot]) -> State:
            built, uploaded = result
            return robot_changes.put_robot(state, built, robot, uploaded.option, uploaded)

        self._session.submit(f"Opening {name}", run, show)

    def choose_tool(self, link: str) -> None:
        """Put the hand of the chosen arm on another link."""
        if state := self._session.state:
            self._rearm(state, link, hand_option(state.scene, state.arm))

    def choose_hand(self, option: str) -> None:
        """Hold with another hand on the chosen arm."""
        state = self._session.state
        if state is None:
            return
        scene, arm = state.scene, state.arm
        if option == IN_URDF or arm not in scene.replaceable_hands:
            self._rearm(state, tool_link(scene, arm), option)
            return
        self._session.submit(
            f"Mounting {option}",
            lambda progress: self._process.mount(scene, arm, option, progress),
            robot_changes.hand_changed,
        )

    def _rearm(self, state: State, link: str, option: str) -> None:
        """Hold with a hand on a link of the chosen arm."""
        scene, arm = state.scene, state.arm
        hand = None if option == IN_URDF else option
        self._session.submit(
            f"Mounting {option} on {link}" if hand else f"Measuring the hand on {link}",
            lambda progress: self._process.rearm(scene, arm, link, hand, progress),
            lambda state, built: robot_changes.rearmed(state, built, arm),
        )

    def _change_object(self, label: str, run: Callable[[Progress], SceneWithObject]) -> None:
        self._session.submit(label, run, lambda state, result: changes.choose_object(state, *result))

    def _with_option(self, state: State, option: str) -> SceneWithObject:
        """Return the scene with its own object, the uploaded one, or one of the library."""
        if option == OWN:
            opened = self._as_opened(state)
            return state.scene.with_object(opened.file.object.name, opened.profile), None
        uploaded = state.uploaded_object
        if uploaded and option == uploaded.option:
            return _with_object(state, uploaded)
        shared = None if state.shown_upload else self._cache.scene_with(state.scene_name, option)[1]
        return _with_object(state, shared or from_library(option))

    def _as_opened(self, state: State) -> Scene:
        """Return the scene as it was opened, with its own object, hands and tasks."""
        return state.shown_upload or self._cache.scene(state.scene_name)

    # -- computing --------------------------------------------------------------------------

    def stop_or_retry(self) -> None:
        """Cancel the computation under way, or restart the one that was cancelled or failed."""

        def stop_or_retry(state: State) -> State:
            if state.busy:
                return job_changes.stopped(state, state.busy.job_id)
            return job_changes.retried(state)

        self.change(stop_or_retry)

    # -- files ------------------------------------------------------------------------------

    def limit_uploads(self, button: viser.GuiUploadButtonHandle, limit: int) -> None:
        """Let a button take files of a size (bytes); a larger one is refused when it is announced."""
        uuid = button._impl.uuid

        def refuse(name: str, size: int, transfer: str) -> None:
            end_upload(self._client, uuid, transfer)
            limits = f"{size / 1e6:.1f} MB", f"a file of at most {limit / 1e6:g} MB"
            self._fail(InputError(name, "size of the file", *limits))

        self._upload_buttons[uuid] = UploadButton(limit, refuse)

    def save_map(self, kind: str) -> None:
        """Send the map that is shown as a picture, in a format of `app.render.map_picture.FORMATS`."""
        self._session.attempt(
            lambda state: self._session.send(picture_name(state, kind), map_picture(state, kind))
        )

    def save_scene(self) -> None:
        """Send the scene as it is now as a YAML file; in an archive where robots were uploaded."""

        def save(state: State) -> None:
            scene = state.moved_scene()
            if folders := [folder.path for folder in state.assets.folders]:
                inner = _file_name(scene.name, ".yaml")
                self._session.send(_file_name(scene.name, ".zip"), scene_archive(scene, inner, folders))
            else:
                self._session.send(_file_name(scene.name, ".yaml"), scene_yaml(scene).encode())

        self._session.attempt(save)

    def make_link(self) -> None:
        """Make a link that opens the page as it is."""

        def make(state: State) -> State:
            camera = camera_of(self._client)
            link = Link.of(state, self._as_opened(state), camera)
            return changes.linked(state, f"{self._address}?{link.query()}", camera)

        self.change(make)

    def save_3d_view(self) -> None:
        """Send the 3D view to the browser as an HTML file."""
        state = self._session.state
        if state is None:
            return
        camera, fov = camera_of(self._client), self._client.camera.fov

        def run(progress: Progress) -> None:
            html = snapshot_html(state, camera, fov)
            progress(1.0)  # a cancelled view is not sent
            self._session.send(_file_name(state.scene.name, ".html"), html.encode())

        self._session.submit("Drawing the 3D view", run, lambda state, _: state)

    def _fail(self, error: SymgraspError) -> None:
        problem = str(error)
        self.change(lambda state: job_changes.failed(state, problem))


def camera_of(client: viser.ClientHandle) -> Camera:
    """Return the position of a browser's camera and the point it looks at."""
    camera = client.camera
    return tuple(float(v) for v in (*camera.position, *camera.look_at))


def _with_object(state: State, choice: ObjectChoice) -> SceneWithObject:
    """Return the scene with an object in place of its own."""
    return state.scene.with_object(choice.name, choice.profile), choice


def _file_name(name: str, ending: str) -> str:
    return re.sub(r"\W+", "_", name) + ending
