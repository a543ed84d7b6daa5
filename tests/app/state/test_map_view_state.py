"""How the map is looked at: colours, prints, the recomputed map, and the candidates of a cell."""

# A map, a pick or a plan may be None in general, but not where these tests look.
# pyright: reportOptionalMemberAccess=false, reportArgumentType=false

from __future__ import annotations

import io
import re
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from PIL import Image
from trimesh import transform_points

from app.compute.map_service import DRAWS, MapService
from app.html.candidates import candidate_html, candidate_text, candidates_html, reason_grid
from app.html.readout import comparison_html, grasp_html
from app.render.cell_colors import cell_colors
from app.render.drawn_poses import drawn_joint_values
from app.render.map_picture import map_picture, picture_name
from app.render.prints import shown_prints
from app.scene3d.ghost import body_mesh, ghost
from app.state import changes, job_changes
from app.state.map_view_state import NOISE, RollChoice
from app.state.requests import (
    CompareRequest,
    Comparison,
    ExplainRequest,
    ExplainResult,
    Probability,
    ProbabilityRequest,
    Windows,
    WindowsRequest,
)
from app.state.state import State
from symgrasp.errors import SymgraspError
from symgrasp.feasibility.cell import Cell
from symgrasp.feasibility.color_by import ColorBy
from symgrasp.feasibility.create import MapMaker
from symgrasp.poses import rotation_z
from symgrasp.reason import Reason
from symgrasp.survey.success import success_map
from symgrasp.world import BodyName, BulletWorld, Collision, open_world
from tests.app.state.states import opened
from tests.conftest import load_small
from tests.world.link_pose import link_pose


@pytest.fixture(scope="module")
def service():
    service = MapService()
    yield service
    service.close()


def quiet(share: float) -> None:
    """Progress that nobody watches."""


def with_view(state: State, **values: object) -> State:
    return replace(state, map_view=replace(state.map_view, **values))


def cell_with(state: State, reason: Reason) -> tuple[int, int]:
    return tuple(np.argwhere(RollChoice.EITHER.reason(state.map) == reason)[0].tolist())


# -- colours --------------------------------------------------------------------------------


@pytest.mark.parametrize("color_by", ColorBy)
def test_all_that_is_shown_of_a_cell_belongs_to_one_roll(color_by):
    m = opened().map
    reason, values = RollChoice.EITHER.reason(m), RollChoice.EITHER.values(m, color_by)
    for row, column in np.ndindex(*reason.shape):
        roll = RollChoice.EITHER.roll(m, row, column)
        assert m.reason[:, row, column].max() == reason[row, column] == m.reason[roll, row, column]
        assert np.array_equal(m.values(color_by)[roll, row, column], values[row, column], equal_nan=True)
        if reason[row, column] == Reason.FEASIBLE:
            assert m.clearance[roll, row, column] == np.nanmax(m.clearance[:, row, column])


@pytest.mark.parametrize("color_by", ColorBy)
def test_turning_the_object_only_rolls_any_colours(color_by):
    state = with_view(opened(), color_by=color_by)
    grid = state.scene.manifold
    before = cell_colors(state, state.map)
    turned = changes.turn(state, 3 * grid.dtheta)
    assert np.array_equal(cell_colors(turned, turned.map), np.roll(before, -3, axis=1))
    assert np.array_equal(cell_colors(turned, turned.result.map), before)  # the surface stays where it is


def test_the_print_of_the_picked_grasp_lies_around_it():
    state = opened()
    row, column = cell_with(state, Reason.FEASIBLE)
    picked = changes.choose_cell(state, row, column)
    assert shown_prints(picked) == []
    assert shown_prints(with_view(state, handprint=True)) == []
    (cells,) = shown_prints(with_view(picked, handprint=True))
    assert cells[row, column]
    assert 0 < cells.sum() < cells.size / 2
    painted = cell_colors(with_view(picked, handprint=True), picked.map)
    assert np.array_equal((painted != cell_colors(picked, picked.map)).any(axis=-1), cells)


