"""Free motion as people plan it today: RRT-Connect of OMPL, which asks whether states are valid.

I. A. Şucan, M. Moll and L. E. Kavraki, The Open Motion Planning Library, IEEE Robotics & Automation
Magazine 19(4), 2012.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from symgrasp.poses import Array

__all__ = ["Found", "rrt_connect"]

RESOLUTION = 0.005
"""Share of the extent of the joint space between two states of a line, as MoveIt's assistant sets it."""


@dataclass(frozen=True, eq=False)
class Found:
    """A path that OMPL found.

    Attributes:
        setup: OMPL's problem with its solution.
        joints: number n of joints.
    """

    setup: Any
    joints: int

    @property
    def path(self) -> Array:
        """The path (m, n)."""
        return np.array([state[0 : self.joints] for state in self.setup.getSolutionPath().getStates()])

    def shorten(self) -> None:
        """Shorten and smooth the path, as OMPL does by itself."""
        self.setup.simplifySolution()


def rrt_connect(
    limits: Array, start: Array, goal: Array, valid: Callable[[Array], bool], stop: Callable[[], bool]
) -> Found | None:
    """Search a path with OMPL. Lines are looked at in steps, as long as MoveIt takes them.

    Args:
        limits: (2, n) lower and upper limits, finite.
        start: (n,) values.
        goal: (n,) values.
        valid: whether values (n,) are free.
        stop: asked now and then whether to give up.

    Returns:
        What was found, None if nothing was.

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
    return Found(setup, n)
