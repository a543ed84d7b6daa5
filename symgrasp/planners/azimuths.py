"""Where in their cells arms of five joints hold, and by how much more the object is turned for it.

With its pitch held, such an arm meets a grasp at single azimuths, which are hardly ever those of a cell's
middle. Its grasp is rigid all the same: for a hold h with the azimuth θₕ on the object, and a task with the
turn δ, the arm is at θₕ + δ on the map of the task as given. What is beyond whole columns, of θₕ, δ and the
azimuth within the cell, adds up in the same way, so it is passed on from task to hold to task.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from symgrasp.planners.holding import HoldRun

__all__ = ["bound_holds", "offsets"]


def bound_holds(holds: Sequence[HoldRun], groups: Sequence[Sequence[int]]) -> list[HoldRun]:
    """Return the holds of which two tasks are bound to each other by other holds as well.

    Args:
        holds: the holds of a sequence.
        groups: its tasks, as indices, in groups that have one turn.
    """
    group_of = {task: g for g, tasks in enumerate(groups) for task in tasks}
    return [
        hold
        for k, hold in enumerate(holds)
        if _are_bound({group_of[task] for task in hold.tasks}, [*holds[:k], *holds[k + 1 :]], group_of)
    ]


def _are_bound(groups: set[int], holds: Sequence[HoldRun], group_of: Mapping[int, int]) -> bool:
    """Whether some holds connect two of some groups."""
    label = {g: g for g in group_of.values()}
    for hold in holds:
        joined = {label[group_of[task]] for task in hold.tasks}
        label = {g: min(joined) if own in joined else own for g, own in label.items()}
    return len({label[g] for g in groups}) < len(groups)


def offsets(
    holds: Sequence[HoldRun],
    groups: Sequence[Sequence[int]],
    azimuths: Mapping[tuple[int, str], float],
    first: float,
) -> tuple[list[float], list[float]]:
    """Return what turns and grasps have beyond whole columns.

    Args:
        holds: the holds of a sequence.
        groups: its tasks, as indices, in groups that have one turn.
        azimuths: (task, arm) → the angle (rad) by which the arm holds beside the middle of its cell. No hold
            of an arm with one that is not zero is bound, see `bound_holds`.
        first: what the turn of the first group has (rad).

    Returns:
        For every task what its turn, and for every hold what the angle of its grasp on the object is more
        (rad).
    """
    turn = {0: first}
    grasp: dict[int, float] = {}
    while len(turn) < len(groups) or len(grasp) < len(holds):
        for g, tasks in enumerate(groups):
            for h, hold in enumerate(holds):
                for task in set(tasks) & set(hold.tasks):
                    azimuth = azimuths[task, hold.arm]
                    if g in turn:
                        grasp.setdefault(h, azimuth - turn[g])
                    elif h in grasp:
                        turn[g] = azimuth - grasp[h]
    group_of = {task: g for g, tasks in enumerate(groups) for task in tasks}
    return [turn[group_of[k]] for k in range(len(group_of))], [grasp[h] for h in range(len(holds))]