@pytest.mark.parametrize("color_by", [ColorBy.REASON, ColorBy.CLEARANCE])
def test_the_picture_of_the_map_is_a_file(color_by):
    state = with_view(changes.turn(opened(), 0.3), color_by=color_by)
    row, column = cell_with(state, Reason.FEASIBLE)
    state = with_view(changes.choose_cell(state, row, column), handprint=True)
    assert Image.open(io.BytesIO(map_picture(state, "PNG"))).width > 400
    assert ElementTree.fromstring(map_picture(state, "SVG")).tag.endswith("svg")
    assert picture_name(state, "SVG") == f"bottle_on_table_pick_panda_{color_by}.svg"
    with pytest.raises(SymgraspError, match="none for this pose yet"):
        map_picture(changes.moved(state, x=0.5), "PNG")


# -- shifted against recomputed --------------------------------------------------------------


@settings(deadline=None, max_examples=20)
@example(-0.0)
@example(-1e-5)
@given(st.one_of(st.integers(-20, 20).map(lambda k: k * np.pi / 8), st.floats(-4, 4)))
def test_the_recomputed_map_is_the_shifted_one(delta):
    state = changes.turn(with_view(opened(), compare=True), delta)
    assert state.next_request == CompareRequest(state.request, state.delta)
    service = MapService()
    try:
        check = service.compare(state.next_request, state.result.map, quiet)
    finally:
        service.close()
    assert check.differing == 0
    assert np.array_equal(check.map.reason, state.map.reason)
    assert np.array_equal(check.map.manifold.theta, state.map.manifold.theta)
    assert np.allclose(check.map.T_world_object, state.map.T_world_object)
    checked = job_changes.result_arrived(job_changes.started(state, 1, "", state.next_request), 1, check)
    assert checked.next_request is None
    told = re.search(rf"for (\S+)°: <b>0 of {check.map.reason.size} cells differ", comparison_html(checked))
    assert told
    assert told[1] != "-0.00"
    assert abs(float(told[1]) - np.rad2deg(delta)) <= 0.0051


def test_the_comparison_counts_what_differs(service):
    state = changes.turn(with_view(opened(), compare=True), 0.4)
    keep = np.ones(state.map.reason.shape, dtype=bool)
    keep[tuple(np.argwhere(state.result.map.feasible)[0])] = False
    wrong = state.result.map.masked(keep)
    assert service.compare(state.next_request, wrong, quiet).differing == 1


def test_the_comparison_follows_the_slider():
    state = with_view(opened(), compare=True)
    first = job_changes.started(state, 1, "", state.next_request)
    turned = changes.turn(first, 0.5)
    assert turned.next_request is None  # finished first: the slider would interrupt it for ever
    check = CompareRequest(state.request, 0.0)
    arrived = job_changes.result_arrived(turned, 1, compute_nothing(check, state))
    assert arrived.map_view.comparison.request == check
    assert arrived.next_request == CompareRequest(state.request, 0.5)
    moved = changes.moved(first, x=0.5)
    assert moved.next_request == moved.request  # a new map goes first
    late = changes.turn(job_changes.progressed(first, 1, 0.1, late=True), 0.5)
    assert late.next_request == CompareRequest(state.request, 0.5)


def compute_nothing(request: CompareRequest, state: State) -> Comparison:
    return Comparison(request, state.map, 0)


def test_no_comparison_unless_asked_for():
    state = changes.turn(opened(), 0.3)
    assert state.next_request is None
    compared = with_view(state, compare=True)
    got = job_changes.result_arrived(
        job_changes.started(compared, 1, "", compared.next_request),
        1,
        compute_nothing(compared.next_request, state),
    )
    off = replace(got, map_view=got.map_view.with_compare(False))
    assert off.map_view.comparison is None
    assert off.next_request is None


def test_a_stopped_comparison_stays_stopped_until_something_else_is_asked():
    state = with_view(opened(), compare=True)
    stopped = job_changes.stopped(job_changes.started(state, 1, "", state.next_request), 1)
    assert stopped.next_request is None
    assert job_changes.retried(stopped).next_request == CompareRequest(state.request, 0.0)
    assert changes.turn(stopped, 0.1).next_request == CompareRequest(state.request, 0.1)


# -- candidates -----------------------------------------------------------------------------


