"""Files of feasibility maps: what is in them, and reading them."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from symgrasp.errors import MapError, ProfileError
from symgrasp.feasibility.refined import Refined
from symgrasp.object.manifold import ROLLS, Manifold
from symgrasp.object.profile import Profile
from symgrasp.reason import Reason

__all__ = ["ARRAYS", "FORMAT_VERSION", "read_map"]

FORMAT_VERSION = 3
"""Version of the files that are written. Those of version 2 can be read too: they do not name the reasons."""

VERSION_2_REASONS = (
    "HAND_TOO_SMALL", "SURFACE_TOO_STEEP", "UNREACHABLE", "JOINT_LIMITS", "SELF_COLLISION",
    "OBJECT_COLLISION", "SCENE_COLLISION", "ROBOT_COLLISION", "APPROACH_BLOCKED", "FEASIBLE",
)  # fmt: skip
"""What the numbers 0, 1, … of the reasons meant in files of version 2."""


ARRAYS = (
    "T_world_object", "reason", "q", "sample", "branch", "clearance", "phi", "opening", "pair", "depth",
    "proven",
)  # fmt: skip

_OPTIONAL = ("certified", "refined_reason", "refined_certified")
"""Those that a map has only where that was asked for."""

_KINDS = {"b": "truth values", "u": "whole numbers from 0", "iu": "whole numbers", "f": "numbers"}
"""What arrays hold whose dtypes are of certain kinds."""

_KIND_OF = {
    "proven": "b", "certified": "b", "refined_certified": "b", "reason": "u", "refined_reason": "u",
    "sample": "iu", "branch": "iu", "pair": "iu",
}  # fmt: skip
"""The kinds of dtype that arrays have; all others are floating."""

RIGID = 1e-6
"""By how much the rotation of a pose may deviate from an orthonormal matrix."""


def read_map(path: str | Path) -> dict[str, Any]:
    """Return the attributes of a `FeasibilityMap` from an npz file.

    Raises:
        MapError: the file is missing or is not such a map.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            names = (*ARRAYS, "profile", "meta")
            missing = {"proven", *_OPTIONAL} - set(file.files)
            data = {name: file[name] for name in (*names, *_OPTIONAL) if name not in missing}
        meta = json.loads(str(data.pop("meta")))
    except FileNotFoundError:
        raise MapError(path, "file", str(path), "an existing map file") from None
    except Exception as error:  # zipfile, zlib, numpy and json each raise their own
        raise MapError(path, "file", str(error), "a map written by symgrasp") from error
    if not isinstance(meta, dict):
        raise MapError(path, "meta", meta, "a map written by symgrasp")
    if type(meta.get("version")) is not int or meta["version"] not in (2, FORMAT_VERSION):
        raise MapError(path, "version", meta.get("version"), f"2 or {FORMAT_VERSION}")
    read = _Reader(path, data, meta)
    try:
        return read.attributes()
    except (KeyError, IndexError, TypeError, ProfileError) as error:
        raise MapError(path, "meta", str(error), "a map written by symgrasp") from error


