"""Files that a browser uploads are parsed in its own process only, and harm neither session nor server."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from queue import Queue
from typing import Any

import pytest
import trimesh
import yaml

from app.choices import object_choice
from app.compute import map_service, process_pool
from app.compute.cache import SharedCache
from app.files import scene_files
from app.files.plan_formats import plan_file
from app.scene3d.visual_meshes import read_visuals
from app.server.door import lobby
from app.server.session.actions import Actions
from app.server.session.session import Session
from symgrasp.object.measure import measurement
from symgrasp.plan.plan import Plan
from symgrasp.robot.model import RobotModel
from symgrasp.scene.scene import Scene
from tests.app import failures
from tests.app.choices.test_object_choice import stl
from tests.app.robot_archives import plan_of_upload
from tests.app.server.session.served import Server, ready, start_server, title
from tests.app.state.states import planned
from tests.app.wire import WAIT, Wire
from tests.hostile import chain_urdf, doubling_yaml

pytestmark = pytest.mark.filterwarnings("ignore:Queued a .* on a closed connection")


@pytest.fixture
def server(monkeypatch) -> Iterator[Server]:
    monkeypatch.setattr(process_pool, "serve", failures.serve_parsers)
    with start_server() as server:
        yield server


@pytest.fixture
def visitor(server, sessions) -> Iterator[Wire]:
    with server.visit() as visitor:
        visitor.wait_for(ready)
        yield visitor


@pytest.fixture
def sessions(monkeypatch) -> list[Session]:
    """The sessions that are opened, in order."""
    opened: list[Session] = []

    def recorded(*arguments: Any) -> Session:
        opened.append(Session(*arguments))
        return opened[-1]

    monkeypatch.setattr(lobby, "Session", recorded)
    return opened


@pytest.fixture
def actions(sessions, visitor) -> Actions:
    """What the visitor's widgets ask for."""
    return sessions[-1].actions


def shows(visitor: Wire, value: str) -> bool:
    """Return whether a widget has that value."""
    return any(widget.get("value") == value for widget in visitor.widgets.values())


def forbidden(*_: object, **__: object) -> None:
    raise AssertionError("parsed in the server")


@pytest.fixture
def plan_archive(tmp_path) -> bytes:
    """A plan with the files of its robot."""
    (tmp_path / "robot").mkdir()
    return plan_file(plan_of_upload(tmp_path / "robot"), "JSON", [tmp_path / "robot"])[1]


@pytest.fixture
def no_parsers(plan_archive, monkeypatch) -> None:
    """Every parser of files breaks in this process; those that a session starts have their own."""
    planned("pick_pour_place", "sequential")  # it is kept
    read_visuals(Scene.load("pick_pour_place"))  # meshes that ship may be read for the 3D view
    monkeypatch.setattr(Scene, "from_content", forbidden)
    monkeypatch.setattr(scene_files, "read_scene", forbidden)
    monkeypatch.setattr(RobotModel, "__init__", forbidden)
    monkeypatch.setattr(object_choice, "measure_mesh", forbidden)
    monkeypatch.setattr(measurement, "measure_mesh", forbidden)
    monkeypatch.setattr(map_service, "open_world", forbidden)
    monkeypatch.setattr(Plan, "parse", forbidden)
    monkeypatch.setattr(ET, "iterparse", forbidden)
    for module, name in ((yaml, "load"), (yaml, "parse"), (trimesh, "load_scene")):
        monkeypatch.setattr(module, name, forbidden)


