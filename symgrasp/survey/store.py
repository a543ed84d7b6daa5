"""The store of a survey's results: a Zarr group whose dimensions are the axes, which xarray opens.

A batch of points is a chunk of every variable, but of `PROBLEM` only where there is one. What a batch writes
last is `STATE`, so a batch counts as computed when all its points have one and every chunk can be read; each
carries a checksum.
"""

from __future__ import annotations

import json
import math
import shutil
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

import dask.array as da
import numpy as np
import xarray as xr
import zarr
from zarr.codecs import Crc32cCodec, ZstdCodec

from symgrasp.errors import SurveyError, printable
from symgrasp.object.manifold import ROLLS
from symgrasp.reason import Reason
from symgrasp.survey.evaluation import PointResult, State
from symgrasp.survey.survey import Survey

__all__ = ["SurveyStore", "create_store", "open_results"]

STATE, PROBLEM = "state", "problem"

FORMAT = "symgrasp survey"
FORMAT_VERSION = 2
"""Version 2 has the variable ``problem``; one without it is read, and gone on with, as it is."""

VERSIONS = (1, FORMAT_VERSION)

SMALLEST_COMPRESSED = 4096
"""Bytes of a chunk from which on it is compressed: a smaller one takes a block of the disk either way."""

LONGEST_PROBLEM = 240
"""Bytes of a text that says why the values of a point do not go together, at most."""


class SurveyStore:
    """The store of a survey, as workers write it.

    Args:
        path: its folder; `create_store` has made it.
        survey: the survey.

    Raises:
        SurveyError: the store is that of another survey, or of one with other files of robots and hands.
    """

    def __init__(self, path: str | Path, survey: Survey) -> None:
        self.survey = survey
        self._path = Path(path)
        attributes = _attributes(self._path)
        if attributes["sha256"] != survey.sha256:
            known = json.loads(attributes["survey"])["file"]["name"]
            expected = f"the same {survey.file.name}, scene, robots and program as now, or another folder"
            raise SurveyError(path, "survey", known, expected)
        group: Any = zarr.open_group(str(path), mode="r+", use_consolidated=False)
        every = {"write_empty_chunks": True}  # a chunk that is not there is missing
        self._kinds = {name: own for name, own in variables(survey).items() if name in group}
        self._arrays = {name: group[name].with_config(every) for name in self._kinds}

    def write(self, batch: int, results: Mapping[tuple[int, ...], PointResult]) -> None:
        """Write a batch.

        Args:
            batch: its number.
            results: point (indices along each axis) → what is known of it, for all points of the batch.
        """
        region = self.survey.region(batch)
        origin, shape = [s.start for s in region], tuple(s.stop - s.start for s in region)
        blocks = {
            name: np.full((*shape, *own.sizes), own.fill, own.kind) for name, own in self._kinds.items()
        }
        for point, result in results.items():
            where = tuple(k - o for k, o in zip(point, origin, strict=True))
            blocks[STATE][where] = result.state
            if result.problem and PROBLEM in blocks:
                text = np.frombuffer(_cut(result.problem), dtype=np.uint8)
                blocks[PROBLEM][where][: len(text)] = text
            if result.state != State.COMPUTED:
                continue
            assert result.cells is not None and result.feasible is not None
            values = {
                "share": result.share,
                "best": result.best,
                "margin": result.margin,
                "cells": result.cells,
                "plan": result.plan,
                "plan_margin": result.plan_margin,
                "feasible": np.packbits(result.feasible, axis=-1),
            }
            for name in values.keys() & blocks.keys():
                blocks[name][where] = values[name]
        for name in self._written(blocks[STATE]):
            array: Any = self._arrays[name]
            array[region] = blocks[name]

    def _written(self, state: np.ndarray) -> list[str]:
        """Return the variables of which a batch with these states has a chunk, `STATE` last."""
        known = [name for name in self._kinds if name not in (STATE, PROBLEM)]
        if PROBLEM in self._kinds and (state == State.UNUSABLE).any():
            known.append(PROBLEM)
        return [*known, STATE]

    def missing(self) -> list[int]:
        """Return the batches that are not computed, or cannot be read."""
        return [batch for batch in range(self.survey.batches) if not self._is_whole(batch)]

    def remove_partial(self) -> None:
        """Remove chunks that were not written to their end; for when nothing is being written."""
        for path in self._path.rglob("*.partial"):  # zarr writes a chunk there, and then renames it
            path.unlink(missing_ok=True)

    def _is_whole(self, batch: int) -> bool:
        """Whether every chunk of a batch is there, as it was written."""
        region, where = self.survey.region(batch), np.unravel_index(batch, self.survey.batch_grid)
        with suppress(Exception):  # zarr, its codecs and the disk each raise their own
            array: Any = self._arrays[STATE]
            state = array[region]
            if (state == State.MISSING).any():
                return False
            for name in self._written(state):
                chunk = [*(str(k) for k in where), *("0" for _ in self._kinds[name].sizes)]
                self._path.joinpath(name, "c", *chunk).stat()  # one that is not there is read as blank
                array = self._arrays[name]
                array[region]
            return True
        return False


def _cut(text: str) -> bytes:
    """Return a text in UTF-8, cut between two characters if it is too long."""
    return printable(text).encode()[:LONGEST_PROBLEM].decode(errors="ignore").encode()


class _Variable(NamedTuple):
    """What a store holds of a point: a value, or an array with further dimensions."""

    kind: Any
    fill: Any
    sizes: tuple[int, ...]
    dims: tuple[str, ...]
    attributes: dict[str, Any]


