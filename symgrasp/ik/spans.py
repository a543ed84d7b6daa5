"""On which spans of the redundancy φ the branches of an arm with a spherical triple reach a pose. Compiled.

They are known where all free joints are on one side of the locked one. That one then only turns the target
about its axis, so what the closed form takes from the target and is linear in the turn, such as the cosine c
that joint 4 needs, is ``m + a cos φ + b sin φ``. The branches of either value of joint 4 exist where |c| ≤ 1
and the radicand of the pair is not negative (see `symgrasp.ik.spherical`), which is computed much faster than
the whole closed form. Its signs are found at values of φ that are near enough to each other: by how much a
radicand may rise between two of them is not proven, but measured on the poses of arms. Gaps may be missed: a
span may hold values of φ at which no branch reaches the pose.

With a straight elbow a radicand only touches zero, at a single φ. That one is computed, and is a span without
width, also where rounding leaves the pose a little beyond the reach.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from symgrasp.compiling import njit
from symgrasp.ik.at_phi import Locked, geometry_at
from symgrasp.ik.chain import AXES, CENTRE_SEEN, MIDDLE, SLACK, WRIST_SEEN
from symgrasp.ik.joints import ROOT_TOLERANCE
from symgrasp.ik.spherical import reach
from symgrasp.ik.vectors import STRICT, cross, dot, vec
from symgrasp.poses import Array

__all__ = ["FINEST", "HALVES", "MOST_SPANS", "Spans", "find_spans", "new_spans", "prepare_spans", "span_over"]

HALVES = 2
"""The values of joint 4, each of which has half of the branches: the first four, and the others."""

MOST_SPANS = 8
"""Most spans of a half that are told apart; further ones count as one with the last."""

RISE, ROOT_RISE = 1.0, 0.25
"""By how much a radicand rises between two values of φ above the larger of its values there: for the square
of their distance (1/rad²), and for the change of the sine of joint 4. It is more than twice what was measured
on the arms of the shipped scenes."""

STEP = 0.5
"""Largest distance (rad) of two values of φ between which a radicand is not halved further."""

FINEST = 1e-5
"""Distance (rad) of two values of φ that are not told apart."""

CORNERS = 8
"""Values of φ, with both ends, at which the cosine that joint 4 needs may be ±1, or is largest or least."""

TOUCHES = 0.5 * ROOT_TOLERANCE
"""By how much a cosine may be beyond ±1, or a radicand below zero, where it is taken to touch it: the closed
form, which takes twice that for rounding, has branches there."""

DEEPEST = 32
"""Halvings of a part."""


class Spans(NamedTuple):
    """The spans, and memory to find them.

    Attributes:
        number: (HALVES,) their number for either value of joint 4; -1 where they are not known.
        ends: (HALVES, MOST_SPANS, 2) where they begin and end (rad).
        reached: (HALVES, MOST_SPANS) a value of φ (rad) on each at which the pose is reached.
        geometry: (3, m) the arm's geometry at thirds of a turn, see `Chain.geometry`.
        known: (1,) whether spans are known of the arm.
        corners: (CORNERS,) values of φ.
        phi, value, sine: (DEEPEST,) values of φ, radicands there, and sines of joint 4.
    """

    number: np.ndarray
    ends: Array
    reached: Array
    geometry: Array
    known: np.ndarray
    corners: Array
    phi: Array
    value: Array
    sine: Array


def new_spans(locked: Locked) -> Spans:
    """Return memory for the spans of an arm with a locked joint, of which nothing is known yet."""
    aside = bool(locked.spherical and (locked.after[:6] == locked.after[0]).all())
    geometry = np.empty((3, len(locked.row)))
    return Spans(
        number=np.full(HALVES, -1),
        ends=np.empty((HALVES, MOST_SPANS, 2)),
        reached=np.empty((HALVES, MOST_SPANS)),
        geometry=geometry,
        known=np.array([aside and locked.row[SLACK] == 0.0]),
        corners=np.empty(CORNERS),
        phi=np.empty(DEEPEST),
        value=np.empty(DEEPEST),
        sine=np.empty(DEEPEST),
    )


@njit(**STRICT)
def prepare_spans(spans, locked):
    """Write the geometries from which spans are found."""
    for k in range(len(spans.geometry)):
        geometry_at(locked, 2.0 * math.pi / 3.0 * k, spans.geometry[k])


@njit(**STRICT)
def span_over(spans, half, low, high):
    """Whether a span of a half overlaps a part of the range of φ (rad)."""
    for k in range(spans.number[half]):
        if spans.ends[half, k, 0] < high and spans.ends[half, k, 1] > low:
            return True
    return False


@njit(**STRICT)
def find_spans(spans, chain, locked, T):
    """Write the spans on which a pose T (4, 4) is reached, whether inside the limits or not."""
    if not spans.known[0]:
        for half in range(HALVES):
            spans.number[half] = -1
        return
    terms = _terms(spans.geometry, chain.joint, T)
    corners = _write_corners(spans.corners, terms, locked.lower, locked.upper)
    for half in range(HALVES):
        spans.number[half] = 0
        for k in range(corners - 1):
            low, high = spans.corners[k], spans.corners[k + 1]
            middle = 0.5 * (low + high)
            if abs(_wave(terms[0], math.sin(middle), math.cos(middle))) <= 1.0 + TOUCHES:
                _scan(spans, terms, half, low, high)
            elif (
                k > 0
                and abs(_wave(terms[0], math.sin(low), math.cos(low))) <= 1.0 + TOUCHES
                and _radicand(terms, half, low)[0] >= -TOUCHES
            ):
                _begin(spans, half, low, low)


@njit(**STRICT)
def _terms(geometry, joint, T):
    """Return what the radicands of a pose are made of.

    Returns:
        The coefficients (m, a, b) of the cosine c that joint 4 needs, and of the part of t along axis 6;
        those of the part of u along axis 5 as a function of joint 4; sine and cosine of the middle of joint
        4; the coefficients of c in |t|²; and the cosine between axes 5 and 6. For t and u see
        `symgrasp.ik.spherical`.
    """
    c0 = c1 = c2 = t0 = t1 = t2 = 0.0
    for k in range(3):
        g = geometry[k]
        _, t, c = reach(g, joint, T)
        along = dot(vec(g, AXES + 15), t)
        co, si = math.cos(2.0 * math.pi / 3.0 * k), math.sin(2.0 * math.pi / 3.0 * k)
        c0, c1, c2 = c0 + c / 3.0, c1 + c * co / 1.5, c2 + c * si / 1.5
        t0, t1, t2 = t0 + along / 3.0, t1 + along * co / 1.5, t2 + along * si / 1.5
    g = geometry[0]
    h4, h5, a = vec(g, AXES + 9), vec(g, AXES + 12), vec(g, CENTRE_SEEN)
    across = dot(h4, h5) * dot(h4, a)
    u = across - dot(h5, vec(g, WRIST_SEEN)), dot(h5, a) - across, -dot(h5, cross(h4, a))
    square = -2.0 * g[MIDDLE + 1], -2.0 * g[MIDDLE + 2]
    turn = g[MIDDLE + 3], g[MIDDLE + 4]
    return (c0, c1, c2), (t0, t1, t2), u, turn, square, dot(h5, vec(g, AXES + 15))


@njit(**STRICT)
def _wave(terms, s, c):
    """Return m + a c + b s."""
    return terms[0] + terms[1] * c + terms[2] * s


@njit(**STRICT)
def _write_corners(corners, terms, low, high):
    """Write the ends of the range of φ and what is between them, in order; return how many there are.

    Between two of them the cosine c that joint 4 needs rises or falls, inside ±1 or outside.
    """
    m, a, b = terms[0]
    size, at = math.sqrt(a * a + b * b), math.atan2(b, a)
    corners[0], corners[1] = low, high
    count = 2
    for k in range(3):
        if k == 0:
            away = 0.0
        else:
            cosine = ((1.0 if k == 1 else -1.0) - m) / max(size, 1e-300)
            if not abs(cosine) < 1.0:
                continue
            away = math.acos(cosine)
        for way in range(2):
            phi = at + (away if way == 0 else (math.pi if k == 0 else -away))
            phi += 2.0 * math.pi * math.floor((high - phi) / (2.0 * math.pi))  # the last one in the range
            if not low < phi < high:
                continue
            i = count  # sorted in
            while corners[i - 1] > phi:
                corners[i] = corners[i - 1]
                i -= 1
            corners[i] = phi
            count += 1
    return count


@njit(**STRICT)
def _radicand(terms, half, phi):
    """Return the radicand of the pair, as a share of |t|², for a value of joint 4, and the sine of that."""
    cosine, along, u, turn, square, between = terms
    si, co = math.sin(phi), math.cos(phi)
    c = min(max(_wave(cosine, si, co), -1.0), 1.0)
    s = math.sqrt(1.0 - c * c)
    if half == 0:
        s4, c4 = -(turn[0] * c + turn[1] * s), turn[1] * c - turn[0] * s
    else:
        s4, c4 = s * turn[1] - c * turn[0], turn[1] * c + s * turn[0]
    along5, along6 = _wave(u, s4, c4), _wave(along, si, co)
    across, size = 1.0 - between * between, square[0] * c + square[1]
    taken = (along5 * along5 + along6 * along6 - 2.0 * between * along5 * along6) / across
    return (size - taken) / (across * size), s


@njit(**STRICT)
def _scan(spans, terms, half, low, high):
    """Write the spans between two corners."""
    parts = max(1, math.ceil((high - low) / STEP))
    value, sine = _radicand(terms, half, low)
    if value >= 0.0:
        _begin(spans, half, low, low)
    left = low
    for k in range(parts):
        spans.phi[0] = high if k == parts - 1 else low + (high - low) * (k + 1) / parts
        spans.value[0], spans.sine[0] = _radicand(terms, half, spans.phi[0])
        count = 1
        while count > 0:
            right, other, beyond = spans.phi[count - 1], spans.value[count - 1], spans.sine[count - 1]
            width = right - left
            rise = RISE * width * width + ROOT_RISE * abs(sine - beyond)
            least = min(value, other)
            if least < 0.0 and max(value, other) >= -rise and width > FINEST and count < DEEPEST:
                middle = 0.5 * (left + right)
                spans.phi[count] = middle
                spans.value[count], spans.sine[count] = _radicand(terms, half, middle)
                count += 1
                continue
            if value < 0.0 and other >= 0.0:
                _begin(spans, half, left, right)
            elif value >= 0.0 and other < 0.0:
                spans.ends[half, spans.number[half] - 1, 1] = right
            elif least < 0.0 and max(value, other) >= -rise:
                _touch(spans, terms, half, (low, high), left, value, right, other)
            left, value, sine = right, other, beyond
            count -= 1
    if value >= 0.0:
        spans.ends[half, spans.number[half] - 1, 1] = high


@njit(**STRICT)
def _touch(spans, terms, half, corners, left, value, right, other):
    """Write a span without width where a radicand touches zero between two values of φ, or at a corner.

    It is negative at both values, and a parabola in between.
    """
    phi, width = left if value > other else right, right - left
    bend = value + other - 2.0 * _radicand(terms, half, left + 0.5 * width)[0]
    away = 0.25 * (value - other) / bend if bend < 0.0 else 1.0
    if abs(away) <= 0.5 + ROOT_TOLERANCE:
        phi = left + (0.5 + away) * width
    elif phi not in corners:  # the largest is in the part beside this one
        return
    if _radicand(terms, half, phi)[0] >= -TOUCHES:
        _begin(spans, half, phi, phi)


@njit(**STRICT)
def _begin(spans, half, at, reached):
    """Begin a span, or go on with one that ends there; it has no width yet."""
    count = spans.number[half]
    if count > 0 and spans.ends[half, count - 1, 1] >= at:
        return
    if count == MOST_SPANS:
        spans.ends[half, count - 1, 1] = at
        return
    spans.ends[half, count, 0] = spans.ends[half, count, 1] = at
    spans.reached[half, count] = reached
    spans.number[half] = count + 1
