"""Changes of the state that computations make: begin, go on, end, fail."""

from __future__ import annotations

from dataclasses import replace

from .requests import Busy, Comparison, ExplainResult, MapResult, Request
from .state import State

__all__ = [
    "compiling",
    "ended",
    "failed",
    "is_awaited",
    "map_arrived",
    "progressed",
    "result_arrived",
    "retried",
    "started",
    "stopped",
]


def is_awaited(state: State, job_id: int) -> bool:
    """Return whether a job is the computation under way."""
    return state.busy is not None and state.busy.job_id == job_id


def started(state: State, job_id: int, label: str, request: Request | None = None) -> State:
    """A computation began; it replaces the one before."""
    problem = state.problem if request else ""
    return replace(state, busy=Busy(job_id, label, request), problem=problem)


def progressed(state: State, job_id: int, share: float, late: bool = False) -> State:
    """The computation is this far, and so late by now that the page says so."""
    busy = state.busy
    if busy is None or busy.job_id != job_id:
        return state
    late = late or busy.late
    if (share, late) == (busy.share, busy.late):
        return state
    return replace(state, busy=replace(busy, share=share, late=late))


def compiling(state: State, job_id: int) -> State:
    """The computation waits for code that is compiled, now and perhaps once more before it ends."""
    busy = state.busy
    if busy is None or busy.job_id != job_id:
        return state
    return replace(state, busy=replace(busy, late=True, compiling=True))


def map_arrived(state: State, job_id: int, result: MapResult) -> State:
    """Take a map: that of the object's pose, or on the way there that of an earlier one."""
    awaited = is_awaited(state, job_id)
    after = replace(state, busy=None) if awaited else state
    follows = awaited and not state.is_current and result.request.differs_in_pose(state.request)
    if result.request != state.request and not follows:
        return after
    return replace(after, result=result, refused=None)


def result_arrived(state: State, job_id: int, result: Comparison | ExplainResult) -> State:
    """Take a result about the map, unless it is about an earlier one."""
    if not is_awaited(state, job_id):
        return state
    is_about_it = result.request.map == state.request
    return replace(
        state, busy=None, map_view=state.map_view.with_result(result) if is_about_it else state.map_view
    )


def ended(state: State) -> State:
    """The computation is over."""
    return replace(state, busy=None, problem="")


def stopped(state: State, job_id: int, problem: str = "") -> State:
    """The computation was cancelled or failed: it does not begin again unasked."""
    if state.busy is None or state.busy.job_id != job_id:
        return state
    refused = state.missing_request
    if problem and state.busy.request is None:  # it was not the map that failed
        refused = state.refused
    return replace(state, busy=None, refused=refused, problem=problem)


def failed(state: State, problem: str) -> State:
    """Something that was asked for cannot be done; nothing else changes."""
    return replace(state, problem=problem)


def retried(state: State) -> State:
    """Compute after all what was cancelled or failed."""
    return replace(state, refused=None, problem="")
