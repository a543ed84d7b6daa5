"""Plays that end and begin in several threads at once."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any, cast

import pytest

from app.server import plan_actions as plan_desk
from app.server.plan_actions import PlanActions
from app.state import plan_results as plan_book
from app.state.state import State
from tests.app.state.test_state import with_plan

WAIT = 30.0


class SessionApi:
    """As much of a session as a play needs; somebody presses Play just when a play has ended."""

    def __init__(self, state: State) -> None:
        self.lock = threading.RLock()
        self._state = state
        self.desk = PlanActions(self, cast("Any", None))
        self.players: set[threading.Thread] = set()
        self.ends = 0
        self.ended_again = threading.Event()

    @property
    def state(self) -> State | None:
        """What the player is told when a play has ended is no longer true when it goes by it."""
        state = self._state
        if threading.current_thread() in self.players and not state.plan_results.moving:
            self.ends += 1
            if self.ends == 1:
                person = threading.Thread(target=self.press)
                person.start()
                person.join(1)  # unless the person has to wait for the player
            else:
                self.ended_again.set()
        return state

    def press(self) -> None:
        self.desk.play(State.play_arms)

    def change(self, change: Callable[[State], State], origin: str = "") -> None:
        if origin == "play":
            self.players.add(threading.current_thread())
        with self.lock:
            self._state = change(self._state)

    def submit(self, label: str, run: Callable[..., Any], done: Callable[..., None]) -> None: ...

    def send(self, name: str, content: bytes) -> None: ...


def test_play_that_is_pressed_just_as_a_play_ends_plays_again(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(plan_desk, "TICK", 0.0)
    monkeypatch.setattr(plan_book, "SECONDS_A_TASK", 1e-6)
    office = SessionApi(with_plan("pick_pour_place", "sequential"))
    office.press()
    assert office.ended_again.wait(WAIT)
    for player in office.players:
        player.join(WAIT)
    assert office.ends == 2
    assert not office._state.plan_results.moving