def explained(service: MapService, state: State) -> State:
    request = state.next_request
    assert isinstance(request, ExplainRequest)
    return job_changes.result_arrived(
        job_changes.started(state, 1, "", request), 1, service.explain(request, quiet)
    )


@pytest.mark.parametrize("delta", [0.0, 0.3, np.pi / 8])
@pytest.mark.parametrize("reason", [Reason.FEASIBLE, Reason.SCENE_COLLISION, Reason.UNREACHABLE])
def test_the_candidates_are_those_of_the_picked_cell(service, reason, delta):
    state = changes.turn(opened(), delta)
    state = explained(service, changes.choose_cell(state, *cell_with(state, reason)))
    assert state.next_request is None
    assert state.explanation.reason == reason == state.map.reason[state.cell]
    tools = state.map.manifold.tool_poses(state.T_world_object, state.scene.arm().hand.finger_depth)
    assert np.allclose(state.explanation.T_world_tool, tools[state.cell], atol=1e-8)
    if reason == Reason.UNREACHABLE:
        assert (state.candidate, state.shown_candidate) == (None, None)
        return
    assert state.shown_candidate.reason == reason
    if reason == Reason.FEASIBLE:  # the arm does not jump when the candidates arrive
        assert np.allclose(state.shown_candidate.q, state.map.witness(state.cell).q)
    else:
        assert state.candidate == 0


def test_the_witness_is_shown_that_only_the_search_of_the_redundancy_found(service):
    scene = load_small("talos_bottle", 6, 12).with_settings(redundancy="auto")
    opened = State.of(scene, "")
    opened = job_changes.map_arrived(opened, 0, service.map(opened.request, quiet))
    searched = np.argwhere(opened.map.feasible & (opened.map.sample > scene.settings.samples))
    assert len(searched)
    for roll, *cell in searched[::4].tolist():
        state = changes.choose_cell(changes.choose_roll(opened, list(RollChoice)[1 + roll]), *cell)
        state = explained(service, state)
        assert np.allclose(state.shown_candidate.q, state.map.witness(state.cell).q, atol=1e-5)


def test_candidates_are_stepped_through_and_forgotten_with_the_cell(service):
    state = opened()
    state = explained(service, changes.choose_cell(state, *cell_with(state, Reason.FEASIBLE)))
    last = len(state.explanation.candidates) - 1
    assert changes.choose_candidate(state, last).shown_candidate is state.explanation.candidates[-1]
    assert changes.choose_candidate(state, last + 5).candidate == last
    assert changes.choose_candidate(state, -1).candidate == 0
    other = changes.choose_cell(
        changes.choose_candidate(state, last), *cell_with(state, Reason.SCENE_COLLISION)
    )
    assert (other.explanation, other.candidate) == (None, None)
    assert changes.moved(state, x=0.5).explanation is None
    assert changes.clear_pick(state).explanation is None
    assert changes.choose_candidate(opened(), 3).candidate is None


def test_an_answer_about_another_cell_does_not_count(service):
    state = opened()
    first = changes.choose_cell(state, *cell_with(state, Reason.FEASIBLE))
    second = changes.choose_cell(
        job_changes.started(first, 1, "", first.next_request), *cell_with(state, Reason.SCENE_COLLISION)
    )
    assert second.next_request == ExplainRequest(state.request, second.base_cell)  # takes its place at once
    answer = ExplainResult(ExplainRequest(state.request, Cell(0, 0, 0)), None)
    assert (
        job_changes.result_arrived(
            job_changes.started(second, 2, "", second.next_request), 1, answer
        ).map_view.explained
        is None
    )
    assert job_changes.result_arrived(second, 1, answer).explanation is None


# -- the ghost arm --------------------------------------------------------------------------


