"""What excludes a branch on a part of the range of the redundancy φ, from its two ends. Compiled.

A branch is excluded on a part by what is the matter with it at both ends:

* the same joint is outside its limits by more than joints deviate from a straight line in between;
* the same pair of pieces collides, deeper than their motion deviates from a straight line (see
  `symgrasp.collision.inner_pieces` for how deep). Between two ends, the distance of two convex bodies along a
  fixed direction is at most the larger one, but for how much their points leave straight lines, and for a
  quarter of the way that the turn of each body moves its far end: other points may be nearest at the
  other end;
* the same root of the closed form has a negative radicand, by more than it bends in between, or the branch is
  known to reach the pose nowhere in between (see `symgrasp.ik.spans`).

Where two branches end in a root, they are one curve: it is excluded from one branch to the other. It leads
away from both by as far as joints change with φ up to the root, which is anywhere in the part (`DRIFT`).

By how much joints and links bend is not proven, but measured on the curves of arms.
"""

from __future__ import annotations

import math

from symgrasp.collision.distance import distance_bounds
from symgrasp.compiling import njit
from symgrasp.engine.checks import HIT_BAND
from symgrasp.engine.kinematics import compose, place_frames
from symgrasp.ik.spans import span_over
from symgrasp.ik.vectors import STRICT
from symgrasp.robot.limits import LIMIT_TOLERANCE

__all__ = [
    "EXCLUDED",
    "FALLS",
    "FIRM",
    "GONE",
    "HARD",
    "HITS",
    "OUTSIDE",
    "SKIPPED",
    "SOFT",
    "STUCK",
    "UNSURE",
    "copy_pose",
    "what_is_known",
]

UNKNOWN = 0.05
"""Width (rad) up to which a part is excluded on which a branch exists at neither end and no radicand is
known."""

GONE, OUTSIDE, HITS, FALLS, STUCK, UNSURE, SKIPPED = range(7)
"""States of a branch at a value of φ: it does not exist, is outside the limits, collides, the robot falls,
the retreat is blocked, only PyBullet can decide, or it is excluded all around there."""

SAME_CURVE = 0.7
"""Largest difference (rad) of joints of two configurations that are taken for ends of one smooth curve."""

BEND, LEAST_BEND = 0.5, 0.08
"""By how much joint values leave the range of their values at both ends of a curve: for the square of the
largest difference of any joint (1/rad), and for that difference."""

SAGITTA = 0.25
"""By how much (m/rad²) points of the arm leave a straight line between their places at both ends of a
curve, for the square of the sum of the differences of the joints that move them."""

LEAST_SAGITTA = 0.04
"""The same, at least, where a trial shows that they leave it by less."""

TRIED = 3.0
"""By how much more they may leave it than half way between the joint values at both ends: the curve itself is
not straight either."""

DRIFT = 8.0
"""By how much (rad/rad) joints change with φ at most, apart from what two branches are apart that end in the
same root: the curve from one to the other leads away from both, for at most the width of the part."""

ARM = 0.5
"""By how much (m/rad) points of the arm move with a joint, there."""

RADICAND_BEND = 1.0
"""The same (1/rad²) for radicands, for the square of the width of a part."""

HARD, FIRM, SOFT, EXCLUDED = 0, 1, 2, 3
"""What is known of a part of the range: nothing, that both ends fail in a way of which no measure is known
(balance, the retreat), that pieces all but touch at both, or that nothing is free."""


@njit(**STRICT)
def what_is_known(nodes, scratch, moving, pieces, inputs, covered, left, right, width):
    """Return what is known of the part of the range between two slots, and write down what is excluded."""
    least = EXCLUDED
    for b in range(nodes.state.shape[1]):
        if nodes.excluded[right, b]:
            continue
        here, there = nodes.state[left, b] != GONE, nodes.state[right, b] != GONE
        known = EXCLUDED
        if here and there and _stays_outside(nodes, left, right, b):
            pass
        elif here:
            known = _curve(nodes, scratch, moving, pieces, inputs, covered, left, right, b, width)
        elif not there:
            known = _none(nodes, left, right, b, width)
        if known != HARD and there and not (here and _is_near(nodes, left, b, right, b)):
            back = _curve(nodes, scratch, moving, pieces, inputs, covered, right, left, b, width)
            known = min(known, back)
        least = min(least, known)
        if not covered.locked.spherical:  # whose branches may change places
            if least == HARD:
                return HARD
        elif known == EXCLUDED:
            nodes.excluded[right, b] = True
    return least


