"""Motion of an arm on the spot: the elbow moves along a window of a cell, and the hand stays."""

from __future__ import annotations

import numpy as np

from symgrasp.errors import InputError, SymgraspError
from symgrasp.feasibility.cell import Cell, Window
from symgrasp.feasibility.creation.torso_maps import torso_sample
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.ik import ArmIK, solver_for
from symgrasp.poses import Array, inverse
from symgrasp.robot.limits import LIMIT_TOLERANCE, values_inside

__all__ = ["self_motion"]


def self_motion(
    m: FeasibilityMap, cell: Cell | tuple[int, int, int], window: Window, step: float = 0.02
) -> Array:
    """Return the joint values of an arm as its redundancy φ moves along a window, the hand held still.

    Between two values the straight line of the joints turns the hand by an error that falls with the square
    of the step.

    Args:
        m: a map of `create_map`.
        cell: the cell.
        window: one of `FeasibilityMap.windows` of the cell.
        step: largest distance (rad) between two values of φ.

    Returns:
        (k, n) joint values (rad) of the arm, in the order of its joints, a torso's not among them: from the
        lower end of the window to the upper one.

    Raises:
        SymgraspError: the map does not know its scene: it was loaded from a file, say; or the branch has no
            motion inside the joint limits all along the window, as where a joint would have to go back by a
            full turn.
        InputError: the step is no positive number.
    """
    if m.shown_in is None:
        raise SymgraspError("motions need the scene of the map, which maps of `create_map` know")
    if not step > 0.0:
        raise InputError("motion along a window", "step", step, "a positive number (rad)")
    cell = Cell(*cell)
    arm = m.shown_in.arm(m.arm)
    if arm.robot.torso is not None:
        sample = torso_sample(m, arm.robot.torso, cell)
        if sample < 0:
            raise SymgraspError(f"the cell {tuple(cell)} is infeasible, and has no windows")
        arm = arm.at(sample)
    solver = solver_for(arm, 1)
    assert isinstance(solver, ArmIK)  # other arms have no windows
    phi = np.linspace(window.low, window.high, 1 + max(1, int(np.ceil(window.width / step))))
    T = inverse(arm.robot.T_world_base) @ arm.hand.tool_poses(m.manifold, m.T_world_object)[cell]
    found = solver.at(phi).solve(T)
    own = (found.branch == window.branch) & found.inside
    if not np.array_equal(found.sample[own], np.arange(len(phi))):
        raise SymgraspError(f"the window of branch {window.branch} is not one of the cell {tuple(cell)}")
    q = np.unwrap(found.q[own], axis=0)
    # Turns are continued over half a turn, and then may be inside the limits by other full turns.
    below, above = arm.lower - q.min(axis=0), q.max(axis=0) - arm.upper
    q += 2 * np.pi * (_turns(below) - _turns(above))
    if not values_inside(q, arm.lower, arm.upper).all():
        raise SymgraspError(
            f"branch {window.branch}: a joint would have to go back by a full turn along the window"
        )
    return q.clip(arm.lower, arm.upper)


def _turns(outside: Array) -> Array:
    """Return how many full turns (n,) bring joints back that are outside of a limit by so much (rad)."""
    return np.ceil(np.where(outside > LIMIT_TOLERANCE, outside, 0.0) / (2 * np.pi))
