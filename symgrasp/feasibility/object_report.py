"""A report on an object alone: its profile, how it was measured, and which hands hold it where."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from symgrasp.errors import InputError
from symgrasp.feasibility import pictures
from symgrasp.feasibility.fit import fit
from symgrasp.meshes import MESH_ENDINGS
from symgrasp.object.library import load_object
from symgrasp.object.measure.measurement import Measurement, measure_mesh
from symgrasp.object.profile import Profile
from symgrasp.robot.hand import HANDS, Hand

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["ObjectReport", "describe_object", "holding_heights"]

STEP = 5e-4
"""Distance (m) of the heights at which hands are tried."""


@dataclass(frozen=True, eq=False)
class ObjectReport:
    """An object, how it was measured, and which hand can hold it where.

    Attributes:
        name: what it is called.
        profile: its r(h).
        measurement: axis, symmetry and accuracy, for an object that comes from a mesh.
        holds: hand → the intervals of heights (m), to half a millimetre, at which it can hold the
            object as far as openings, palm and slopes go.
    """

    name: str
    profile: Profile
    measurement: Measurement | None
    holds: Mapping[str, tuple[tuple[float, float], ...]]

    def lines(self) -> list[str]:
        """Say all of it in a few lines, in centimetres and millimetres."""
        p = self.profile
        smallest, largest = p.radius_span(p.h_min, p.h_max)
        text = [
            f"{self.name}: {100 * (p.h_max - p.h_min):.2f} cm tall, {len(p.points)} knots",
            f"  radius               {1e3 * smallest:.1f} to {1e3 * largest:.1f} mm",
        ]
        if self.measurement is not None:
            m = self.measurement
            axis, origin = np.round(m.T_mesh_object[:3, 2:].T, 4) + 0.0  # no zero has a sign
            text += [
                f"  axis in the file     ({', '.join(f'{x:.4f}' for x in axis)})",
                f"  bottom in the file   ({', '.join(f'{x:.4f}' for x in origin)}) m",
                f"  symmetry error       {1e3 * m.largest.max():.2f} mm largest, "
                f"{1e3 * m.overall_rms:.2f} mm RMS, {1e3 * m.tolerance:.2f} mm allowed",
            ]
        for hand, intervals in self.holds.items():
            where = " and ".join(f"{100 * a:.1f} to {100 * b:.1f} cm" for a, b in intervals) or "nowhere"
            text.append(f"  {hand + ' holds it':20} {where}")
        return text

    def __str__(self) -> str:
        return "\n".join(self.lines())

    def plot(self) -> Figure:
        """Draw the profile and, for an object from a mesh, the map of its deviations."""
        return pictures.draw_object(self.profile.points, self.measurement, self.name)


def describe_object(
    name: str | Path,
    scale: float = 1.0,
    hands: Mapping[str, Hand] = HANDS,
    *,
    tolerance: float | None = None,
    flip: bool = False,
) -> ObjectReport:
    """Load or measure an object and try hands on it.

    Args:
        name: as for `symgrasp.object.library.load_object`.
        scale: metres in one unit of a mesh.
        hands: the hands by the names to report.
        tolerance: largest deviation (m) of a mesh from symmetry, see
            `symgrasp.object.measure.measurement.measure_mesh`.
        flip: whether the object of a mesh is to stand on its other end.

    Raises:
        InputError: scale, tolerance or flip are given for an object that is no mesh.
        ProfileError, MeshError: as `symgrasp.object.library.load_object`.
    """
    path, measurement = Path(name), None
    if path.suffix.lower() in MESH_ENDINGS:
        measurement = measure_mesh(path, scale=scale, tolerance=tolerance, flip=flip)
        label, profile = path.stem, Profile.measured(measurement)
    else:
        given = {"scale": scale != 1.0, "tolerance": tolerance is not None, "flip": flip}
        for option in (option for option, is_given in given.items() if is_given):
            raise InputError("object", option, str(name), f"a mesh ({', '.join(MESH_ENDINGS)})")
        label, profile = load_object(name)
    holds = {hand_name: holding_heights(hand, profile) for hand_name, hand in hands.items()}
    return ObjectReport(label, profile, measurement, holds)


def holding_heights(hand: Hand, profile: Profile) -> tuple[tuple[float, float], ...]:
    """Return the intervals of heights (m) at which a hand fits an object, to half a millimetre."""
    count = max(2, int(np.ceil((profile.h_max - profile.h_min) / STEP)) + 1)
    heights = np.linspace(profile.h_min, profile.h_max, count)
    fits = np.array([fit(hand, profile, float(h)) is None for h in heights])
    edges = np.flatnonzero(np.diff(np.concatenate([[False], fits, [False]])))
    return tuple((float(heights[a]), float(heights[b - 1])) for a, b in edges.reshape(-1, 2))
