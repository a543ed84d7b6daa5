"""Pictures of surveys: a line over one axis, or heat maps over two, a panel for every value of the others."""

from __future__ import annotations

from itertools import product
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from symgrasp.errors import SurveyError, printable, shortened
from symgrasp.survey.evaluation import State
from symgrasp.survey.survey import Axis, Survey

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["draw_survey"]

MOST_PANELS = 60
"""Most panels of a picture."""

GREY = "#c8c8c8"
"""Where there is no value."""

CELL, LEAST, MOST_INCHES = 0.16, 2.2, 7.0
"""Size (inches) of a point, and of a panel at least and at most."""

LETTERS = 10
"""Most letters of a label on an inch of the picture's height."""


def draw_survey(survey: Survey, values: xr.DataArray) -> Figure:
    """Draw values of all points of a survey.

    The last two axes with several values are those of the panels, numbers before names; a survey with one
    such axis is drawn as a line.

    Args:
        survey: the survey.
        values: what `values_of` or `workspace` returned.

    Raises:
        SurveyError: there would be too many panels.
    """
    from matplotlib.figure import Figure

    long = [axis for axis in survey.axes if len(axis.values) > 1]
    shown = sorted(long, key=lambda axis: isinstance(axis.labels[0], float))[-2:]
    shown = [axis for axis in long if axis in shown] or [survey.axes[0]]
    others = [axis for axis in survey.axes if axis not in shown]
    panels = list(product(*(range(len(axis.values)) for axis in others)))
    if len(panels) > MOST_PANELS:
        names = " × ".join(axis.name for axis in others)
        expected = f"at most {MOST_PANELS}; open the store with xarray and choose"
        raise SurveyError(survey.source, f"panels of {names}", len(panels), expected)
    columns = int(np.ceil(np.sqrt(len(panels))))
    across = shown[0]
    size = (_inches(len(across.values)), _inches(len(shown[1].values)) if len(shown) > 1 else 2.6)
    rows = -(-len(panels) // columns)
    height = rows * (size[1] + 0.45) + 0.6
    figure = Figure(figsize=(columns * size[0] + 1.8, height), layout="constrained")
    label = fill(_plain(values.attrs["label"]), int(LETTERS * height))
    grid = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    drawn: Any = None
    low, high = _range(values)
    for k, axes in enumerate(grid.ravel()):
        if k >= len(panels):
            axes.set_visible(False)
            continue
        chosen = dict(zip((axis.name for axis in others), panels[k], strict=True))
        part = values.isel(chosen)
        text = ", ".join(f"{axis.name} {_text(axis, i)}" for axis, i in zip(others, panels[k], strict=True))
        axes.set_title(_plain(text), fontsize=9)
        if len(shown) > 1:
            drawn = _heat(axes, shown[0], shown[1], part.transpose(shown[1].name, shown[0].name), low, high)
        else:
            _line(axes, across, part)
            axes.set(ylim=(min(0.0, low), 1.05 * high or 1.0), ylabel=label)
    if drawn is not None:
        bar = figure.colorbar(drawn, ax=list(grid.ravel()), label=label)
        if values.name == "state":
            bar.set_ticks([int(s) for s in State], labels=[s.name.lower().replace("_", " ") for s in State])
    figure.suptitle(_plain(survey.file.name))
    return figure


def _heat(axes: Any, x: Axis, y: Axis, values: xr.DataArray, low: float, high: float) -> Any:
    """Draw values (y, x) as a heat map; return what a colour bar is made for."""
    from matplotlib import colormaps

    colors = colormaps["viridis"].with_extremes(bad=GREY)
    masked = np.ma.masked_invalid(values.values.astype(float))
    mesh = axes.pcolormesh(_places(x), _places(y), masked, cmap=colors, vmin=low, vmax=high)
    axes.set_facecolor(GREY)
    _name(axes, axes.xaxis, x)
    _name(axes, axes.yaxis, y)
    if x.unit == y.unit == "m":
        axes.set_aspect("equal")
    return mesh


def _line(axes: Any, x: Axis, values: xr.DataArray) -> None:
    places = _places(x)
    if isinstance(x.labels[0], float):
        axes.plot(places, values.values, "-o", color="#35609c", ms=4)
    else:
        axes.bar(places, values.values, color="#35609c")
    _name(axes, axes.xaxis, x)


def _name(axes: Any, side: Any, axis: Axis) -> None:
    """Label an axis of a panel, at its outer side."""
    if not isinstance(axis.labels[0], float):
        side.set_ticks(_places(axis), labels=[_plain(str(text)) for text in axis.labels])
        if side is axes.xaxis:
            axes.tick_params(axis="x", labelrotation=90)
    name = f"{axis.name} ({axis.unit})" if axis.unit else axis.name
    side.set_label_text(_plain(name))
    axes.label_outer()


def _places(axis: Axis) -> np.ndarray:
    """Return where the values (n,) of an axis are drawn; names are counted."""
    if isinstance(axis.labels[0], float):
        return np.array(axis.labels, dtype=float)
    return np.arange(len(axis.labels), dtype=float)


def _range(values: xr.DataArray) -> tuple[float, float]:
    if values.name == "state":
        return 0.0, float(max(State))
    finite = values.values[np.isfinite(values.values.astype(float))]
    return 0.0, float(finite.max(initial=0.0)) or 1.0


def _text(axis: Axis, k: int) -> str:
    value = axis.labels[k]
    return f"{value:.4g}{axis.unit and ' ' + axis.unit}" if isinstance(value, float) else str(value)


def _inches(count: int) -> float:
    return min(max(CELL * count, LEAST), MOST_INCHES)


def _plain(text: str) -> str:
    return shortened(printable(text), 80).replace("$", r"\$")