@njit(**STRICT)
def _stays_outside(nodes, left, right, b):
    """Whether a branch that is there at both ends of a part is outside its limits all along it."""
    apart = _apart(nodes, left, b, right, b, SAME_CURVE)
    bend = (BEND * apart + LEAST_BEND) * apart
    return apart < SAME_CURVE and _limits_exclude(nodes, left, b, right, b, bend)


@njit(**STRICT)
def _none(nodes, left, right, b, width):
    """Return what is known of a branch that exists at neither end of a part, from what is missing there."""
    here, there = nodes.missing[left, b], nodes.missing[right, b]
    if here == 0.0 or there == 0.0:
        return EXCLUDED if width <= UNKNOWN else HARD
    root, other = _root(here), _root(there)
    half = b // 4
    if max(root, other) <= 2 and nodes.spans.number[half] >= 0:
        return HARD if span_over(nodes.spans, half, nodes.phi[left], nodes.phi[right]) else EXCLUDED
    first, second = -(here + 10.0 * root), -(there + 10.0 * other)
    if root == other:
        bend = RADICAND_BEND * width * width + 0.1 * abs(first - second)
        return EXCLUDED if min(first, second) > bend else HARD
    # Where an earlier root ends, later radicands change like the square root of φ.
    later = first if root > other else second
    return EXCLUDED if later > 1.5 * math.sqrt(width) else HARD


@njit(**STRICT)
def _root(missing):
    """Return the number of the root of which `symgrasp.ik.joints.miss` was told."""
    return math.floor(-missing / 10.0)


@njit(**STRICT)
def _apart(nodes, one, a, other, b, enough):
    """Return the largest difference (rad) of the joints of two configurations, or one that is ``enough``."""
    most = 0.0
    for j in range(nodes.q.shape[2]):
        most = max(most, abs(_turn(nodes.q[other, b, j] - nodes.q[one, a, j])))
        if most >= enough:
            break
    return most


@njit(**STRICT)
def _is_near(nodes, one, a, other, b):
    """Whether two configurations are so near that they are taken for ends of one smooth curve."""
    return _apart(nodes, one, a, other, b, SAME_CURVE) < SAME_CURVE


@njit(**STRICT)
def _turn(angle):
    """Return an angle (rad) less full turns, from -π to π."""
    if -math.pi <= angle < math.pi:  # the rule, and quicker
        return angle
    return angle - 2.0 * math.pi * math.floor(angle / (2.0 * math.pi) + 0.5)


@njit(**STRICT)
def _curve(nodes, scratch, moving, pieces, inputs, covered, one, other, a, width):
    """Return what is known of the curve that starts with a branch at one end of a part.

    It leads to the nearest configuration: at the other end, or at this one where both end in between.
    """
    if nodes.state[other, a] != GONE and _is_near(nodes, one, a, other, a):
        return _between(nodes, scratch, moving, pieces, inputs, covered, one, a, other, a, width)
    nearest, at, least = -1, other, SAME_CURVE
    for k in range(nodes.state.shape[1]):
        if covered.locked.spherical:
            if k == 3:
                break
            b = a ^ (1 << k)  # the other value of one root
        else:
            b = k
        if nodes.state[other, b] != GONE:
            apart = _apart(nodes, one, a, other, b, least)
            if apart < least:
                nearest, at, least = b, other, apart
        elif b != a and nodes.state[one, b] != GONE and nodes.state[other, a] == GONE:
            apart = _apart(nodes, one, a, one, b, least)
            if apart < least:
                nearest, at, least = b, one, apart
    if nearest < 0:
        return HARD
    return _between(nodes, scratch, moving, pieces, inputs, covered, one, a, at, nearest, width)


