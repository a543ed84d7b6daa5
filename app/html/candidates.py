"""The candidates of the picked cell: the reason of each over redundancy and branch, and the one shown."""

from __future__ import annotations

import numpy as np

from symgrasp.feasibility.explain import CandidateResult, Explanation
from symgrasp.reason import Reason

from ..render.palette import REASONS
from ..state.state import State
from .escaping import escape
from .map import picture_html, to_png

__all__ = ["candidate_html", "candidate_text", "candidates_html", "reason_grid"]

ROW_HEIGHT = 13
"""Height of a branch in the picture (px)."""

HAND_REASONS = (Reason.HAND_TOO_SMALL, Reason.SURFACE_TOO_STEEP)
"""Reasons that hold for every configuration of the arm, so that there are no candidates."""


def candidates_html(state: State) -> str:
    """Draw the reason of every candidate of the picked cell, the one that is shown marked."""
    explanation = state.explanation
    if explanation is None:
        text = "" if state.pick is None else "Trying every way to hold it here …"
        return f'<div class="sg sg-faint">{text}</div>' if text else ""
    if explanation.reason in HAND_REASONS:
        return (
            f'<div class="sg">{escape(explanation.reason.label.capitalize())}, whatever the arm does.</div>'
        )
    samples = len(explanation.phi)
    if not explanation.candidates:
        where = f"at any of {samples} redundancy values"
        text = (
            f"Not found: the search met no configuration that gets there, {where}; that is no proof."
            if explanation.reason == Reason.NOT_FOUND
            else f"Out of reach: no configuration of the arm gets there, {where}."
        )
        return f'<div class="sg">{text}</div>'
    counts = " · ".join(f"{count} {escape(reason.label)}" for reason, count in explanation.counts().items())
    reached = samples - explanation.unreachable
    text = f"{len(explanation.candidates)} candidates, at {reached} of {samples} redundancy values: {counts}"
    return f'<div class="sg">{text}</div>{_picture(explanation, state.shown_candidate)}'


def candidate_html(state: State) -> str:
    """Describe the candidate that is shown."""
    shown_candidate, explanation = state.shown_candidate, state.explanation
    if shown_candidate is None or explanation is None or state.candidate is None:
        return ""
    where = f"{state.candidate + 1} of {len(explanation.candidates)}"
    pitch = "" if shown_candidate.pitch is None else f", pitch {np.rad2deg(shown_candidate.pitch):.1f}°"
    return (
        f'<div class="sg sg-candidate"><b>Candidate {where}</b>: φ = {np.rad2deg(shown_candidate.phi):.1f}°, '
        f"branch {shown_candidate.branch + 1}{pitch}<br>"
        f'<i style="background:{shown_candidate.reason.color}"></i>'
        f"{escape(candidate_text(shown_candidate))}{_elbow_text(state)}</div>"
    )


def _elbow_text(state: State) -> str:
    """Say where the elbow was moved to, or that no motion is known; nothing where that is not asked for."""
    candidate, motion = state.shown_candidate, state.elbow_motion
    if candidate is None or candidate.reason != Reason.FEASIBLE or not state.are_elbow_motions_known:
        return ""
    if motion is None:
        return "<br>No motion of the elbow is known from here."
    if state.elbow is None or state.shown_values is None:
        return ""
    joints = ", ".join(f"{angle + 0.0:.0f}°" for angle in np.round(np.rad2deg(state.shown_values)))
    return f"<br>Elbow at φ = {np.rad2deg(state.elbow):.1f}°, joints {joints}"


def candidate_text(candidate: CandidateResult) -> str:
    """Return one line of text: why a candidate fails, or how far it is from a collision."""
    why, more = candidate.why, len(candidate.collisions) - 1
    if candidate.collisions:
        worst = candidate.collisions[0]
        blocked = candidate.reason == Reason.APPROACH_BLOCKED
        after = f"after {1e3 * candidate.retreat:.0f} mm, " if blocked else ""
        others = "" if more < 1 else f", and {more} other pair{'s' if more > 1 else ''}"
        why = f"{after}{worst.a} and {worst.b}, {1e3 * worst.depth:.1f} mm too close{others}"
    return f"{candidate.reason.label}: {why}"


def reason_grid(explanation: Explanation) -> np.ndarray:
    """Return the furthest reason (branches, K) of the candidates by branch and redundancy value.

    Args:
        explanation: the candidates of a cell, one at least.

    Returns:
        1 + the value of the `Reason`; 0 where there is no candidate.
    """
    branches = 1 + max(candidate.branch for candidate in explanation.candidates)
    cells = np.zeros((branches, len(explanation.phi)), dtype=np.uint8)
    for candidate in explanation.candidates:
        at = candidate.branch, candidate.sample
        cells[at] = max(cells[at], 1 + candidate.reason)
    return cells


def _picture(explanation: Explanation, shown: CandidateResult | None) -> str:
    cells = reason_grid(explanation)
    rows, samples = cells.shape
    colors = np.vstack([[[255, 255, 255]], REASONS]).astype(np.uint8)
    png = to_png(cells[::-1], colors, (0, *[255] * len(REASONS)))
    mark = ""
    if shown:
        left, bottom = 100 * (shown.sample + 0.5) / samples, 100 * (shown.branch + 0.5) / rows
        mark = f'<span class="sg-ring" style="left:{left:.3f}%;bottom:{bottom:.3f}%"></span>'
    phi = np.rad2deg(explanation.phi)
    ticks = sorted({0, samples // 2, samples - 1})
    across = [((k + 0.5) / samples, f"{phi[k]:.0f}") for k in ticks]
    up = [((row + 0.5) / rows, str(row + 1)) for row in range(rows)]
    return picture_html(
        png, "candidates", mark, ROW_HEIGHT * rows, (across, "redundancy φ (°)"), (up, "branch")
    )
