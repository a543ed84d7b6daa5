"""Numbers, names and poses as a link writes and reads them: lengths in cm, angles in degrees."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable

import numpy as np

from symgrasp.errors import InputError, one_of

from ..state.object_pose import ObjectPose

__all__ = ["names_text", "number", "number_text", "numbers", "one", "pose", "pose_text", "read_names"]

REACH = 1000.0
"""No coordinate in a link is larger (m)."""


def number(key: str, text: str) -> float:
    """Read a number.

    Raises:
        InputError: it is none, or a huge one.
    """
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not abs(value) <= 100 * REACH:
        raise InputError("link", key, text, "a number")
    return value


def numbers(key: str, text: str) -> list[float]:
    """Read six numbers with commas between them.

    Raises:
        InputError: they are not six, or no numbers.
    """
    values = text.split(",")
    if len(values) != 6:
        raise InputError("link", key, text, "six numbers with commas between them")
    return [number(key, value) for value in values]


def number_text(value: float) -> str:
    """Write a number so that nothing of it is lost that one could see."""
    return f"{value + 0.0:.12g}"


def pose(key: str, text: str) -> ObjectPose:
    """Read a pose: x, y, z, lean, direction of the lean, spin.

    Raises:
        InputError: as `numbers`.
    """
    x, y, z, *angles = numbers(key, text)
    return ObjectPose(x / 100, y / 100, z / 100, *np.deg2rad(angles).tolist())


def pose_text(pose: ObjectPose) -> str:
    """Write a pose."""
    lengths = (100 * v for v in (pose.x, pose.y, pose.z))
    angles = np.rad2deg((pose.lean, pose.towards, pose.spin))
    return ",".join(number_text(v) for v in (*lengths, *angles))


def one(key: str, text: str, choices: Iterable[str]) -> str:
    """Read one of some words.

    Raises:
        InputError: it is none of them.
    """
    choices = tuple(choices)
    if text not in choices:
        raise InputError("link", key, text, one_of(choices, text))
    return text


def read_names(key: str, text: str) -> list[str]:
    """Read names with commas between them; a name with a comma in it stands in double quotes.

    Raises:
        InputError: there is none, or one comes twice, or quotes are not closed.
    """
    try:
        names = next(csv.reader([text], strict=True))
    except csv.Error:
        names = []
    if not names:
        raise InputError("link", key, text, 'names with commas between them, or in "double quotes"')
    for i, name in enumerate(names):
        if name in names[:i]:
            raise InputError("link", key, name, "every name once")
    return names


def names_text(names: Iterable[str]) -> str:
    """Write names as `read_names` reads them."""
    text = io.StringIO()
    csv.writer(text).writerow(names)
    return text.getvalue().removesuffix("\r\n")
