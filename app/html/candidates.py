"""Every candidate of the picked cell at a glance: its fate over redundancy and branch, and the one shown."""

from __future__ import annotations

from html import escape

import numpy as np

from symgrasp.feasibility.explain import CandidateResult, Explanation
from symgrasp.reason import Reason

from ..render.palette import REASONS
from ..state.state import State
from .map import picture_html, to_png

__all__ = ["candidate_html", "candidate_line", "candidates_html", "fates"]

ROW = 13
"""Height of a branch in the picture (px)."""

FIRST = (Reason.HAND_TOO_SMALL, Reason.SURFACE_TOO_STEEP)
"""What rules a cell out before any candidate is looked at."""


def candidates_html(state: State) -> str:
    """Draw the fate of all candidates, and mark the one that is shown."""
    found = state.explanation
    if found is None:
        text = "" if state.pick is None else "Trying every way to hold it here …"
        return f'<div class="sg sg-faint">{text}</div>' if text else ""
    if found.reason in FIRST:
        return f'<div class="sg">{escape(found.reason.label.capitalize())}, whatever the arm does.</div>'
    samples = len(found.phi)
    if not found.candidates:
        text = f"Out of reach: no configuration of the arm gets there, at any of {samples} redundancy values."
        return f'<div class="sg">{text}</div>'
    counts = " · ".join(f"{count} {escape(reason.label)}" for reason, count in found.counts().items())
    reached = samples - found.unreachable
    text = f"{len(found.candidates)} candidates, at {reached} of {samples} redundancy values: {counts}"
    return f'<div class="sg">{text}</div>{_picture(found, state.shown_candidate)}'


def candidate_html(state: State) -> str:
    """Say what becomes of the candidate that is shown."""
    shown_candidate, found = state.shown_candidate, state.explanation
    if shown_candidate is None or found is None or state.candidate is None:
        return ""
    where = f"{state.candidate + 1} of {len(found.candidates)}"
    return (
        f'<div class="sg sg-verdict"><b>Candidate {where}</b>: φ = {np.rad2deg(shown_candidate.phi):.1f}°, '
        f'branch {shown_candidate.branch + 1}<br><i style="background:{shown_candidate.reason.color}"></i>'
        f"{escape(candidate_line(shown_candidate))}</div>"
    )


def candidate_line(shown_candidate: CandidateResult) -> str:
    """Say in one line why a candidate fails, or how clear it is."""
    why, more = shown_candidate.why, len(shown_candidate.collisions) - 1
    if shown_candidate.collisions:
        worst = shown_candidate.collisions[0]
        after = (
            f"after {1e3 * shown_candidate.retreat:.0f} mm, "
            if shown_candidate.reason == Reason.APPROACH_BLOCKED
            else ""
        )
        others = "" if more < 1 else f", and {more} other pair{'s' if more > 1 else ''}"
        why = f"{after}{worst.a} and {worst.b}, {1e3 * worst.depth:.1f} mm too close{others}"
    return f"{shown_candidate.reason.label}: {why}"


def fates(found: Explanation) -> np.ndarray:
    """Return the best fate (branches, K) at each branch and redundancy value: 1 + reason, 0 for none."""
    cells = np.zeros((1 + max(v.branch for v in found.candidates), len(found.phi)), dtype=np.uint8)
    for shown_candidate in found.candidates:
        cells[shown_candidate.branch, shown_candidate.sample] = max(
            cells[shown_candidate.branch, shown_candidate.sample], 1 + shown_candidate.reason
        )
    return cells


def _picture(found: Explanation, shown: CandidateResult | None) -> str:
    cells = fates(found)
    rows, samples = cells.shape
    colors = np.vstack([[[255, 255, 255]], REASONS]).astype(np.uint8)
    png = to_png(cells[::-1], colors, (0, *[255] * len(REASONS)))
    mark = ""
    if shown:
        left, bottom = 100 * (shown.sample + 0.5) / samples, 100 * (shown.branch + 0.5) / rows
        mark = f'<span class="sg-ring" style="left:{left:.3f}%;bottom:{bottom:.3f}%"></span>'
    phi = np.rad2deg(found.phi)
    ticks = sorted({0, samples // 2, samples - 1})
    across = [((k + 0.5) / samples, f"{phi[k]:.0f}") for k in ticks]
    up = [((row + 0.5) / rows, str(row + 1)) for row in range(rows)]
    return picture_html(png, "candidates", mark, ROW * rows, (across, "redundancy φ (°)"), (up, "branch"))