def variables(survey: Survey) -> dict[str, _Variable]:
    """Return what the store of a survey holds of every point, by name."""
    states = {
        "flag_values": [int(state) for state in State],
        "flag_meanings": " ".join(state.name.lower() for state in State),
    }
    m = survey.scene.settings
    nan = np.nan
    found = {
        STATE: _Variable(np.uint8, 0, (), (), {"long_name": "what became of the point", **states}),
        "share": _Variable(np.float64, nan, (), (), {"long_name": "share of the cells that are feasible"}),
        "best": _Variable(np.int16, -1, (3,), ("cell",), {"long_name": "cell with the largest margin"}),
        "margin": _Variable(np.float64, nan, (), (), {"long_name": "largest margin of a cell", "units": "m"}),
        "cells": _Variable(
            np.int32, 0, (len(Reason),), ("reason",), {"long_name": "number of cells by reason"}
        ),
    }
    of = {"long_name": "why the values of the point do not go together, in UTF-8, ended by zeros"}
    found[PROBLEM] = _Variable(np.uint8, 0, (LONGEST_PROBLEM,), ("letter",), of)
    if survey.file.plan:
        found["plan"] = _Variable(
            np.bool_, False, (), (), {"long_name": f"whether a {survey.file.plan} plan exists"}
        )
        of = {"long_name": "smallest margin of the best plan", "units": "m"}
        found["plan_margin"] = _Variable(np.float64, nan, (), (), of)
    if survey.file.maps:
        sizes = (len(ROLLS), m.heights, -(-m.angles // 8))
        of = {"long_name": "which cells are feasible, a bit a cell", "angles": m.angles}
        found["feasible"] = _Variable(np.uint8, 0, sizes, ("roll", "row", "byte"), of)
    return found


def create_store(path: Path, survey: Survey) -> SurveyStore:
    """Open the store of a survey, which is made if there is none.

    Raises:
        SurveyError: the folder holds something else, or the results of another survey.
        OSError: it cannot be written.
    """
    if not path.exists() or _is_empty(path):
        _make(path, survey)
    return SurveyStore(path, survey)


def _make(path: Path, survey: Survey) -> None:
    """Write a store without results, in one piece."""
    draft = path.parent / f".{path.name}.new"
    shutil.rmtree(draft, ignore_errors=True)
    names = [axis.name for axis in survey.axes]
    data: dict[str, Any] = {}
    encoding: dict[str, Any] = {}
    for name, (kind, fill, sizes, dims, attributes) in variables(survey).items():
        chunks = (*survey.batch_shape, *sizes)
        blank = da.full((*survey.shape, *sizes), fill, dtype=kind, chunks=chunks)
        data[name] = ((*names, *dims), blank, attributes)
        large = np.dtype(kind).itemsize * math.prod(chunks) >= SMALLEST_COMPRESSED
        codecs = (*((ZstdCodec(level=3),) if large else ()), Crc32cCodec())
        encoding[name] = {"chunks": chunks, "compressors": codecs, "fill_value": fill, "_FillValue": None}
    coordinates: dict[str, Any] = {
        "reason": [reason.name for reason in Reason],
        "cell": ["roll", "row", "column"],
    }
    for axis in survey.axes:
        attributes = {"long_name": axis.file.of, **({"units": axis.unit} if axis.unit else {})}
        coordinates[axis.name] = (axis.name, np.array(axis.labels), attributes)
    attributes = {
        "format": FORMAT,
        "version": FORMAT_VERSION,
        "sha256": survey.sha256,
        "survey": json.dumps(survey.to_dict()),
        "map_units": "m, rad",
    }
    with _quiet():
        dataset = xr.Dataset(data, coordinates, attributes)
        dataset.to_zarr(draft, mode="w", compute=False, encoding=encoding, zarr_format=3, consolidated=False)
    if path.exists():
        path.rmdir()
    draft.rename(path)


def _is_empty(path: Path) -> bool:
    return path.is_dir() and not any(path.iterdir())


def _attributes(path: Path) -> dict[str, Any]:
    """Return what a store says of itself; raise SurveyError if it is none."""
    try:
        attributes = dict(zarr.open_group(str(path), mode="r", use_consolidated=False).attrs)
    except Exception as error:  # zarr raises its own, and what json raises
        what = "a folder of something else" if path.is_dir() else "a file" if path.exists() else None
        raise SurveyError(path, "store", what, "a store written by symgrasp survey run") from error
    if attributes.get("format") != FORMAT:
        raise SurveyError(path, "format", attributes.get("format"), FORMAT)
    if attributes.get("version") not in VERSIONS:
        expected = " or ".join(str(known) for known in VERSIONS)
        raise SurveyError(path, "version", attributes.get("version"), expected)
    return attributes


def open_results(path: str | Path) -> tuple[Survey, xr.Dataset]:
    """Open the results of a survey, complete or not.

    Returns:
        The survey, and the results: a variable for each of `variables`, by the survey's axes.

    Raises:
        SurveyError: it is no store of a survey.
    """
    path = Path(path)
    attributes = _attributes(path)
    survey = Survey.from_dict(json.loads(attributes["survey"]))
    with _quiet():
        return survey, xr.open_zarr(path, consolidated=False, chunks=None)


@contextmanager
def _quiet() -> Iterator[None]:
    """Silence the warning that texts are no part of Zarr's specification yet."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", module="zarr")
        yield
