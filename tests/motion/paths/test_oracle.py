"""Free motion on random problems, against OMPL, and looked at in PyBullet."""

from __future__ import annotations

from itertools import count, islice

import numpy as np

from symgrasp.bench.motions.free_problems import Problem, between_boxes, between_compartments, touches
from symgrasp.bench.motions.rrt_connect import Found, rrt_connect

COUNT = 20
ITERATIONS = 2_000
"""How often OMPL may ask whether to give up: at least once for every line that it tries."""


def test_what_ompl_finds_between_boxes_is_found_and_touches_nothing():
    found = 0
    for problem in islice(between_boxes(seed=7), COUNT):
        path = problem.solve()
        if path is None:
            assert _by_ompl(problem) is None, f"problem {problem.number}"
        else:
            found += 1
            np.testing.assert_array_equal(path[0], problem.start)
            np.testing.assert_array_equal(path[-1], problem.goal)
            assert not touches(problem, path), f"problem {problem.number}"
    assert found > COUNT / 2


def test_as_many_are_found_in_a_shelf_as_ompl_finds_and_none_touches_it():
    own = theirs = 0
    for problem in islice(between_compartments(seed=7), COUNT // 2):
        path = problem.solve()
        own += path is not None
        theirs += _by_ompl(problem) is not None
        assert path is None or not touches(problem, path), f"problem {problem.number}"
    assert own >= theirs > 0


def test_a_path_through_a_box_touches_it():
    hit = 0
    for problem in islice(between_boxes(seed=7), COUNT):
        if _straight_hits(problem):
            hit += 1
            assert touches(problem, np.array([problem.start, problem.goal]))
    assert hit


def _by_ompl(problem: Problem) -> Found | None:
    asked = count()
    return rrt_connect(
        problem.limits, problem.start, problem.goal, problem.free, lambda: next(asked) > ITERATIONS
    )


def _straight_hits(problem: Problem) -> bool:
    """Whether some state of the straight line is not free in PyBullet."""
    shares = np.linspace(0.2, 0.8, 20)[:, None]
    return not all(map(problem.free_in_bullet, problem.start + shares * (problem.goal - problem.start)))