class _Reader:
    """Checks what a file holds.

    Args:
        path: the file.
        data: its arrays by name.
        meta: its other content.
    """

    def __init__(self, path: str | Path, data: dict[str, np.ndarray], meta: Mapping[str, Any]) -> None:
        self._path, self._data, self._meta = path, data, meta

    def attributes(self) -> dict[str, Any]:
        """Return the attributes of the map.

        Raises:
            MapError: a value is of the wrong kind or shape, or is none that a map has.
            KeyError: a value is missing, or a reason is unknown.
            IndexError: a reason has no name.
            TypeError: the names of reasons are no list.
            ProfileError: the profile is unusable.
        """
        data, meta = self._data, self._meta
        for name in sorted(data):
            self._check_kind(name)
        text = {key: self._value(key, _is_text, "a text") for key in ("scene", "arm", "task")}
        heights, angles = (
            self._value(key, _is_count, "a whole number from 1") for key in ("heights", "angles")
        )
        start = self._value("theta_start", _is_finite, "a finite number")
        preliminary = self._value("preliminary", _is_truth, "true or false", False)
        resolution = self._value("resolution", _is_width, "a finite number that is not negative", 0.0)
        bodies = tuple(self._value("bodies", _is_texts, "a list of texts"))
        manifold = Manifold(Profile(data.pop("profile"), str(self._path)), heights, angles, start)
        self._check_shapes(manifold)
        reasons = VERSION_2_REASONS if meta["version"] == 2 else meta["reasons"]
        data["reason"] = _renumbered(data["reason"], reasons)
        data.setdefault("proven", np.zeros(data["reason"].shape, dtype=bool))  # earlier versions do not say
        self._check_pose()
        self._check_values(data["reason"] == Reason.FEASIBLE, bodies, preliminary)
        parts = {"refined_reason", "refined_certified"}.intersection(data)
        refined = self._refined(manifold, reasons) if parts else None
        own = {
            "resolution": float(resolution),
            "preliminary": preliminary,
            "bodies": bodies,
            "refined": refined,
        }
        return {**text, **own, "manifold": manifold, **data}

    def _expect(self, holds: bool | np.bool_, field: str, value: object, expected: str) -> None:
        if not holds:
            raise MapError(self._path, field, value, expected)

    def _value(self, key: str, fits: Callable[[object], bool], expected: str, default: Any = None) -> Any:
        """Return a value that is no array; a default where a file of an earlier version has none."""
        value = self._meta[key] if default is None else self._meta.get(key, default)
        self._expect(fits(value), key, value, expected)
        return value

    def _check_kind(self, name: str) -> None:
        array, kind = self._data[name], _KIND_OF.get(name, "f")
        found = f"an array of {array.dtype}"
        self._expect(array.dtype.kind in kind, name, found, f"an array of {_KINDS[kind]}")

    def _check_shapes(self, manifold: Manifold) -> None:
        """Check all arrays but the parts that cells are split into."""
        data = self._data
        cells = (len(ROLLS), manifold.heights, manifold.angles)
        joints = data["q"].shape[-1] if data["q"].ndim else 0
        self._expect(joints > 0, "q", data["q"].shape, "joint values for every cell")
        self._expect(data["phi"].size > 0, "phi", data["phi"].shape, "at least one value")
        shapes = {
            "T_world_object": (4, 4),
            "phi": (data["phi"].size,),
            "opening": (manifold.heights,),
            "q": (*cells, joints),
            "pair": (*cells, 2),
        }
        for name in sorted({*ARRAYS, "certified"}.intersection(data)):
            shape = shapes.get(name, cells)
            self._expect(data[name].shape == shape, name, data[name].shape, f"an array of shape {shape}")

    def _check_pose(self) -> None:
        pose = self._data["T_world_object"]
        rotation = pose[:3, :3]
        with np.errstate(over="ignore", invalid="ignore"):  # of numbers that no rotation has
            rigid = np.abs(rotation.T @ rotation - np.eye(3)).max() < RIGID and np.linalg.det(rotation) > 0
        rigid = rigid and np.isfinite(pose).all() and np.array_equal(pose[3], [0, 0, 0, 1])
        self._expect(rigid, "T_world_object", pose.tolist(), "a rigid pose of finite numbers")

    def _check_values(self, feasible: np.ndarray, bodies: Sequence[str], preliminary: bool) -> None:
        """Check that cells have the values that their reasons call for.

        Args:
            feasible: (R, H, A) which cells are.
            bodies: names of bodies.
            preliminary: whether the map is, which has no witnesses.
        """
        data = self._data
        for name in ("phi", "opening"):
            self._expect(np.isfinite(data[name]).all(), name, "NaN or infinity", "finite numbers")
        has = np.zeros_like(feasible) if preliminary else feasible
        self._check_range("sample", has, data["sample"], len(data["phi"]))
        self._check_range("branch", has, data["branch"], np.iinfo(np.int16).max)
        self._expect(
            np.isfinite(data["q"][has]).all(), "q", "NaN or infinity", "finite numbers for feasible cells"
        )
        known = data["clearance"][has]
        text = "finite numbers that are not negative for feasible cells"
        self._expect((np.isfinite(known) & (known >= 0)).all(), "clearance", _worst(known), text)
        named = data["pair"][..., 0] >= 0
        pair = data["pair"][named]
        self._expect(
            (data["pair"] >= -1).all() and ((pair >= 0) & (pair < len(bodies))).all(),
            "pair", _worst(data["pair"]), f"indices into {len(bodies)} bodies, or -1",
        )  # fmt: skip
        depth = data["depth"][named]
        text = "finite numbers where bodies are named"
        self._expect(np.isfinite(depth).all(), "depth", _worst(depth), text)
        both = int((data["proven"] & feasible).sum())
        self._expect(not both, "proven", f"{both} feasible cells", "infeasible cells alone")

    def _check_range(self, name: str, cells: np.ndarray, values: np.ndarray, count: int) -> None:
        """Check that values are below a count, and not negative, for some cells."""
        known = values[cells]
        inside = (known >= 0) & (known < count)
        wrong = int(known[~inside][0]) if not inside.all() else 0
        self._expect(inside.all(), name, wrong, f"0 to {count - 1} for feasible cells")

    def _refined(self, manifold: Manifold, names: Sequence[str]) -> Refined:
        """Return the parts of the cells of a grid, and take them out of the arrays."""
        data = self._data
        reason, certified = data.pop("refined_reason"), data.pop("refined_certified")
        rolls, heights, angles = reason.shape if reason.ndim == 3 else (0, 0, 0)
        whole = heights and angles and not heights % manifold.heights and not angles % manifold.angles
        fits = certified.shape == reason.shape and rolls == len(ROLLS) and bool(whole)
        self._expect(fits, "refined_reason", reason.shape, "whole parts of the cells")
        parts = Manifold(manifold.profile, heights, angles, manifold.theta_start)
        return Refined(parts, _renumbered(reason, names), certified)


def _worst(values: np.ndarray) -> object:
    """Return a value that stands for those which are wrong: one that is no number, or else the least."""
    if not values.size:
        return "none"
    odd = values[~np.isfinite(values)]
    return float(odd[0]) if odd.size else float(values.min())


def _is_text(value: object) -> bool:
    return isinstance(value, str)


def _is_texts(value: object) -> bool:
    return isinstance(value, list) and all(isinstance(text, str) for text in value)


def _is_truth(value: object) -> bool:
    return isinstance(value, bool)


def _is_count(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value >= 1


def _is_finite(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e300


def _is_width(value: object) -> bool:
    return _is_finite(value) and isinstance(value, int | float) and value >= 0


def _renumbered(reason: np.ndarray, names: Sequence[str]) -> np.ndarray:
    """Return the reasons of a file as numbers of `Reason`.

    Args:
        reason: as numbers of the file.
        names: what the numbers 0, 1, … mean in the file.

    Raises:
        KeyError: there is no reason of such a name.
        IndexError: a number has no name.
    """
    return np.array([Reason[name] for name in names], dtype=np.uint8)[reason]
