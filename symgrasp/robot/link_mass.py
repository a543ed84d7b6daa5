"""The mass of a link, as its URDF states it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from symgrasp.descriptions.urdf import UrdfLink
from symgrasp.errors import UrdfError
from symgrasp.poses import Array

__all__ = ["link_mass"]

HEAVIEST = 1e6
"""Masses must be below this (kg)."""


def link_mass(path: Path, link: UrdfLink) -> tuple[float, Array]:
    """Return the mass (kg) of a link and its centre of mass (3,) in the link frame; zero where none is given.

    Args:
        path: the URDF, for error messages.
        link: the link.

    Raises:
        UrdfError: they are not numbers, or the mass is negative.
    """
    if link.inertial is None:
        return 0.0, np.zeros(3)
    mass, centre = link.inertial.mass, link.inertial.origin[:3, 3]
    if not 0 <= mass <= HEAVIEST:
        raise UrdfError(path, f"link {link.name}: mass", mass, "a mass that is not negative (kg)")
    if not np.isfinite(centre).all():
        raise UrdfError(path, f"link {link.name}: inertial origin", centre.tolist(), "finite numbers")
    return mass, centre
