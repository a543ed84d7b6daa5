"""What became slower than in a run of the benchmark that was kept."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from symgrasp.bench.figures import Figure, keyed, report
from symgrasp.errors import InputError

__all__ = ["read_run", "slower"]

UNITS = ("s", "ms", "µs", "MB")
"""Units of the figures that are compared: those of which less is better."""

ALLOWED = 1.1
"""How much more is not told."""


def read_run(path: Path) -> dict[str, Any]:
    """Return what ``symgrasp bench --out`` wrote.

    Raises:
        InputError: the file cannot be read, or holds something else, or a run of another machine.
    """
    expected = "a file that symgrasp bench --out wrote"
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        machine, figures = content["machine"], content["figures"]
        for figure in figures:
            Figure.from_dict(figure)
    except OSError as error:
        raise InputError("command line", "--compare", str(path), f"{expected} ({error.strerror})") from error
    except (ValueError, TypeError, KeyError) as error:
        raise InputError(str(path), "figures", type(error).__name__, expected) from error
    here = report([])["machine"]
    if machine != here:
        raise InputError(str(path), "machine", str(machine), f"a run of this machine, {here}")
    return content


def slower(kept: Mapping[str, Any], figures: Sequence[Figure]) -> list[str]:
    """Return a line for every time or size that is larger than in a kept run, and each that is missing.

    Times are compared in CPU time where both runs have it. They are larger where the lower quartile is above
    the other run's upper one by more than `ALLOWED`.

    Args:
        kept: see `read_run`.
        figures: the run to compare.
    """
    now = keyed(figures)
    lines = []
    for name, before in keyed([Figure.from_dict(f) for f in kept["figures"]]).items():
        if before.unit not in UNITS or not before.values:
            continue
        after = now.get(name)
        if after is None or not after.values:
            lines.append(f"{name}: not measured any more")
            continue
        cpu = bool(before.cpu and after.cpu)
        old, new = ((f.cpu if cpu else f.values) for f in (before, after))
        if np.quantile(new, 0.25) > ALLOWED * np.quantile(old, 0.75):
            what = " CPU" if cpu else ""
            unit = before.unit
            lines.append(f"{name}: {np.median(new):.3g} {unit}{what}, was {np.median(old):.3g} {unit}{what}")
    return lines
