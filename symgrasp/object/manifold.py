"""The grasp manifold: the unwrapped surface (h, θ) of an object of revolution, as a grid.

The contact frame at (h, θ), drawn looking down the axis of symmetry z:

                 y  tangent (θ grows)
                 |
        axis ●---+---> x  radially outwards
                 ^ contact, at radius r(h)

The tool approaches along -x and closes its fingers along the tangent, so the plane between
the fingers is perpendicular to the axis (section 3.2 of the paper).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from symgrasp.errors import InputError
from symgrasp.object.profile import Profile
from symgrasp.poses import Array, axis_frame, from_rotation, rotation_z, spin

__all__ = ["ROLLS", "Manifold", "grasp_to_tool", "turn_text", "wrap"]

ROLLS = (0.0, np.pi)
"""The two ways to hold with the fingers' plane perpendicular to the axis."""

AZIMUTH_STEP = 1e-9
"""Azimuths of tool poses are rounded to this (rad, below a nanometre on any object), so that
turning the object by whole cells gives bit for bit the same tool poses in the world."""


def wrap(angle: ArrayLike) -> Array:
    """Wrap angles (...) (rad) into [-π, π)."""
    return np.mod(np.asarray(angle, dtype=float) + np.pi, 2 * np.pi) - np.pi


def turn_text(delta: float) -> str:
    """Return a turn δ (rad) of the object about its axis as it is written everywhere, such as ``37.50°``.

    The page writes it likewise while it is being dragged: `turnText` in ``app/shell/static/frame.js``.
    """
    text = f"{np.rad2deg(delta):.2f}°"
    return "0.00°" if text == "-0.00°" else text


def grasp_to_tool(
    T_world_object: ArrayLike,
    h: ArrayLike,
    theta: ArrayLike,
    roll: ArrayLike,
    standoff: ArrayLike,
    shift: ArrayLike = 0.0,
) -> Array:
    """Return the tool poses of grasps.

    ``T_world_tool = T_world_object · Rz(θ) · Trans(d, 0, h) · R_hand(roll) · Trans(0, -s, 0)``

    Args:
        T_world_object: one object pose (4, 4).
        h: heights (...) in metres.
        theta: angles (...) in radians.
        roll: 0 or π (...), the turn about the approach.
        standoff: distance d(h) (...) of the tool frame from the axis along z, in metres.
        shift: y (...) of the axis in the tool frame s(h), in metres.

    Returns:
        Poses ``T_world_tool`` (..., 4, 4) over the broadcast batch shape.
    """
    h, theta, roll, standoff, shift = (
        np.asarray(part, dtype=float) for part in (h, theta, roll, standoff, shift)
    )
    # Written through the axis frame, so that the object's own spin enters only as a sum of
    # angles: m((h, θ), T·Rz(δ)) and m((h, θ + δ), T) then share every bit (equation 3).
    azimuth = wrap(np.round(wrap(spin(T_world_object) + theta) / AZIMUTH_STEP) * AZIMUTH_STEP)
    sign = np.where(np.cos(roll) >= 0, 1.0, -1.0)
    offset = np.stack(np.broadcast_arrays(standoff, -sign * shift, h), axis=-1)
    hand = np.zeros((*sign.shape, 3, 3))  # columns: x, y (closing), z (approach) of the tool
    hand[..., 2, 0] = sign
    hand[..., 1, 1] = sign
    hand[..., 0, 2] = -1.0
    # Each factor has only the batch axes that it depends on, so on a grid most of the matrix products
    # are not repeated for every cell.
    return (axis_frame(T_world_object) @ rotation_z(azimuth)) @ from_rotation(hand, offset)


