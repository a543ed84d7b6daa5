"""Who may compute: not too many at once, nobody for ever, and everybody in turn."""

from __future__ import annotations

import threading
from collections.abc import Callable
from itertools import pairwise

import pytest

from app.compute import turns as module
from app.compute.turns import Place, Turns
from symgrasp.errors import Cancelled

WAIT = 30.0


def in_line(turns: Turns, action: Callable[[Place], None]) -> threading.Thread:
    """Start somebody who does something in their turn; return once they stand in the line."""
    stands = threading.Event()

    def wait_and_act() -> None:
        place = Place(turns)
        with place.turn(stands.set):
            action(place)

    thread = threading.Thread(target=wait_and_act)
    thread.start()
    assert stands.wait(WAIT)
    return thread


def never() -> None:
    raise AssertionError("nobody was to be waited for")


def test_at_most_as_many_compute_at_the_same_time_as_there_are_cores():
    turns, running, most = Turns(3), [0], [0]
    lock, full = threading.Lock(), threading.Barrier(3)

    def compute() -> None:
        with Place(turns).turn(lambda: None):
            with lock:
                running[0] += 1
                most[0] = max(most[0], running[0])
            full.wait(WAIT)  # all three are here
            with lock:
                running[0] -= 1

    threads = [threading.Thread(target=compute) for _ in range(12)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(WAIT)
    assert most == [3]


def test_the_cores_are_shared():
    turns = Turns(4)
    one, two, three = Place(turns), Place(turns), Place(turns)
    with one.turn(never), two.turn(never), three.turn(never):
        assert (one.cores, two.cores, three.cores) == (4, 2, 1)


def test_who_came_first_goes_first():
    turns, order = Turns(1), []
    with Place(turns).turn(never):
        threads = [in_line(turns, lambda _, k=k: order.append(k)) for k in range(8)]
    for thread in threads:
        thread.join(WAIT)
    assert order == list(range(8))


def test_who_gives_up_waiting_keeps_nobody_waiting():
    turns, order = Turns(1), []

    def give_up() -> None:
        raise Cancelled

    with Place(turns).turn(never):
        with pytest.raises(Cancelled), Place(turns).turn(give_up):
            raise AssertionError
        thread = in_line(turns, lambda _: order.append("next"))
    thread.join(WAIT)
    assert order == ["next"]
    with Place(turns).turn(never):
        pass


def test_who_wants_something_newer_keeps_the_place_in_the_line():
    turns, order = Turns(1), []
    mine, waits = Place(turns), threading.Event()

    def give_up() -> None:
        raise Cancelled

    def try_again() -> None:
        with mine.turn(waits.set):
            order.append("mine")

    with Place(turns).turn(never):
        with pytest.raises(Cancelled), mine.turn(give_up):
            raise AssertionError
        other = in_line(turns, lambda _: order.append("other"))
        again = threading.Thread(target=try_again)
        again.start()
        assert waits.wait(WAIT)
    again.join(WAIT)
    other.join(WAIT)
    assert order == ["mine", "other"]


def test_who_takes_long_lets_others_go_in_between(monkeypatch):
    monkeypatch.setattr(module, "SLICE", 0.0)
    turns, order = Turns(1), []

    def three_parts(name: str) -> Callable[[Place], None]:
        def compute(place: Place) -> None:
            for _ in range(3):
                order.append(name)
                if place.is_over:
                    place.renew(lambda: None)

        return compute

    with Place(turns).turn(never):
        threads = [in_line(turns, three_parts(name)) for name in "abc"]
    for thread in threads:
        thread.join(WAIT)
    assert order[:6] == list("abcabc")
    assert all(one != two for one, two in pairwise(order[:9]))


def test_nobody_has_to_stop_for_nobody(monkeypatch):
    monkeypatch.setattr(module, "SLICE", 0.0)
    place = Place(Turns(1))
    with place.turn(never):
        assert not place.is_over


def test_what_runs_in_the_background_waits_while_anybody_computes():
    turns = Turns(2)
    survey, waited = Place(turns, background=True), []

    def wait() -> None:
        waited.append(None)
        if len(waited) == 3:
            raise Cancelled

    with Place(turns).turn(never), pytest.raises(Cancelled), survey.turn(wait):
        raise AssertionError
    with survey.turn(never):
        assert survey.cores == 2


def test_what_runs_in_the_background_makes_room_at_once_and_takes_no_core_from_others():
    turns = Turns(2)
    survey, one = Place(turns, background=True), Place(turns)
    with survey.turn(never):
        assert not survey.is_over
        with one.turn(never):  # it does not wait until the survey has stopped
            assert survey.is_over
            assert one.cores == 2
        assert not survey.is_over


def test_surveys_take_turns(monkeypatch):
    monkeypatch.setattr(module, "SLICE", 0.0)
    turns, order = Turns(2), []
    one, two = Place(turns, background=True), Place(turns, background=True)
    stands = threading.Event()

    def other() -> None:
        with two.turn(stands.set):
            order.append("two")

    with one.turn(never):
        thread = threading.Thread(target=other)
        thread.start()
        assert stands.wait(WAIT)
        assert one.is_over
        one.renew(lambda: None)
        order.append("one")
    thread.join(WAIT)
    assert order == ["two", "one"]
