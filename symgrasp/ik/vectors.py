"""Vectors (3,) as tuples of numbers in compiled code, and the first subproblem of Paden and Kahan.

Tuples stay in registers, and no array has to be allocated.
"""

from __future__ import annotations

import math
from typing import Any

from symgrasp.compiling import njit

__all__ = [
    "STRICT",
    "column",
    "cross",
    "dot",
    "minus",
    "perpendicular",
    "plus",
    "rotate",
    "row",
    "subproblem1",
    "times",
    "transposed_times",
    "unit",
    "vec",
]

STRICT: dict[str, Any] = {"inner": True, "error_model": "numpy", "_nrt": False}
"""Options of `njit`: plain IEEE arithmetic. The last one switches off reference counting of arrays, which
is safe because nothing that has them allocates any."""


@njit(**STRICT)
def rotate(axis, s, c, v):
    """Rotate v about a unit axis by the angle of that sine and cosine (Rodrigues)."""
    along = dot(axis, v) * (1.0 - c)
    w = cross(axis, v)
    return (
        c * v[0] + s * w[0] + along * axis[0],
        c * v[1] + s * w[1] + along * axis[1],
        c * v[2] + s * w[2] + along * axis[2],
    )


@njit(**STRICT)
def subproblem1(axis, a, b):
    """Subproblem 1: y and x of the angle ``atan2(y, x)`` about an axis that turns a into b."""
    return dot(axis, cross(a, b)), dot(a, b) - dot(axis, a) * dot(axis, b)


@njit(**STRICT)
def perpendicular(v):
    """Return a unit vector perpendicular to v."""
    w = (0.0, -v[2], v[1]) if abs(v[0]) < 0.6 else (v[2], 0.0, -v[0])
    length = math.sqrt(dot(w, w))
    return (w[0] / length, w[1] / length, w[2] / length)


@njit(**STRICT)
def unit(y, x):
    """Return sine and cosine of ``atan2(y, x)``."""
    length = math.sqrt(y * y + x * x)
    if length == 0.0:
        return 0.0, 1.0
    return y / length, x / length


@njit(**STRICT)
def times(R, v):
    """Return R v."""
    return (
        R[0][0] * v[0] + R[0][1] * v[1] + R[0][2] * v[2],
        R[1][0] * v[0] + R[1][1] * v[1] + R[1][2] * v[2],
        R[2][0] * v[0] + R[2][1] * v[1] + R[2][2] * v[2],
    )


@njit(**STRICT)
def transposed_times(R, v):
    """Return Rᵀ v."""
    return (
        R[0][0] * v[0] + R[1][0] * v[1] + R[2][0] * v[2],
        R[0][1] * v[0] + R[1][1] * v[1] + R[2][1] * v[2],
        R[0][2] * v[0] + R[1][2] * v[1] + R[2][2] * v[2],
    )


@njit(**STRICT)
def row(a, i):
    """Return row i of an array (n, 3) as a tuple."""
    return (a[i, 0], a[i, 1], a[i, 2])


@njit(**STRICT)
def column(a, i, j):
    """Return three entries of column j, from row i on."""
    return (a[i, j], a[i + 1, j], a[i + 2, j])


@njit(**STRICT)
def vec(a, i):
    """Return three entries of a vector, from i on."""
    return (a[i], a[i + 1], a[i + 2])


@njit(**STRICT)
def plus(a, b):
    """Return a + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@njit(**STRICT)
def minus(a, b):
    """Return a − b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@njit(**STRICT)
def dot(a, b):
    """Return a · b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(**STRICT)
def cross(a, b):
    """Return a × b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