@dataclass(frozen=True, eq=False)
class Manifold:
    """A regular grid over the surface of an object of revolution.

    Cell (i, j) has its centre at ``h[i] = h_min + (i + ½)·dh`` and
    ``theta[j] = theta_start + (j + ½)·dtheta``.

    Args:
        profile: r(h) of the object.
        heights: number of cells along the axis.
        angles: number of cells around it.
        theta_start: angle (rad) where the grid begins; -π unless the grid was shifted.

    Raises:
        InputError: a count is below 1.
    """

    profile: Profile
    heights: int
    angles: int
    theta_start: float = -np.pi

    def __post_init__(self) -> None:
        for name in ("heights", "angles"):
            if getattr(self, name) < 1:
                raise InputError("manifold", name, getattr(self, name), "at least 1")

    @property
    def dh(self) -> float:
        """Height of a cell (m)."""
        return (self.profile.h_max - self.profile.h_min) / self.heights

    @property
    def dtheta(self) -> float:
        """Width of a cell (rad)."""
        return 2 * np.pi / self.angles

    @property
    def h(self) -> Array:
        """Heights (heights,) of the cell centres (m)."""
        return self.profile.h_min + (np.arange(self.heights, dtype=float) + 0.5) * self.dh

    @property
    def theta(self) -> Array:
        """Angles (angles,) of the cell centres (rad), wrapped into [-π, π)."""
        return wrap(self.theta_start + (np.arange(self.angles) + 0.5) * self.dtheta)

    def finer(self, along: float, around: float) -> list[Manifold]:
        """Return finer grids, each with the cells of the one before cut in two along and around.

        A side is cut no more once it is at most ``along`` (m) or ``around`` (rad): in the last grid, all are.
        """
        grids, grid = [], self
        while grid.dh > along * (1 + 1e-9) or grid.dtheta > around * (1 + 1e-9):
            heights = grid.heights * (2 if grid.dh > along * (1 + 1e-9) else 1)
            angles = grid.angles * (2 if grid.dtheta > around * (1 + 1e-9) else 1)
            grid = Manifold(self.profile, heights, angles, self.theta_start)
            grids.append(grid)
        return grids

    def project(self, points: ArrayLike) -> tuple[Array, Array]:
        """Map points (..., 3) in the object frame to (h, θ): f of equation 1."""
        x, y, z = np.moveaxis(np.asarray(points, dtype=float), -1, 0)
        return z, np.arctan2(y, x)

    def contact(self, h: ArrayLike, theta: ArrayLike) -> Array:
        """Map (h, θ) to points (..., 3) of the surface in the object frame: f⁻¹ of equation 2.

        Raises:
            ProfileError: a height lies outside the object.
        """
        r = self.profile.radius(h)
        points = [r * np.cos(theta), r * np.sin(theta), h]
        return np.stack(np.broadcast_arrays(*points), axis=-1).astype(float)

    def cell(self, h: float, theta: float) -> tuple[int, int]:
        """Return the cell (i, j) that holds (h, θ); the top edge belongs to the last row.

        Raises:
            ProfileError: the height lies outside the object.
        """
        self.profile.radius(h)
        row = min(int(np.floor((h - self.profile.h_min) / self.dh)), self.heights - 1)
        turned = (theta - self.theta_start) % (2 * np.pi)
        return row, int(np.floor(turned / self.dtheta)) % self.angles

    def shift(self, delta: float) -> tuple[Manifold, int]:
        """Shift the grid by the rotation of the object about its axis (equation 3).

        A map over this grid becomes, for the object turned by ``delta``, ``np.roll(map, -k,
        axis=angles)`` over the returned grid. For a whole number of cells the grid stays as it is; the
        rest of ``delta``, at most half a cell, moves the start of the grid, so every shift is exact.

        Args:
            delta: angle (rad) by which the object turned about its own axis.

        Returns:
            The shifted grid, and the number k of whole cells.
        """
        cells = delta / self.dtheta
        k = round(cells)
        rest = 0.0 if abs(cells - k) < 1e-9 else (cells - k) * self.dtheta
        return Manifold(self.profile, self.heights, self.angles, self.theta_start - rest), k

    def tool_poses(self, T_world_object: ArrayLike, finger_depth: float, shift: ArrayLike = 0.0) -> Array:
        """Return ``T_world_tool`` (rolls, heights, angles, 4, 4) at every cell centre.

        Args:
            T_world_object: object pose (4, 4).
            finger_depth: how deep (m) an object may reach between the fingers.
            shift: y (m) of the axis in the tool frame, one for all heights or one for each (heights,).
        """
        standoff = np.maximum(0.0, self.profile.radius(self.h) - finger_depth)
        return grasp_to_tool(
            T_world_object,
            self.h[None, :, None],
            self.theta[None, None, :],
            np.array(ROLLS)[:, None, None],
            standoff[None, :, None],
            np.broadcast_to(shift, standoff.shape)[None, :, None],
        )
