"""How long the page waits for maps is measured beside a survey that runs."""

from __future__ import annotations

from docs.background import waits


def test_maps_are_timed_without_and_with_a_survey(thorough):
    count, rounds = (3, 2) if thorough else (2, 1)
    found = list(waits(count=count, rounds=rounds))
    assert [runs for runs, _ in found] == rounds * [*count * [False], *count * [True]]
    assert all(taken > 0 for _, taken in found)
