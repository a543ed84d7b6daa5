"""Files of feasibility maps: what is in them, and reading them."""

from __future__ import annotations

import json
from collections.abc import Sequence
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
    if meta.get("version") not in (2, FORMAT_VERSION):
        raise MapError(path, "version", meta.get("version"), f"2 or {FORMAT_VERSION}")
    try:
        manifold = Manifold(
            Profile(data.pop("profile"), str(path)), meta["heights"], meta["angles"], meta["theta_start"]
        )
        shape = (len(ROLLS), manifold.heights, manifold.angles)
        shaped = {"reason", "sample", "branch", "clearance", "depth", "proven", "certified"}
        for name in sorted(shaped.intersection(data)):
            if data[name].shape != shape:
                raise MapError(path, name, data[name].shape, f"an array of shape {shape}")
        reasons = VERSION_2_REASONS if meta["version"] == 2 else meta["reasons"]
        data["reason"] = _renumbered(data["reason"], reasons)
        data |= {name: data[name].astype(bool) for name in ("proven", "certified") if name in data}
        if "refined_reason" in data:
            parts = _renumbered(data.pop("refined_reason"), reasons), data.pop("refined_certified")
            data["refined"] = _loaded_parts(path, manifold, *parts)
        data.setdefault("proven", np.zeros(shape, dtype=bool))  # files of earlier versions do not say
        names = {key: meta[key] for key in ("scene", "arm", "task")} | {
            "resolution": meta.get("resolution", 0.0),
            "preliminary": meta.get("preliminary", False),
        }
        return {**names, "manifold": manifold, "bodies": tuple(meta["bodies"]), **data}
    except (KeyError, IndexError, TypeError, ProfileError) as error:
        raise MapError(path, "meta", str(error), "a map written by symgrasp") from error


def _loaded_parts(path: str | Path, manifold: Manifold, reason: np.ndarray, certified: np.ndarray) -> Refined:
    """Return the parts (R, H, A) of the cells of a grid.

    Raises:
        MapError: they do not cut the cells into whole parts.
    """
    rolls, heights, angles = reason.shape if reason.ndim == 3 else (0, 0, 0)
    whole = heights and angles and not heights % manifold.heights and not angles % manifold.angles
    if certified.shape != reason.shape or rolls != len(ROLLS) or not whole:
        raise MapError(path, "refined_reason", reason.shape, "whole parts of the cells")
    parts = Manifold(manifold.profile, heights, angles, manifold.theta_start)
    return Refined(parts, reason, certified.astype(bool))


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
