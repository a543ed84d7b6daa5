"""Plays that begin, go on and end, by a clock of the test's own."""

from __future__ import annotations

import pytest

from app.server.playback_clock import INTERVAL, PlaybackClock
from app.state import changes, plan_changes
from app.state.plan_results import SECONDS_PER_TASK
from tests.app.state.test_state import with_plan


@pytest.fixture
def clock() -> PlaybackClock:
    return PlaybackClock()


def test_nothing_is_waited_for_while_nothing_is_played(clock):
    state = with_plan("pick_pour_place", "sequential")
    assert clock.wait(None, 0.0) is None
    assert clock.wait(state, 0.0) is None
    assert clock.advanced(state, 0.0) is state


def test_a_play_goes_on_by_the_time_that_has_passed(clock):
    state = plan_changes.play_arms(with_plan("pick_pour_place", "sequential"))
    assert clock.wait(state, 10.0) == 0.0
    assert clock.advanced(state, 10.0) is state  # it begins now
    assert clock.wait(state, 10.0 + INTERVAL / 2) == pytest.approx(INTERVAL / 2)
    assert clock.advanced(state, 10.0 + INTERVAL / 2) is state
    state = clock.advanced(state, 10.5)
    assert state.plan_results.position == pytest.approx(0.5 / SECONDS_PER_TASK)
    state = clock.advanced(state, 10.5 + INTERVAL)
    assert state.plan_results.position == pytest.approx((0.5 + INTERVAL) / SECONDS_PER_TASK)


def test_a_play_that_has_ended_begins_anew_where_play_is_pressed(clock):
    """However long nothing was played in between."""
    state = plan_changes.play_arms(with_plan("pick_pour_place", "sequential"))
    for now in (0.0, 100.0, 200.0):
        state = clock.advanced(state, now)
    assert not state.plan_results.playing
    assert state.plan_results.position == state.plan_results.last
    state = plan_changes.play_arms(state)
    assert state.plan_results.position == 0.0
    state = clock.advanced(state, 300.0)
    assert state.plan_results.position == 0.0
    assert clock.advanced(state, 301.0).plan_results.position == pytest.approx(1.0 / SECONDS_PER_TASK)


def test_a_play_stops_where_the_person_has_moved_on(clock):
    state = plan_changes.play_arms(with_plan("pick_pour_place", "sequential"))
    state = changes.turn(clock.advanced(state, 0.0), 0.1)
    state = clock.advanced(state, 1.0)
    assert not state.plan_results.playing
    assert clock.wait(state, 1.0) is None
