"""At what rate messages pass, and which of them are replaced by newer ones."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.server.door.inbox import Inbox, TokenBucket

MESSAGES = st.lists(st.sampled_from([None, "slider", "camera"]))


def newest_between_events(keys: list[str | None]) -> list[int]:
    """What is left of messages with such keys: events, and of the values between two events the last ones."""
    left = []
    for k, key in enumerate(keys):
        until = next((j for j in range(k, len(keys)) if keys[j] is None), len(keys))
        if key is None or key not in keys[k + 1 : until]:
            left.append(k)
    return left


@given(MESSAGES)
def test_a_value_is_replaced_by_a_newer_one_but_never_across_an_event(keys):
    inbox: Inbox[int] = Inbox()
    for k, key in enumerate(keys):
        inbox.put(k, key)
    left = newest_between_events(keys)
    assert len(inbox) == len(left)
    assert inbox.replaced == len(keys) - len(left)
    assert [inbox.take() for _ in left] == left
    with pytest.raises(KeyError):
        inbox.take()


@given(MESSAGES, MESSAGES)
def test_what_was_taken_is_not_replaced(before, after):
    inbox: Inbox[int] = Inbox()
    for k, key in enumerate(before):
        inbox.put(k, key)
    taken = [inbox.take() for _ in range(len(inbox))]
    for k, key in enumerate(after):
        inbox.put(k, key)
    assert taken == newest_between_events(before)
    assert [inbox.take() for _ in range(len(inbox))] == newest_between_events(after)


@given(st.lists(st.tuples(st.floats(0.0, 3.0), st.floats(0.5, 5.0))))
def test_no_more_pass_than_are_saved_up_and_flow_in(steps):
    now, rate, burst = [0.0], 4.0, 8.0
    bucket = TokenBucket(rate, burst, lambda: now[0])
    passed = 0.0
    for pause, tokens in steps:
        now[0] += pause
        now[0] += bucket.take(tokens)  # as one does who waits as told
        passed += tokens
        assert passed <= burst + rate * now[0] + 1e-6


def test_whoever_is_slower_never_waits():
    now = [0.0]
    bucket = TokenBucket(4.0, 8.0, lambda: now[0])
    for _ in range(100):
        assert bucket.take() == 0.0
        now[0] += 0.25
    assert [bucket.take() for _ in range(8)] == [0.0] * 8
    assert bucket.take() > 0.0
