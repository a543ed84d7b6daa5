"""The elbow of the arm that holds the object: moved along a window while the hand stays."""

# States have a map and a pick here.
# pyright: reportOptionalMemberAccess=false, reportOptionalSubscript=false, reportArgumentType=false
# pyright: reportOptionalOperand=false

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from app.compute.map_service import LEAST_MOTION, MapService
from app.html.candidates import candidate_html
from app.render.drawn_poses import drawn_joint_values
from app.state import changes, job_changes, undo
from app.state.requests import ElbowRequest, ExplainRequest
from app.state.state import State
from symgrasp.poses import pose_error
from symgrasp.reason import Reason
from tests.app.state.states import opened


@pytest.fixture(scope="module")
def service() -> Iterator[MapService]:
    service = MapService()
    yield service
    service.close()


def quiet(share: float) -> None:
    """Progress that nobody watches."""


def answered(service: MapService, state: State) -> State:
    """Compute all that a state with a picked cell asks for."""
    job_id = 0
    while (request := state.next_request) is not None:
        job_id += 1
        started = job_changes.started(state, job_id, "", request)
        if isinstance(request, ExplainRequest):
            result = service.explain(request, quiet)
        else:
            assert isinstance(request, ElbowRequest)
            result = service.elbow(request, state.result.map, quiet)
        state = job_changes.result_arrived(started, job_id, result)
    return state


def held(service: MapService, name: str, *, moves_elbow: bool = True) -> State:
    """A scene of which a feasible cell is picked, whose elbow can be moved if asked for and if it has one."""
    state = opened(name)
    cells = np.argwhere(state.map.feasible.any(axis=0))
    state = changes.choose_cell(state, *cells[len(cells) // 2].tolist())
    view = replace(state.map_view, moves_elbow=moves_elbow)
    return answered(service, replace(state, map_view=view))


@pytest.mark.parametrize("name", ["bottle_on_table", "talos_bottle"])  # talos has a torso
def test_the_hand_stays_while_the_elbow_moves(service, name):
    state = held(service, name)
    arm, motion = state.scene.arm(state.arm), state.elbow_motion
    assert motion is not None
    assert np.ptp(motion.phi) >= LEAST_MOTION
    assert state.elbow is None  # not moved yet
    assert np.array_equal(drawn_joint_values(state)[arm.robot.name][arm.indices], state.shown_candidate.q)
    grasp, seen = arm.world_tool_pose(state.shown_candidate.q), []
    for phi in np.linspace(motion.phi[0], motion.phi[-1], 23):
        moved = changes.move_elbow(state, float(phi))
        values = drawn_joint_values(moved)[arm.robot.name]
        seen.append(values[arm.indices])
        off, turned = pose_error(grasp, arm.world_tool_pose(seen[-1]))
        assert off < 1e-4
        assert turned < 1e-4
    assert np.abs(np.diff(seen, axis=0)).max(axis=1).min() > 0.0
    moved = changes.move_elbow(state, float(motion.phi[-1]))
    assert f"Elbow at φ = {np.rad2deg(motion.phi[-1]):.1f}°" in candidate_html(moved)
    beyond = changes.move_elbow(state, float(motion.phi[-1]) + 1.0)
    assert np.array_equal(beyond.shown_values, motion.q[-1])


def test_it_is_only_asked_for_where_it_can_be_moved(service):
    assert not held(service, "bottle_on_table", moves_elbow=False).are_elbow_motions_known
    state = held(service, "bottle_on_table")
    assert state.has_elbow
    infeasible = np.argwhere((state.map.reason == Reason.SCENE_COLLISION).all(axis=0))[0]
    hit = answered(service, changes.choose_cell(state, *infeasible.tolist()))
    assert not hit.are_elbow_motions_known
    assert hit.elbow_motion is None


def test_an_arm_of_six_joints_has_none(service):
    state = held(service, "ur5_bottle")
    assert not state.has_elbow
    assert state.are_elbow_motions_known
    assert state.elbow_motion is None
    assert "No motion of the elbow is known" in candidate_html(state)


def test_another_candidate_or_cell_puts_it_back(service):
    state = held(service, "bottle_on_table")
    moved = changes.move_elbow(state, float(state.elbow_motion.phi[0]))
    assert moved.elbow is not None
    other = changes.choose_candidate(moved, moved.candidate + 1)
    assert other.elbow is None
    away = changes.choose_cell(moved, *np.argwhere(state.map.feasible.any(axis=0))[0].tolist())
    assert answered(service, away).elbow is None
    turned = answered(service, changes.turn(moved, 2 * state.map.manifold.dtheta))
    assert turned.shown_values is not None
    assert turned.elbow is None
    last = len(state.explanation.candidates) - 1
    failing = changes.choose_candidate(state, last)
    assert failing.shown_candidate.reason != Reason.FEASIBLE
    assert failing.elbow_motion is None


def test_moving_it_is_undone(service):
    state = held(service, "bottle_on_table")
    moved = changes.move_elbow(state, float(state.elbow_motion.phi[0]))
    remembered = undo.remember(state, moved, "inputs", 0.0)
    assert answered(service, undo.undo(remembered)).elbow is None
    again = answered(service, undo.redo(undo.undo(remembered)))
    assert again.elbow == moved.elbow
