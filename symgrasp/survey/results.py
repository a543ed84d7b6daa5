"""What a survey found: in words, and as values by its axes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np
import xarray as xr

from symgrasp.errors import SurveyError
from symgrasp.object.manifold import Manifold
from symgrasp.survey.evaluation import State
from symgrasp.survey.survey import Survey

__all__ = ["feasible_cells", "in_words", "problems", "values_of", "workspace"]

MOST_PROBLEMS = 3
"""Most reasons that are told why values do not go together."""

STATES = {
    State.MISSING: "not computed yet",
    State.OBJECT_BLOCKED: "with the object inside another body",
    State.ROBOT_BLOCKED: "with a robot that stands in something, or collides whatever its arms do",
    State.KEPT_OUT: "where the base may not stand",
    State.UNUSABLE: "whose values do not go together",
}

LABELS = {
    "share": "feasible cells (%)",
    "margin": "largest margin (mm)",
    "plan": "a plan exists",
    "plan_margin": "margin of the best plan (mm)",
    "state": "what became of the point",
}

FACTORS = {"share": 100.0, "margin": 1e3, "plan_margin": 1e3}


def values_of(results: xr.Dataset, name: str | None = None) -> xr.DataArray:
    """Return values of a survey's points as they are shown, with a label; NaN where there is none.

    Args:
        results: what `open_results` returned.
        name: share, margin, plan, plan_margin or state; the margin of plans if None, or else the share.

    Raises:
        SurveyError: the survey has no such values.
    """
    name = name or ("plan_margin" if "plan_margin" in results else "share")
    if name not in results:
        raise SurveyError("survey", "--value", name, "share, margin or state: the survey asks for no plan")
    found = results[name] * FACTORS.get(name, 1.0)
    if name != "state":
        found = found.where(results["state"] == State.COMPUTED)
    return found.assign_attrs(label=LABELS[name])


def feasible_cells(survey: Survey, results: xr.Dataset) -> xr.DataArray:
    """Return (axes…, roll, row, column) bool: which cells of every map are feasible.

    Raises:
        SurveyError: the survey keeps no maps.
    """
    if "feasible" not in results:
        raise SurveyError(survey.source, "maps", False, "true, to keep which cells of every map are feasible")
    packed = results["feasible"]
    angles = int(packed.attrs["angles"])
    return xr.apply_ufunc(
        lambda bits: np.unpackbits(bits, axis=-1, count=angles).astype(bool),
        packed,
        input_core_dims=[["byte"]],
        output_core_dims=[["column"]],
    )


def workspace(survey: Survey, results: xr.Dataset, h: float, roll: int) -> xr.DataArray:
    """Return at which share (%) of the angles a grasp is feasible, point by point: its workspace.

    The object's turn about its own axis is free, so the grasp can be held wherever this is above zero.

    Args:
        survey: the survey, whose points have one object.
        results: what `open_results` returned.
        h: height (m) along the object's axis.
        roll: turn (°) of the hand about its approach, 0 or 180.

    Raises:
        SurveyError: the survey keeps no maps, or has several objects.
        InputError: the height is not on the object.
    """
    cells = feasible_cells(survey, results)
    if any(axis.file.of == "object" for axis in survey.axes):
        raise SurveyError(survey.source, "axes", "object", "one object: heights are along its axis")
    grid: Manifold = survey.scene.manifold
    row, _ = grid.cell(h, 0.0)
    found = 100.0 * cells.isel(roll=int(roll == 180), row=row).mean("column")
    found = found.where(results["state"] == State.COMPUTED)
    label = f"feasible angles of the grasp at {100 * grid.h[row]:.1f} cm, roll {roll}° (%)"
    return found.assign_attrs(label=label)


def problems(results: xr.Dataset) -> Iterator[str]:
    """Yield for every point whose values do not go together why, as far as the store says."""
    if "problem" not in results:
        return
    letters = results["problem"].values[results["state"].values == State.UNUSABLE]
    for text in letters:
        yield bytes(text).rstrip(b"\0").decode()


def in_words(survey: Survey, results: xr.Dataset) -> Iterator[str]:
    """Yield lines that say what a survey found."""
    axes = " × ".join(f"{len(axis.values)} {axis.name}" for axis in survey.axes)
    yield f"{survey.file.name}: {survey.points} points, {axes}"
    state = results["state"].values
    for value, text in STATES.items():
        count = int((state == value).sum())
        if count:
            yield f"  {count} {text}"
        if count and value == State.UNUSABLE:
            for reason, points in Counter(problems(results)).most_common(MOST_PROBLEMS):
                yield f"    {points}: {reason}"
    computed = state == State.COMPUTED
    if not computed.any():
        return
    share = results["share"].values
    some = int((share[computed] > 0).sum())
    yield f"  {some} of {int(computed.sum())} that were computed have a feasible grasp"
    if "plan" in results:
        plan = results["plan"].values
        yield f"  {int(plan[computed].sum())} have a {survey.file.plan} plan"
        if plan[computed].any():
            yield "  best plan: " + _at(survey, results["plan_margin"], 1e3, "mm margin")
    if some:
        yield "  most feasible cells: " + _at(survey, results["share"], 100.0, "%")


def _at(survey: Survey, values: xr.DataArray, factor: float, unit: str) -> str:
    """Say where the largest value is, and how large."""
    at = np.unravel_index(int(np.nanargmax(values.values)), values.shape)
    where = ", ".join(
        f"{axis.name} {axis.labels[int(k)]:.4g} {axis.unit}".rstrip()
        if isinstance(axis.labels[int(k)], float)
        else f"{axis.name} {axis.labels[int(k)]}"
        for axis, k in zip(survey.axes, at, strict=True)
    )
    return f"{factor * float(values.values[at]):.1f} {unit} at {where}"
