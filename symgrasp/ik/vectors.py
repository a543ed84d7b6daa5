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
    "sine_and_cosine",
    "subproblem1",
    "times",
    "transposed_times",
    "unit",
    "vec",
]

STRICT: dict[str, Any] = {"inner": True, "error_model": "numpy", "_nrt": False}
"""Options of `njit`: plain IEEE arithmetic. The last one switches off reference counting of arrays, which
is safe because nothing that has them allocates any."""

QUARTER, QUARTER_REST = 0.5 * math.pi, 6.123233995736766e-17
"""A quarter turn (rad), as a float and what that lacks."""

S3, S5, S7, S9, S11, S13, S15 = ((-1) ** (n // 2) / math.factorial(n) for n in range(3, 16, 2))
C4, C6, C8, C10, C12, C14, C16 = ((-1) ** (n // 2) / math.factorial(n) for n in range(4, 17, 2))
"""The coefficients of the Taylor series of sine and cosine."""


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


@njit(**STRICT, fastmath={"contract"})
def sine_and_cosine(angle):
    """Return sine and cosine of an angle (rad) to 2e-15, for the angles of joints: a few turns at most.

    By their Taylor series about the nearest quarter turn, of which the terms left out are below 5e-17. It
    takes a quarter of the time of the library's, which also serve huge angles and come one by one.
    """
    quarters = math.floor(angle * (2.0 / math.pi) + 0.5)
    x = (angle - quarters * QUARTER) - quarters * QUARTER_REST
    z = x * x
    s = x + x * z * (S3 + z * (S5 + z * (S7 + z * (S9 + z * (S11 + z * (S13 + z * S15))))))
    c = 1.0 + z * (-0.5 + z * (C4 + z * (C6 + z * (C8 + z * (C10 + z * (C12 + z * (C14 + z * C16)))))))
    n = int(quarters) & 3
    if n & 1:
        s, c = c, s
    return (-s if n & 2 else s), (-c if (n + 1) & 2 else c)
