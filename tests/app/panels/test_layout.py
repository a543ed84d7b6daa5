"""Starting the page, and which of its modules need a browser."""

# A map, a pick or a plan may be None in general, but not where these tests look.
# pyright: reportOptionalMemberAccess=false, reportArgumentType=false

from __future__ import annotations

import math
import socket
import subprocess
import sys

import pytest

from app.html.readout import grasp_html, notes_html, solution_html, status_html, title_html
from app.server.serve import serve
from app.state import changes, job_changes
from app.state.requests import MapResult
from app.state.state import State
from symgrasp.errors import InputError
from symgrasp.feasibility.create import create_map
from symgrasp.scene.scene import Scene
from tests.app.state.test_state import opened, with_plan
from tests.conftest import load_small, write_scene


def test_state_and_computing_know_no_browser():
    pure = "app.state.state, app.compute.process_main, app.html.map, app.render.map_picture"
    code = f"import sys, {pure}; sys.exit('viser' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_a_busy_port_is_an_error_that_names_it():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(InputError, match=f"--port: {port}: expected a free port"):
            serve("bottle_on_table", "127.0.0.1", port)


@pytest.mark.parametrize("port", [0, -1, 65536])
def test_a_port_that_is_none_is_an_error(port):
    with pytest.raises(InputError, match="a port from 1 to 65535"):
        serve("bottle_on_table", "127.0.0.1", port)


def test_an_unknown_host_is_an_error():
    with pytest.raises(InputError, match="--host"):
        serve("bottle_on_table", "no.such.host.invalid", 8080)


def test_an_unknown_scene_ends_the_command_with_one_line():
    done = subprocess.run(
        [sys.executable, "-m", "app", "no_scene", "--port", "8099"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert "no_scene" in line
    assert "bottle_on_table" in line


HOSTILE = "<script>alert(1)</script>"


def test_names_from_files_are_escaped_everywhere(content, tmp_path):
    content["name"] = content["object"]["name"] = HOSTILE
    content["tasks"][0]["name"] = HOSTILE + "task"
    content["robots"][0]["name"] = HOSTILE + "robot"
    scene = Scene.load(write_scene(tmp_path, content)).with_settings(heights=4, angles=8, redundancy=2)
    state = State.of(scene, HOSTILE)
    state = job_changes.failed(
        job_changes.map_arrived(state, 0, MapResult(state.request, create_map(scene), (HOSTILE,))), HOSTILE
    )
    shown = [f(state) for f in (title_html, status_html, notes_html, solution_html)]
    shown += [grasp_html(changes.choose_cell(state, i, j)) for i in range(4) for j in range(8)]
    shown.append(status_html(job_changes.started(state, 1, HOSTILE)))
    assert not any("<script" in text for text in shown)
    assert sum("&lt;script" in text for text in shown) >= 4


def test_the_readout_says_how_and_why_not():
    state = opened()
    cells = {bool(state.map.feasible[:, i, j].any()): (i, j) for i, j in [(3, 15), (3, 8), (3, 0), (3, 4)]}
    assert set(cells) == {True, False}
    held = grasp_html(changes.choose_cell(state, *cells[True]))
    assert "panda holds it: feasible" in held
    assert "Joints" in held
    missed = changes.choose_cell(state, *cells[False])
    assert "panda cannot hold it here: " + missed.map.why(missed.cell) in grasp_html(missed)
    assert "waits for the map" in grasp_html(changes.moved(missed, x=0.5))
    assert "No grasp picked" in grasp_html(state)


def test_the_joints_of_a_plan_are_read_out_as_the_plan_has_them():
    state = with_plan("log_two_robots", "bimanual")
    for hold in state.shown_task.holds:
        joints = ", ".join(f"{round(math.degrees(q)) + 0:d}°" for q in hold.joints.values())
        assert f"Joints {joints};" in grasp_html(changes.choose_arm(state, hold.arm))


def test_the_plan_is_summed_up():
    assert solution_html(with_plan("pick_pour_place", "sequential")).count("One grasp for 3 tasks: h = ") == 1
    assert "2 arms hold the object together in lift" in solution_html(with_plan("log_two_robots", "bimanual"))
    assert load_small("bottle_on_table").name in title_html(opened())
    assert "of an earlier pose" in title_html(changes.moved(opened(), x=0.5))
