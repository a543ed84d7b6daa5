"""What pages show comes back on another server, from files; damaged ones are refused in a line."""

from __future__ import annotations

import json
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.choices.robot_choice import UploadedRobot
from app.choices.scene_assets import UploadFolder
from app.choices.uploaded_scene import UploadedScene
from app.compute.cache import SharedCache
from app.compute.upload_service import UploadService
from app.compute.warm_up import compute_first_map
from app.files.scene_files import read_scene
from app.files.stored_page import StoredPage, scene_file
from app.server.door.lobby import open_lobby
from app.server.door.viser_server import any_port
from app.server.kept_pages import stored_pages
from app.server.kept_pages.left_pages import LeftPage
from app.server.kept_pages.stored_pages import StoredPages
from app.state import changes, robot_changes
from app.state.state import State
from symgrasp.errors import InputError
from symgrasp.scene.scene import Scene
from tests.app.robot_archives import panda_archive
from tests.app.server.kept_pages.test_left_pages import change, expect
from tests.app.server.session.served import ready
from tests.app.wire import Wire

pytestmark = pytest.mark.filterwarnings("ignore:Queued a .* on a closed connection")


@contextmanager
def serve(folder: Path, scene: str = "bottle_on_table") -> Iterator[int]:
    cache = SharedCache(scene)
    compute_first_map(cache)
    port = any_port()
    with open_lobby(cache, "127.0.0.1", port, folder=folder):
        yield port


def state_of(name: str = "pick_pour_place") -> State:
    """A state that differs from the first one in all that is stored, but plans and uploads."""
    scene = Scene.load(name)
    state = State.of(scene, name)
    state = changes.choose_task(state, "pour")
    state = changes.moved(state, x=0.51, lean=0.3)
    state = changes.turn(state, 0.7)
    state = changes.choose(state, 0.1, -1.2)
    return changes.switched(state, dark=True, flat_map=False)


def stored(state: State) -> tuple[StoredPage, bytes]:
    scene = scene_file(state)
    page = StoredPage.of(state, (1.0, 2.0, 3.0, 0.0, 0.0, 0.5), scene, None)
    return StoredPage.parse(page.model_dump_json().encode(), scene), scene


def as_upload(state: State) -> UploadedScene:
    return read_scene("scene.yaml", scene_file(state), [])


def test_a_page_comes_back_on_another_server(tmp_path):
    with serve(tmp_path) as port, Wire(port) as first:
        shown = change(first)
    with serve(tmp_path) as port:
        with Wire(port, token=first.token) as same:  # the page is still open
            expect(same, 40.0, 57.0, shown)
        with Wire(port, before=first.token) as again:  # or it is loaded again
            expect(again, 40.0, 57.0, shown)


def test_a_damaged_file_is_told_in_a_line_and_the_page_begins_anew(tmp_path):
    with serve(tmp_path) as port, Wire(port) as first:
        change(first)
    (settings,) = tmp_path.glob("*.json")
    settings.write_bytes(settings.read_bytes()[:100])
    with serve(tmp_path) as port, Wire(port, before=first.token) as again:
        again.wait_for(lambda html: ready(html) and "what this page showed: file:" in html)
        expect(again, 0.0, 55.0)


def test_what_is_stored_is_what_is_read():
    state = state_of()
    page, _ = stored(state)
    uploaded = as_upload(state)
    read = page.applied(uploaded, ["pick_pour_place"])
    assert page.camera == (1.0, 2.0, 3.0, 0.0, 0.0, 0.5)
    assert (read.scene_name, read.task, read.arm, read.delta) == ("pick_pour_place", "pour", state.arm, 0.7)
    assert read.poses == state.poses
    assert read.pick == state.pick
    assert read.display == state.display
    assert read.uploaded_scene is None
    assert np.array_equal(read.T_world_object, state.T_world_object)
    assert read.request == state.request  # the map is not computed anew
    elsewhere = page.applied(uploaded, ["another"])
    assert elsewhere.uploaded_scene is not None
    assert elsewhere.shown_upload is uploaded.scene


@pytest.mark.parametrize(
    ("field", "value", "named"),
    [
        ("version", 2, "version"),
        ("delta", "x", "delta"),
        ("poses", {"pour": [1, 2]}, "poses.pour.2"),
        ("scene_sha256", "0" * 64, "scene"),
        ("task", "unknown", "tasks"),
        ("arm", "unknown", "arm"),
        ("poses", {"unknown": [0, 0, 0, 0, 0, 0]}, "tasks"),
        ("foreign", 1, "foreign"),
    ],
)
def test_damaged_settings_are_refused(field, value, named):
    state = state_of()
    page, scene = stored(state)
    content = page.model_dump(mode="json") | {field: value}
    with pytest.raises(InputError) as raised:
        StoredPage.parse(json.dumps(content).encode(), scene).applied(as_upload(state), [])
    assert raised.value.field == named
    assert "\n" not in str(raised.value)


def test_files_are_private_and_bounded(tmp_path, monkeypatch):
    monkeypatch.setattr(stored_pages, "MOST", 3)
    folder, state = tmp_path / "pages", state_of()
    shown = {f"page {k}": LeftPage(replace(state, delta=0.1 * k)) for k in range(5)}
    pages = StoredPages(folder, lambda: shown)
    pages.close()
    assert len(list(folder.iterdir())) == 6
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert not any("page" in path.name for path in folder.iterdir())
    assert pages.find("page 0") is None
    found = pages.find("page 4")
    assert found
    assert StoredPage.parse(found.settings, found.scene).delta == pytest.approx(0.4)


def test_an_uploaded_robot_is_stored_with_its_files(tmp_path):
    """As in the process of a session; the folder of the first upload is gone when it is read."""
    bottle = Scene.load("bottle_on_table")
    service = UploadService(())
    folder = UploadFolder()
    entry, built = service.read_robot(
        bottle, "panda", "p.zip", panda_archive(), folder.path, bottle, lambda _: None
    )
    robot = UploadedRobot("p.zip (upload)", entry, folder)
    state = robot_changes.put_robot(State.of(bottle, "bottle_on_table"), built, "panda", robot.option, robot)
    page, scene = stored(state)
    folder.path.rename(tmp_path / "gone")
    again = UploadFolder()
    uploaded = service.read_scene("scene.zip", scene, again.path, lambda _: None)
    uploaded = replace(uploaded, assets=replace(uploaded.assets, folders=(again,)))
    read = page.applied(uploaded, ["bottle_on_table"])
    assert read.robot_option == "p.zip (upload)"
    assert read.uploaded_robot
    assert Path(read.uploaded_robot.entry.urdf).is_relative_to(again.path.resolve())
    assert read.assets.folders == (again,)
    assert read.scene.arm().joint_names == bottle.arm().joint_names
