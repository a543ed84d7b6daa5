"""Turns and grasps where arms hold beside the middle of their cells."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from symgrasp.planners.azimuths import bound_holds, offsets
from symgrasp.planners.holding import hold_runs, turn_groups

ARMS = "abcd"

sequences = st.lists(st.sets(st.sampled_from(ARMS), min_size=1), min_size=1, max_size=6).map(
    lambda tasks: [sorted(task) for task in tasks]
)


@given(tasks=sequences, data=st.data())
def test_a_grasp_is_where_it_was_in_every_task(tasks, data):
    """Of holds that are not bound, any azimuths go together; those that are bound are in the middle."""
    holds, groups = hold_runs(tasks), turn_groups(tasks)
    bound = bound_holds(holds, groups)
    angle = st.floats(-0.1, 0.1)
    azimuths = {
        (k, hold.arm): 0.0 if hold in bound else data.draw(angle) for hold in holds for k in hold.tasks
    }
    first = data.draw(angle)
    turns, grasps = offsets(holds, groups, azimuths, first)
    assert turns[0] == first
    for group in groups:
        assert len({turns[k] for k in group}) == 1
    for hold, grasp in zip(holds, grasps, strict=True):
        for k in hold.tasks:
            assert abs(grasp + turns[k] - azimuths[k, hold.arm]) < 1e-12


@given(tasks=sequences)
def test_bound_holds_are_those_on_a_circle(tasks):
    """Taking a hold that is not bound out of any of its tasks parts what it connects."""
    holds, groups = hold_runs(tasks), turn_groups(tasks)
    bound = bound_holds(holds, groups)
    group_of = {k: g for g, own in enumerate(groups) for k in own}
    edges = {(h, group_of[k]) for h, hold in enumerate(holds) for k in hold.tasks}
    for h, hold in enumerate(holds):
        on_circle = any(("g", g) in _connected(edges - {(h, g)}, ("h", h)) for own, g in edges if own == h)
        assert on_circle == (hold in bound)


def _connected(edges: set[tuple[int, int]], start: tuple[str, int]) -> set[tuple[str, int]]:
    """Return what is connected with a hold or group by edges between holds and groups."""
    found, open_ = {start}, [start]
    while open_:
        kind, index = open_.pop()
        near = [("g", g) if kind == "h" else ("h", h) for h, g in edges if (h if kind == "h" else g) == index]
        open_ += [node for node in near if node not in found]
        found.update(near)
    return found


def test_one_hand_after_the_other_is_free():
    assert not bound_holds(hold_runs(["a", "ab", "b"]), turn_groups(["a", "ab", "b"]))


def test_two_hands_in_two_tasks_are_bound():
    holds = hold_runs(["ab", "ab", "b"])
    assert bound_holds(holds, turn_groups(["ab", "ab", "b"])) == holds
