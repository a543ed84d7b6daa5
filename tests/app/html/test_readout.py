"""What the page says about maps, picks and plans."""

# A map, a pick or a plan may be None in general, but not where these tests look.
# pyright: reportOptionalMemberAccess=false, reportArgumentType=false

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from app.html.readout import comparison_html, grasp_html, notes_html, solution_html, status_html
from app.state import changes, job_changes
from app.state.plans import plan_changes
from app.state.requests import CompareRequest, Comparison, MapResult
from app.state.state import State
from symgrasp.feasibility.create import create_map
from symgrasp.scene.scene import Scene
from tests.app.state.states import opened, with_plan
from tests.conftest import load_small, write_scene

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
    shown = [f(state) for f in (status_html, notes_html, solution_html)]
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
    assert "Rests on" not in held
    assert "Rests on 6 redundancy samples." in grasp_html(missed)
    assert "waits for the map" in grasp_html(changes.moved(missed, x=0.5))
    assert "No grasp picked" in grasp_html(state)


def test_the_readout_says_what_it_rests_on_that_a_cell_is_infeasible():
    """Of a map for which all of the redundancy was searched: a proof, or a search to so many radians."""
    state = changes.choose_cell(opened(), 3, 4)
    proven = np.zeros_like(state.map.proven)
    proven[state.cell] = True
    for found, expected in (
        (replace(state.map, resolution=1e-4), "a search of the redundancy to 1e-04 rad"),
        (replace(state.map, resolution=1e-4, proven=proven), "a proof"),
    ):
        shown = job_changes.map_arrived(state, 0, MapResult(state.request, found, ()))
        assert not shown.map.feasible[shown.cell]
        assert f"Rests on {expected}." in grasp_html(shown)


def test_the_hint_follows_what_is_shown():
    state = opened("pick_pour_place")
    picked = changes.choose_cell(state, 4, 12)
    planned = with_plan("pick_pour_place", "sequential")
    together = with_plan("log_two_robots", "bimanual")
    climbing = plan_changes.show_frame(with_plan("log_two_robots", "bimanual", "hill_climb"), 0)
    hints = [status_html(shown) for shown in (state, picked, planned, together, climbing)]
    words = ["click a green cell", "Click another cell", "common cells", "the gap", "hill climbing"]
    for k, hint in enumerate(hints):
        assert [word in hint for word in words] == [k == at for at in range(len(words))]
    assert status_html(changes.clear_pick(planned)) == hints[0]


def test_a_comparison_counts_every_roll_and_says_so():
    state = changes.turn(opened(), 0.3)
    request = CompareRequest(state.request, 0.3)
    state = replace(
        state,
        map_view=replace(state.map_view, comparison=Comparison(request, state.base_map.shift(0.3), 0)),
    )
    html = comparison_html(state)
    rolls, heights, angles = state.base_map.reason.shape
    assert f"0 of {rolls * heights * angles} cells differ</b>: {heights * angles} places with 2 rolls" in html


def test_what_is_computed_but_not_drawn_yet_is_not_left_at_its_last_percent():
    busy = job_changes.started(opened(), 1, "Planning")
    assert "Planning … 99 %" in status_html(job_changes.progressed(busy, 1, 0.99, late=True))
    assert "Planning … done, to be shown" in status_html(job_changes.progressed(busy, 1, 1.0, late=True))


def test_the_joints_of_a_plan_are_read_out_as_the_plan_has_them():
    state = with_plan("log_two_robots", "bimanual")
    for hold in state.shown_task.holds:
        joints = ", ".join(f"{round(math.degrees(q)) + 0:d}°" for q in hold.joints.values())
        assert f"Joints {joints};" in grasp_html(changes.choose_arm(state, hold.arm))


def test_the_plan_is_summed_up():
    assert solution_html(with_plan("pick_pour_place", "sequential")).count("One grasp for 3 tasks: h = ") == 1
    assert "2 arms hold the object together in lift" in solution_html(with_plan("log_two_robots", "bimanual"))


def test_a_computation_that_waits_for_others_says_so_until_it_goes_on():
    state = job_changes.started(State.of(load_small("soda_can"), ""), 7, "Computing the map")
    late = job_changes.progressed(state, 7, 0.2, late=True)
    waiting = job_changes.waiting(late, 7)
    assert "Computing the map … 20 %" in status_html(late)
    assert "Computing the map … when other browsers have had their turn" in status_html(waiting)
    assert job_changes.waiting(late, 8) == late  # of another job
    assert "Computing the map … 30 %" in status_html(job_changes.progressed(waiting, 7, 0.3))
