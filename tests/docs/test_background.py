"""How long the page waits for maps is measured beside a survey that runs."""

from __future__ import annotations

from docs.background import waits


def test_maps_are_timed_without_and_with_a_survey():
    found = list(waits(count=2, rounds=1))
    assert [runs for runs, _ in found] == [*2 * [False], *2 * [True]]
    assert all(taken > 0 for _, taken in found)