@njit(**STRICT)
def _between(nodes, scratch, moving, pieces, inputs, covered, one, a, other, b, width):
    """Return what is known of a curve between two configurations: slots and branches."""
    apart = _apart(nodes, one, a, other, b, math.inf)
    ahead = DRIFT * width if other == one else 0.0  # both ends are at one side, the root is anywhere
    if _limits_exclude(nodes, one, a, other, b, (BEND * apart + LEAST_BEND) * apart + ahead):
        return EXCLUDED
    ahead *= ARM
    first, second = nodes.state[one, a], nodes.state[other, b]
    if first == HITS and _pair_excludes(
        nodes, scratch, moving, pieces, inputs, covered, one, a, other, b, ahead
    ):
        return EXCLUDED
    if second == HITS and _pair_excludes(
        nodes, scratch, moving, pieces, inputs, covered, other, b, one, a, ahead
    ):
        return EXCLUDED
    if first < FALLS or second < FALLS:
        return HARD
    return SOFT if first == UNSURE and second == UNSURE else FIRM


@njit(**STRICT)
def _limits_exclude(nodes, one, a, other, b, bend):
    """Whether one joint is outside of its limits all along a curve, which may bend by an angle (rad)."""
    limits = nodes.chain.limits
    for j in range(nodes.q.shape[2]):
        half = 0.5 * (limits[1, j] - limits[0, j])
        if not half < math.pi:
            continue
        here = _turn(nodes.q[one, a, j] - limits[2, j])
        there = _turn(nodes.q[other, b, j] - limits[2, j])
        outside = min(abs(here), abs(there)) - half - LIMIT_TOLERANCE
        aside = here * there > 0.0 or abs(here) + abs(there) >= math.pi  # not through the range
        if outside > bend and aside:
            return True
    return False


@njit(**STRICT)
def _pair_excludes(nodes, scratch, moving, pieces, inputs, covered, one, a, other, b, ahead):
    """Whether the pair that collides at one end of a curve does so all along it.

    Args:
        ahead: how far (m) the curve may lead away from both of its ends.
    """
    first, second = nodes.pair[one, a, 0], nodes.pair[one, a, 1]
    last = -1
    for side in range(2):
        piece = nodes.pair[one, a, side]
        if moving.hand.shape[1] <= piece < len(moving.frame):
            last = max(last, moving.frame[piece])
    way = 0.0
    for j in range(last + 1):
        way += abs(_turn(nodes.q[other, b, j] - nodes.q[one, a, j]))
    least = LEAST_SAGITTA * way * way + ahead
    if not _deeper(nodes, scratch, moving, pieces, inputs, covered, one, a, least):
        return False
    alike = (
        nodes.state[other, b] == HITS
        and nodes.pair[other, b, 0] == first
        and nodes.pair[other, b, 1] == second
    )
    if alike and not _deeper(nodes, scratch, moving, pieces, inputs, covered, other, b, least):
        return False
    if alike:
        for side in range(2):
            copy_pose(nodes.pose[other, b, side], nodes.end[side])
    else:
        place_frames(moving, nodes.q[other, b], scratch.frames)
        for side in range(2):
            piece = nodes.pair[one, a, side]
            if moving.hand.shape[1] <= piece < len(moving.frame):
                compose(scratch.frames[moving.frame[piece]], moving.local[piece], nodes.end[side])
            else:
                copy_pose(scratch.pose[piece], nodes.end[side])
    turned = 0.0
    for side in range(2):
        angle = _turned(nodes.pose[one, a, side], nodes.end[side])
        turned += 0.25 * angle * _length(pieces.size, nodes.pair[one, a, side])
    bend = SAGITTA * way * way + ahead
    if nodes.depth[one, a] <= bend + turned or (alike and nodes.depth[other, b] <= bend + turned):
        bend = min(bend, least + _bent(nodes, scratch, moving, pieces, one, a, other, b))
    bend += turned
    if not _deeper(nodes, scratch, moving, pieces, inputs, covered, one, a, bend):
        return False
    if alike:
        return _deeper(nodes, scratch, moving, pieces, inputs, covered, other, b, bend)
    for side in range(2):
        copy_pose(nodes.end[side], scratch.pose[nodes.pair[one, a, side]])
    for level in range(len(covered.inner)):
        if _depth(scratch, moving, pieces, inputs, covered, first, second, level, bend) > bend:
            return True
    return False