def test_a_failing_candidate_is_a_ghost_and_a_feasible_one_the_arm(service):
    state = opened()
    picked = changes.choose_cell(state, *cell_with(state, Reason.FEASIBLE))
    assert ghost(picked) is None  # nothing is known yet
    held = explained(service, picked)
    arm = state.scene.arm()
    for k, shown_candidate in enumerate(held.explanation.candidates):
        shown = changes.choose_candidate(held, k)
        at = arm.robot_values(shown_candidate.ended, held.explanation.opening)
        if shown_candidate.reason == Reason.FEASIBLE:
            assert ghost(shown) is None
            assert np.array_equal(drawn_joint_values(shown)["panda"], at)
        else:
            assert np.array_equal(ghost(shown).values, at)
            assert np.array_equal(drawn_joint_values(shown)["panda"], arm.robot.home)
    reasons = {shown_candidate.reason for shown_candidate in held.explanation.candidates}
    assert Reason.FEASIBLE in reasons
    assert len(reasons) > 1


def test_the_ghost_shows_what_collides(service):
    state = opened()
    hit = explained(service, changes.choose_cell(state, *cell_with(state, Reason.SCENE_COLLISION)))
    found = ghost(hit)
    pairs = {(c.a, c.b) for c in hit.explanation.best.collisions}
    assert pairs
    assert found.hits == {body for pair in pairs for body in pair}
    assert found.links() == {body.link for body in found.hits if body.body == "panda"}
    assert {body.body for body in found.others()} <= {o.name for o in state.scene.obstacles}
    assert found.others()
    far = explained(service, changes.choose_cell(state, *cell_with(state, Reason.UNREACHABLE)))
    assert ghost(far) is None
    assert "Out of reach" in candidates_html(far)


def test_the_red_shapes_are_those_of_the_bodies():
    """Robots' links as PyBullet has them, obstacles by their sizes, the object by its profile."""
    scene = load_small("bottle_on_table")
    pose = scene.task().T_world_object @ rotation_z(0.3)
    with BulletWorld(scene) as world:
        world.park("panda")
        for link in ("panda_link4", "panda_hand"):
            mesh, at = body_mesh(scene, BodyName("panda", link), pose)
            corners = [shape.vertices for shape in world.shapes("panda")[link]]
            seen = transform_points(np.vstack(corners), link_pose(world, "panda", link))
            assert np.abs(bounds(transform_points(mesh.vertices, at)) - bounds(seen)).max() < 0.004
    for o in scene.obstacles:
        mesh, at = body_mesh(scene, BodyName(o.name, ""), pose)
        size = {"box": o.size, "cylinder": (2 * o.size[0], 2 * o.size[0], o.size[-1])}[o.kind]
        assert np.abs(mesh.extents - size).max() < 0.004
        assert np.array_equal(at, o.T_world_obstacle)
    mesh, at = body_mesh(scene, BodyName(scene.file.object.name, ""), pose)
    profile = scene.profile
    expected = [[-profile.r_max] * 2 + [profile.h_min], [profile.r_max] * 2 + [profile.h_max]]
    assert np.abs(bounds(mesh.vertices) - expected).max() < 0.004
    assert np.array_equal(at, pose)


def bounds(points: np.ndarray) -> np.ndarray:
    return np.stack([points.min(axis=0), points.max(axis=0)])


def test_the_candidates_are_drawn_by_redundancy_and_branch(service):
    state = opened()
    hit = explained(service, changes.choose_cell(state, *cell_with(state, Reason.SCENE_COLLISION)))
    cells = reason_grid(hit.explanation)
    assert cells.shape[1] == len(hit.explanation.phi)
    best = {}
    for v in hit.explanation.candidates:
        best[v.branch, v.sample] = max(best.get((v.branch, v.sample), 0), 1 + v.reason)
    assert {k: int(v) for k, v in np.ndenumerate(cells) if v} == best
    html = candidates_html(hit)
    assert f"{len(hit.explanation.candidates)} candidates" in html
    assert html.count("sg-ring") == 1
    assert candidate_text(hit.shown_candidate) in candidate_html(hit)
    assert "The best of" in grasp_html(hit)
    assert "One of" in grasp_html(changes.choose_candidate(hit, 1))


