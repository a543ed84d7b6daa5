"""Plays that begin, go on and end, by a clock of the test's own."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from app.html.motion import motion_html
from app.server.session.playback_clock import INTERVAL, PlaybackClock
from app.state import changes
from app.state.plans import plan_changes
from app.state.plans.plan_results import FADE, SECONDS_PER_TASK, SHORTEST_REPLAY
from tests.app.state.states import with_plan


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


def test_a_climb_of_few_steps_shows_each_for_longer(clock):
    state = with_plan("log_two_robots", "bimanual", "hill_climb")
    climb = state.plan_results.climb
    assert climb
    few = replace(climb, steps=climb.steps[:1] * 4)
    results = replace(state.plan_results, climb=few)
    state = plan_changes.play_climb(replace(state, plan_results=results))
    state = clock.advanced(state, 0.0)
    frames = []
    for now in np.arange(0.0, SHORTEST_REPLAY + 0.01, INTERVAL):
        state = clock.advanced(state, float(now))
        frames.append(state.plan_results.frame)
    shown = [frames.count(k) * INTERVAL for k in (0, 1, 2)]
    assert shown == pytest.approx([SHORTEST_REPLAY / 4] * 3, abs=INTERVAL)


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


def test_a_picture_fades_out_before_the_next_and_the_last_one_stays(clock):
    """The page hides the view while `changing`: what is drawn jumps only then, and is seen again after."""
    state = clock.advanced(plan_changes.play_arms(with_plan("pick_pour_place", "sequential")), 0.0)
    now, seen = 0.0, []
    while state.plan_results.playing:
        now += INTERVAL
        seen.append((state.step, state.plan_results.changing))
        state = clock.advanced(state, now)
    steps = [step for step, _ in seen]
    assert sorted(set(steps)) == [0, 1, 2]
    for (step, hidden), (next_step, _) in pairwise(seen):
        assert hidden or step == next_step
    for step in (0, 1):
        hidden = sum(hidden for at, hidden in seen if at == step)
        assert hidden * INTERVAL == pytest.approx(FADE, abs=2 * INTERVAL)
    assert (2, True) not in seen
    assert motion_html(state).count("sg-changing") == 0


def test_a_view_that_is_scrubbed_does_not_fade():
    state = plan_changes.show_position(with_plan("pick_pour_place", "sequential"), 0.49)
    assert not state.plan_results.changing
    assert "sg-changing" in motion_html(plan_changes.play_arms(state))