@njit(**STRICT)
def _bent(nodes, scratch, moving, pieces, one, a, other, b):
    """Return by how much (m) the pieces of a pair leave straight lines, as far as a trial shows.

    The poses of the pieces half way between the joint values at both ends are compared with the mean of those
    at both ends, ``nodes.end`` at the other one.
    """
    for j in range(nodes.q.shape[2]):
        nodes.half[j] = nodes.q[one, a, j] + 0.5 * _turn(nodes.q[other, b, j] - nodes.q[one, a, j])
    place_frames(moving, nodes.half, scratch.frames)
    total = 0.0
    for side in range(2):
        piece = nodes.pair[one, a, side]
        if not moving.hand.shape[1] <= piece < len(moving.frame):
            continue
        pose, here, there = nodes.middle, nodes.pose[one, a, side], nodes.end[side]
        compose(scratch.frames[moving.frame[piece]], moving.local[piece], pose)
        for i in range(12):
            pose[i] -= 0.5 * (here[i] + there[i])
        turn = shift = 0.0
        for i in range(3):
            along = pose[9 + i]
            for j in range(3):
                turn += pose[3 * i + j] ** 2
                along += pose[3 * i + j] * pieces.size[piece, 3 + j]
            shift += along * along
        total += math.sqrt(shift) + 0.5 * math.sqrt(turn) * _length(pieces.size, piece)
    return TRIED * total


@njit(**STRICT)
def _deeper(nodes, scratch, moving, pieces, inputs, covered, at, b, depth):
    """Whether the pair that a candidate hits collides deeper than ``depth`` (m)."""
    first, second = nodes.pair[at, b, 0], nodes.pair[at, b, 1]
    while nodes.depth[at, b] <= depth:
        level = nodes.level[at, b]
        if level == len(covered.inner):
            return False
        copy_pose(nodes.pose[at, b, 0], scratch.pose[first])
        copy_pose(nodes.pose[at, b, 1], scratch.pose[second])
        known = _depth(scratch, moving, pieces, inputs, covered, first, second, level, 0.0)
        nodes.depth[at, b], nodes.level[at, b] = max(nodes.depth[at, b], known), level + 1
    return True


@njit(**STRICT)
def copy_pose(pose, out):
    """Copy a pose (12,)."""
    for i in range(12):
        out[i] = pose[i]


@njit(**STRICT)
def _turned(pose, other):
    """Return an upper bound of the angle (rad) between two poses (12,), up to a right angle."""
    total = 0.0
    for i in range(9):
        total += (pose[i] - other[i]) ** 2
    return 1.12 * math.sqrt(0.5 * total)


@njit(**STRICT)
def _length(size, k):
    """Return the largest distance (m) of two points of a piece."""
    x, y, z = size[k, 6], size[k, 7], size[k, 8]
    return 2.0 * (math.sqrt(x * x + y * y + z * z) + size[k, 0])


@njit(**STRICT)
def _depth(scratch, moving, pieces, inputs, covered, first, second, level, least):
    """Return by how much (m) more than it takes two pieces are certain to collide.

    Where they do by less than ``least`` (m), it may return anything less.

    Args:
        level: which of the bodies inside the pieces tell.
    """
    bar = -HIT_BAND - pieces.size[first, 1] - pieces.size[second, 1]
    if second > moving.objects[-1]:
        bar += inputs.margin
    if bar == -math.inf:
        return -1.0
    _, upper = distance_bounds(
        covered.inner[level], scratch.pose, first, second, bar - least, -math.inf, -math.inf, scratch.simplex
    )
    return bar - upper