def test_names_in_candidates_are_escaped(service):
    state = opened()
    hit = explained(service, changes.choose_cell(state, *cell_with(state, Reason.SCENE_COLLISION)))
    evil = BodyName("<img src=x>", "<b>")
    shown_candidate = hit.shown_candidate
    collisions = tuple(Collision(c.reason, evil, c.b, c.depth) for c in shown_candidate.collisions)
    first = replace(shown_candidate, collisions=collisions)
    explanation = replace(hit.explanation, candidates=(first, *hit.explanation.candidates[1:]))
    hostile = with_view(hit, explained=replace(hit.map_view.explained, explanation=explanation))
    assert "<img src=x>" not in candidate_html(hostile)
    assert "&lt;img src=x&gt;" in candidate_html(hostile)


# -- how probable grasps are -----------------------------------------------------------------


def probable(state: State, share: float) -> Probability:
    """The answer that a cell is feasible at a share of ten draws, counted from the first column."""
    feasible = np.full(state.result.map.reason.shape, round(10 * share))
    feasible[:, :, 0] = 10
    return Probability(ProbabilityRequest(state.request, state.map_view.noise), feasible, 10)


def test_probabilities_are_asked_for_where_they_are_shown_and_shift_with_the_map():
    state = opened()
    assert state.next_request is None
    state = with_view(state, color_by=ColorBy.PROBABILITY)
    request = ProbabilityRequest(state.request, state.map_view.noise)
    assert state.next_request == request
    assert np.isnan(state.map.values(ColorBy.PROBABILITY)).all()
    busy = job_changes.started(state, 1, "", request)
    assert changes.moved(busy, x=0.5).next_request == changes.moved(busy, x=0.5).request  # a map goes first
    found = job_changes.result_arrived(busy, 1, probable(state, 0.3))
    assert found.next_request is None
    step = 2 * np.pi / found.map.manifold.angles
    turned = changes.turn(found, 3 * step)
    assert turned.next_request is None  # it is the same on the object
    values = turned.map.values(ColorBy.PROBABILITY)
    assert np.array_equal(np.argwhere(values[0] == 100)[:, 1], np.full(len(values[0]), values.shape[2] - 3))
    assert values.min() == pytest.approx(30)
    assert with_view(found, color_by=ColorBy.REASON).map.probability is None
    less = with_view(found, noise=replace(found.map_view.noise, position=0.001))
    assert less.next_request == ProbabilityRequest(state.request, less.map_view.noise)
    assert less.map.probability is None
    assert with_view(less, noise=found.map_view.noise).next_request is None


def test_the_draws_of_a_picked_grasp_are_read_out():
    state = with_view(opened(), color_by=ColorBy.PROBABILITY)
    state = job_changes.result_arrived(
        job_changes.started(state, 1, "", state.next_request), 1, probable(state, 0.3)
    )
    row, column = cell_with(state, Reason.FEASIBLE)
    text = grasp_html(changes.choose_cell(state, row, column))
    count = 10 if column == 0 else 3
    assert f"feasible at {count} of 10 poses (" in text
    assert "7 to 65 % at 95 % confidence" in text or column == 0


def test_probabilities_are_those_of_the_library(service):
    state = with_view(opened(), color_by=ColorBy.PROBABILITY)
    shares: list[float] = []
    found = service.probability(state.next_request, shares.append)
    assert found.draws == DRAWS
    assert shares == sorted(shares)
    with open_world(state.scene) as world:
        own = success_map(MapMaker(world), state.arm, state.request.moved_task(), NOISE, DRAWS)
    assert np.array_equal(found.feasible / found.draws, own.probability)
    assert 0 < (found.feasible > 0).sum() != (found.feasible == DRAWS).sum() > 0


def test_windows_are_computed_where_they_are_shown():
    state = with_view(opened(), color_by=ColorBy.WINDOW)
    request = WindowsRequest(state.request)
    assert state.next_request == request
    assert state.map is not None
    assert state.map.widest is None
    widest = np.where(state.map.feasible, 0.5, np.nan)
    known = replace(state, map_view=state.map_view.with_result(Windows(request, widest)))
    assert known.next_request is None
    assert known.map is not None
    assert np.array_equal(known.map.values(ColorBy.WINDOW), np.rad2deg(widest), equal_nan=True)
    turned = changes.turn(known, 3 * known.map.manifold.dtheta)
    assert turned.next_request is None  # turning the object only shifts the map
    assert with_view(known, color_by=ColorBy.REASON).next_request is None
