"""The mass of a link, as its URDF states it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import yourdfpy

from symgrasp.errors import UrdfError
from symgrasp.poses import Array

__all__ = ["link_mass"]

HEAVIEST = 1e6
"""Masses must be below this (kg)."""


def link_mass(path: Path, link: yourdfpy.Link) -> tuple[float, Array]:
    """Return the mass (kg) of a link and its centre of mass (3,) in the link frame; zero where none is given.

    Args:
        path: the URDF, for error messages.
        link: the link.

    Raises:
        UrdfError: they are not numbers, or the mass is negative.
    """
    inertial = link.inertial
    if inertial is None or inertial.mass is None:
        return 0.0, np.zeros(3)
    mass = float(inertial.mass)
    centre = np.zeros(3) if inertial.origin is None else np.asarray(inertial.origin, dtype=float)[:3, 3]
    if not 0 <= mass <= HEAVIEST:
        raise UrdfError(path, f"link {link.name}: mass", mass, "a mass that is not negative (kg)")
    if not np.isfinite(centre).all():
        raise UrdfError(path, f"link {link.name}: inertial origin", centre.tolist(), "finite numbers")
    return mass, centre