def test_the_server_parses_no_upload_itself(
    visitor, sessions, actions, content, plan_archive, no_parsers, monkeypatch
):
    content["name"] = "the uploaded one"
    actions.upload_scene("mine.yaml", yaml.safe_dump(content).encode())
    visitor.wait_for(lambda html: "the uploaded one" in title(html) and ready(html))
    actions.upload_object("can.stl", stl(), 1.0, None)
    visitor.wait_for(lambda html: shows(visitor, "can.stl (upload)") and ready(html))
    found = planned("pick_pour_place", "sequential").plan
    assert found
    actions.plans.open_file("plan.json", found.plan.to_json().encode())
    visitor.wait_for(lambda html: "plan.json" in html and "pick_pour_place" in title(html) and ready(html))
    actions.plans.open_file("plan.zip", plan_archive)
    visitor.wait_for(lambda html: "plan.zip" in html and "bottle_on_table" in title(html) and ready(html))
    sent: Queue[tuple[str, bytes]] = Queue()
    monkeypatch.setattr(sessions[-1], "send", lambda *file: sent.put(file))
    for form, name in {
        "TSR": "bottle_on_table_sequential.tsr.yaml",
        "JSON": "bottle_on_table_sequential.zip",
    }.items():
        actions.plans.download(form)
        assert sent.get(timeout=WAIT)[0] == name
        visitor.wait_for(ready)


@pytest.mark.parametrize(
    ("name", "text", "limit"),
    [
        ("mine.yaml", doubling_yaml(12), "more than 100,000 values"),
        ("mine.yaml", "[" * 900_000, "a YAML document"),
        ("mine.yaml", "map: {heights: 1024, angles: 1024, redundancy: 1024}", "at most 10,000,000"),
        ("plan.json", "[" * 1_000_000, "a readable JSON file"),
    ],
    ids=lambda value: value[:20],
)
def test_a_hostile_file_is_one_line_and_the_session_goes_on(visitor, actions, content, name, text, limit):
    if text.startswith("map"):
        text = yaml.safe_dump({**content, **yaml.safe_load(text)})
    upload = actions.plans.open_file if name.endswith("json") else actions.upload_scene
    upload(name, text.encode())
    assert name in visitor.wait_for(limit)
    visitor.set("x (cm)", 52.0)
    visitor.wait_for(lambda html: limit not in html and ready(html))


@pytest.mark.parametrize("name", ["eats", "aborts"])
def test_a_mesh_that_ends_its_parser_leaves_the_session_as_it_was(visitor, actions, name):
    actions.upload_object(name, b"", 1.0, None)
    html = visitor.wait_for("more memory than a session may use (4 GB)")
    assert "what you set is kept" in html
    actions.upload_object("can.stl", stl(), 1.0, None)
    visitor.wait_for(lambda html: shows(visitor, "can.stl (upload)") and ready(html))


def test_no_message_shows_where_the_server_has_its_files(content, tmp_path, sessions):
    (tmp_path / "chain.urdf").write_text(chain_urdf(5001))
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump(content))
    with start_server(str(tmp_path / "mine.yaml")) as server, server.visit() as visitor:
        visitor.wait_for(ready)
        (session,) = sessions
        content["robots"][0]["urdf"] = "chain.urdf"
        session.actions.upload_scene("other.yaml", yaml.safe_dump(content).encode())
        html = visitor.wait_for("at most 5,000 of them")
        assert "chain.urdf: links" in html
        assert str(tmp_path) not in html
        content["robots"][0]["urdf"] = "no.urdf"
        session.actions.upload_scene("other.yaml", yaml.safe_dump(content).encode())
        html = visitor.wait_for("no.urdf")
        assert str(tmp_path) not in html


def test_an_opened_plan_takes_the_maps_that_the_server_has(server, sessions, visitor, actions, monkeypatch):
    results = planned("pick_pour_place", "sequential")
    assert results.plan
    for result in results.maps.values():
        server.cache.keep(result)
    kept: list[object] = []
    monkeypatch.setattr(SharedCache, "keep", lambda _, result: kept.append(result))
    actions.plans.open_file("plan.json", results.plan.plan.to_json().encode())
    visitor.wait_for(lambda html: "plan.json" in html and "pick_pour_place" in title(html) and ready(html))
    assert kept == []
    state = sessions[-1].state
    assert state
    shown = state.plan_results.maps
    assert {key: result.map for key, result in shown.items()} == {
        key: result.map for key, result in results.maps.items()
    }
