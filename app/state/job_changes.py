"""Changes of the state by computations: start, progress, result, cancellation, error."""

from __future__ import annotations

from dataclasses import replace

from .requests import Busy, Comparison, ElbowMotions, ExplainResult, MapResult, Probability, Request, Windows
from .state import State

__all__ = [
    "compiling",
    "ended",
    "failed",
    "is_awaited",
    "map_arrived",
    "preliminary_arrived",
    "progressed",
    "result_arrived",
    "retried",
    "started",
    "stopped",
    "waiting",
]


def is_awaited(state: State, job_id: int) -> bool:
    """Return whether the computation under way has this job id."""
    return state.busy is not None and state.busy.job_id == job_id


def started(state: State, job_id: int, label: str, request: Request | None = None) -> State:
    """Record that a computation was started, in place of the one under way.

    Args:
        state: the state.
        job_id: number of its job.
        label: what is computed, for the page.
        request: what it answers; None for what a person started.
    """
    problem = state.problem if request else ""
    return replace(state, busy=Busy(job_id, label, request), problem=problem)


def progressed(state: State, job_id: int, share: float, late: bool = False) -> State:
    """Record the progress of a computation.

    Args:
        state: the state.
        job_id: number of its job.
        share: how much of it is done, 0 to 1.
        late: whether it takes so long that the page shows it.
    """
    busy = state.busy
    if busy is None or busy.job_id != job_id:
        return state
    late = late or busy.late
    if (share, late) == (busy.share, busy.late):
        return state
    waiting = busy.waiting and share == busy.share
    return replace(state, busy=replace(busy, share=share, late=late, waiting=waiting))


def compiling(state: State, job_id: int) -> State:
    """Record that a computation has to compile code, which may happen several times."""
    busy = state.busy
    if busy is None or busy.job_id != job_id:
        return state
    return replace(state, busy=replace(busy, late=True, compiling=True))


def waiting(state: State, job_id: int) -> State:
    """Record that a computation waits until others have had their turn."""
    busy = state.busy
    if busy is None or busy.job_id != job_id or busy.waiting:
        return state
    return replace(state, busy=replace(busy, waiting=True))


def map_arrived(state: State, job_id: int, result: MapResult) -> State:
    """Show a computed map if it is for the object's pose, or for an earlier pose of the same drag."""
    after = replace(state, busy=None) if is_awaited(state, job_id) else state
    if result.request != state.request and not _follows(state, result, is_awaited(state, job_id)):
        return after
    return replace(after, result=result, refused=None)


def preliminary_arrived(state: State, result: MapResult) -> State:
    """Show a preliminary map until the exact one arrives: for the object's pose, or one before in a drag."""
    busy = state.busy
    awaited = False
    if busy is not None and busy.request == result.request:
        awaited, state = True, replace(state, busy=replace(busy, seen=True))
    shown = result.request == state.request or _follows(state, result, awaited)
    return replace(state, result=result) if shown and not state.is_current else state


def _follows(state: State, result: MapResult, awaited: bool) -> bool:
    """Return whether a map is of an earlier pose of a drag that goes on."""
    return awaited and not state.is_current and result.request.differs_only_in_pose(state.request)


def result_arrived(
    state: State, job_id: int, result: Comparison | ExplainResult | Probability | Windows | ElbowMotions
) -> State:
    """Show what was found out about a map, unless it is about another map."""
    if not is_awaited(state, job_id):
        return state
    is_about_it = result.request.map == state.request
    return replace(
        state, busy=None, map_view=state.map_view.with_result(result) if is_about_it else state.map_view
    )


def ended(state: State) -> State:
    """Record that the computation under way has ended."""
    return replace(state, busy=None, problem="")


def stopped(state: State, job_id: int, problem: str = "") -> State:
    """Record that a computation was cancelled, or failed with a problem; it is not restarted by itself."""
    if state.busy is None or state.busy.job_id != job_id:
        return state
    refused = state.missing_request
    if problem and state.busy.request is None:  # the missing result did not fail
        refused = state.refused
    return replace(state, busy=None, refused=refused, problem=problem)


def failed(state: State, problem: str) -> State:
    """Show a problem; nothing else changes."""
    return replace(state, problem=problem)


def retried(state: State) -> State:
    """Restart the computation that was cancelled or failed."""
    return replace(state, refused=None, problem="")
