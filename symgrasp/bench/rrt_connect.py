"""Free motion as people plan it today: RRT-Connect of OMPL, which asks whether states are valid.

I. A. Şucan, M. Moll and L. E. Kavraki, The Open Motion Planning Library, IEEE Robotics & Automation
Magazine 19(4), 2012.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from symgrasp.poses import Array

__all__ = ["rrt_connect"]

RESOLUTION = 0.005
"""Share of the extent of the joint space between two states of a line, as MoveIt's assistant sets it."""


def rrt_connect(
    limits: Array, start: Array, goal: Array, valid: Callable[[Array], bool], stop: Callable[[], bool]
) -> Array | None:
    """Search a path with OMPL, and shorten it. Lines are looked at in steps, as long as MoveIt takes them.

    Args:
        limits: (2, n) lower and upper limits, finite.
        start: (n,) values.
        goal: (n,) values.
        valid: whether values (n,) are free.
        stop: asked now and then whether to give up.

    Returns:
        The path (m, n), None where none was found.

    Raises:
        ImportError: OMPL is not installed.
    """
    from ompl import base, geometric, util

    util.noOutputHandler()
    n = len(start)
    space = base.RealVectorStateSpace(n)
    bounds = base.RealVectorBounds(n)
    for j in range(n):
        bounds.setLow(j, float(limits[0, j]))
        bounds.setHigh(j, float(limits[1, j]))
    space.setBounds(bounds)
    setup = geometric.SimpleSetup(space)

    def free(state: Any) -> bool:
        return bool(valid(np.array(state[0:n])))

    setup.setStateValidityChecker(free)
    ends: list[Any] = [space.allocState(), space.allocState()]  # their stubs leave the indices out
    for state, values in zip(ends, (start, goal), strict=True):
        state[0:n] = [float(value) for value in values]
    setup.setStartAndGoalStates(ends[0], ends[1])
    setup.getSpaceInformation().setStateValidityCheckingResolution(RESOLUTION)
    setup.setPlanner(geometric.RRTConnect(setup.getSpaceInformation()))
    setup.solve(base.PlannerTerminationCondition(lambda: bool(stop())))
    if not setup.haveExactSolutionPath():
        return None
    setup.simplifySolution()
    path: list[Any] = setup.getSolutionPath().getStates()
    return np.array([state[0:n] for state in path])
