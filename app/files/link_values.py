"""Types of the values in a link, as pydantic reads and writes them: numbers, poses, names, choices."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable
from typing import Annotated, Any

import numpy as np
from pydantic import PlainSerializer, PlainValidator

from symgrasp.errors import one_of
from symgrasp.feasibility.color_by import ColorBy
from symgrasp.object.manifold import ROLLS
from symgrasp.survey.success import PoseNoise

from ..state.map_view_state import RollChoice
from ..state.object_pose import ObjectPose
from ..state.page_link import Camera

__all__ = ["CameraView", "Colors", "Names", "Noise", "Number", "Pose", "Rolls", "Side", "Switch"]

LARGEST = 1e5
"""Largest absolute value of a number in a link (cm, degrees; m of the camera)."""


def _text(read: Callable[[str], Any], write: Callable[[Any], str]) -> tuple[PlainValidator, PlainSerializer]:
    """Return the annotations of a type that pydantic is to read from text and to write as text.

    Args:
        read: returns the value; raises ``ValueError(bad value, what is expected)``.
        write: returns the text. A value that is no text is written before it is read, and thereby rounded.
    """
    validator = PlainValidator(lambda value: read(value if isinstance(value, str) else write(value)))
    return validator, PlainSerializer(write)


def _choice(values: Iterable[Any], write: Callable[[Any], str]) -> tuple[PlainValidator, PlainSerializer]:
    known = {write(value): value for value in values}

    def read(text: str) -> Any:
        if text not in known:
            raise ValueError(text, one_of(known, text))
        return known[text]

    return _text(read, write)


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not abs(value) <= LARGEST:
        raise ValueError(text, "a number")
    return value


def _number_text(value: float) -> str:
    return f"{value + 0.0:.12g}"  # + 0.0 turns -0.0 into 0.0


def _numbers(text: str) -> tuple[float, ...]:
    values = text.split(",")
    if len(values) != 6:
        raise ValueError(text, "six numbers with commas between them")
    return tuple(map(_number, values))


def _noise(text: str) -> PoseNoise:
    values = [_number(part) for part in text.split(",")]
    if len(values) != 2 or min(values) < 0:
        raise ValueError(text, "two numbers of at least 0 with a comma between them")
    return PoseNoise(values[0] / 1e3, np.deg2rad(values[1]).item())


def _noise_text(noise: PoseNoise) -> str:
    return ",".join(map(_number_text, (1e3 * noise.position, np.rad2deg(noise.tilt))))


def _pose(text: str) -> ObjectPose:
    x, y, z, *angles = _numbers(text)
    return ObjectPose(x / 100, y / 100, z / 100, *np.deg2rad(angles).tolist())


def _pose_text(pose: ObjectPose) -> str:
    angles = np.rad2deg((pose.lean, pose.towards, pose.spin))
    return ",".join(map(_number_text, (100 * pose.x, 100 * pose.y, 100 * pose.z, *angles)))


def _names(text: str) -> tuple[str, ...]:
    try:
        names = next(csv.reader([text], strict=True))
    except csv.Error:
        names = []
    if not names:
        raise ValueError(text, 'names with commas between them, or in "double quotes"')
    for i, name in enumerate(names):
        if name in names[:i]:
            raise ValueError(name, "every name once")
    return tuple(names)


def _names_text(names: Iterable[str]) -> str:
    text = io.StringIO()
    csv.writer(text).writerow(names)
    return text.getvalue().removesuffix("\r\n")


Number = Annotated[float, *_text(_number, _number_text)]
"""A length in cm or an angle in degrees."""

Pose = Annotated[ObjectPose, *_text(_pose, _pose_text)]
"""x, y, z (cm), lean, direction of the lean, spin (degrees)."""

Noise = Annotated[PoseNoise, *_text(_noise, _noise_text)]
"""How uncertain the object's pose is: position (mm) and tilt (degrees)."""

CameraView = Annotated[Camera, *_text(_numbers, lambda values: ",".join(f"{v:.3f}" for v in values))]

Names = Annotated[tuple[str, ...], *_text(_names, _names_text)]
"""Names with commas between them; one with a comma in it stands in double quotes."""

Switch = Annotated[bool, *_choice((False, True), lambda value: str(int(value)))]
Rolls = Annotated[RollChoice, *_choice(RollChoice, lambda roll: roll.value)]
Colors = Annotated[ColorBy, *_choice(ColorBy, lambda color_by: color_by.value)]
Side = Annotated[int, *_choice(range(len(ROLLS)), lambda roll: f"{np.rad2deg(ROLLS[roll]):.0f}")]
"""Index of a roll, written as its angle in degrees."""
