"""What excludes a branch on a part of the range of the redundancy φ, from its two ends. Compiled.

A branch is excluded on a part by what is the matter with it at both ends:

* the same joint is outside its limits by more than joints deviate from a straight line in between;
* the same pair of pieces collides (see `symgrasp.engine.redundancy.pair_exclusion`);
* the robot falls over the same edge of its support, by more than points deviate from a straight line;
* one of these is the matter at the same step of the retreat, or no branch leads on there;
* the same root of the closed form has a negative radicand, by more than it bends in between, or the branch is
  known to reach the pose nowhere in between (see `symgrasp.ik.spans`).

Where two branches end in a root, they are one curve: it is excluded from one branch to the other. It leads
away from both by as far as joints change with φ up to the root, which is anywhere in the part (`DRIFT`).

By how much joints and links bend is not proven, but measured on the curves of arms.
"""

from __future__ import annotations

import math

from symgrasp.compiling import njit
from symgrasp.engine.redundancy.cover_types import FALLS, GONE, HITS, STOPS, TOUCHES
from symgrasp.engine.redundancy.pair_exclusion import SAGITTA, pair_excludes
from symgrasp.engine.redundancy.vectors import SAME_CURVE, largest_turn, wrapped
from symgrasp.ik.retreat import RETREAT_TURN
from symgrasp.ik.spans import span_over
from symgrasp.ik.vectors import STRICT
from symgrasp.robot.limits import LIMIT_TOLERANCE

__all__ = ["BEND", "EXCLUDED", "HARD", "LEAST_BEND", "TOUCHING", "what_is_known"]

UNKNOWN = 0.05
"""Width (rad) up to which a part is excluded on which a branch exists at neither end and no radicand is
known."""

BEND, LEAST_BEND = 0.5, 0.08
"""By how much joint values leave the range of their values at both ends of a curve: for the square of the
largest difference of any joint (1/rad), and for that difference."""

FAR = 0.3
"""Largest difference (rad) of joints, at both ends of a part, on the retreat where no branch leads on."""

DRIFT = 8.0
"""By how much (rad/rad) joints change with φ at most, apart from what two branches are apart that end in the
same root: the curve from one to the other leads away from both, for at most the width of the part."""

ARM = 0.5
"""By how much (m/rad) points of the arm move with a joint, there."""

RADICAND_BEND = 1.0
"""The same (1/rad²) for radicands, for the square of the width of a part."""

HARD, TOUCHING, EXCLUDED = range(3)
"""What is known of a part of the range: nothing, that a pair of pieces overlaps all along it, by less than
PyBullet may be off, or that nothing is free."""


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
    here, there = nodes.q[left, b], nodes.q[right, b]
    apart = largest_turn(here, there, SAME_CURVE)
    return apart < SAME_CURVE and _limits_exclude(nodes, here, there, _bend(apart))


@njit(**STRICT)
def _bend(apart):
    """Return by how much (rad) joints leave straight lines whose ends are an angle (rad) apart."""
    return (BEND * apart + LEAST_BEND) * apart


@njit(**STRICT)
def _none(nodes, left, right, b, width):
    """Return what is known of a branch that exists at neither end of a part, from what is missing there."""
    here, there = nodes.missing[left, b], nodes.missing[right, b]
    half = b // 4
    if here != 0.0 and there != 0.0 and max(_root(here), _root(there)) <= 2 and nodes.spans.number[half] >= 0:
        return HARD if span_over(nodes.spans, half, nodes.phi[left], nodes.phi[right]) else EXCLUDED
    return EXCLUDED if _radicand_is_negative(here, there, width) else HARD


@njit(**STRICT)
def _radicand_is_negative(here, there, width):
    """Whether what is missing of a branch at both ends of a part is missing all along it."""
    if here == 0.0 or there == 0.0:
        return width <= UNKNOWN
    root, other = _root(here), _root(there)
    first, second = -(here + 10.0 * root), -(there + 10.0 * other)
    if root == other:
        bend = RADICAND_BEND * width * width + 0.1 * abs(first - second)
        return min(first, second) > bend
    # Where an earlier root ends, later radicands change like the square root of φ.
    later = first if root > other else second
    return later > 1.5 * math.sqrt(width)


@njit(**STRICT)
def _root(missing):
    """Return the number of the root of which `symgrasp.ik.joints.miss` was told."""
    return math.floor(-missing / 10.0)


@njit(**STRICT)
def _is_near(nodes, one, a, other, b):
    """Whether two configurations are so near that they are taken for ends of one smooth curve."""
    return largest_turn(nodes.q[one, a], nodes.q[other, b], SAME_CURVE) < SAME_CURVE


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
            apart = largest_turn(nodes.q[one, a], nodes.q[other, b], least)
            if apart < least:
                nearest, at, least = b, other, apart
        elif b != a and nodes.state[one, b] != GONE and nodes.state[other, a] == GONE:
            apart = largest_turn(nodes.q[one, a], nodes.q[one, b], least)
            if apart < least:
                nearest, at, least = b, one, apart
    if nearest < 0:
        return HARD
    return _between(nodes, scratch, moving, pieces, inputs, covered, one, a, at, nearest, width)


@njit(**STRICT)
def _between(nodes, scratch, moving, pieces, inputs, covered, one, a, other, b, width):
    """Return what is known of a curve between two configurations: slots and branches."""
    here, there = nodes.q[one, a], nodes.q[other, b]
    ahead = DRIFT * width if other == one else 0.0  # both ends are at one side, the root is anywhere
    if _limits_exclude(nodes, here, there, _bend(largest_turn(here, there, math.inf)) + ahead):
        return EXCLUDED
    first, second = nodes.state[one, a], nodes.state[other, b]
    parts = nodes, scratch, moving, pieces, inputs, covered
    if first == HITS and pair_excludes(*parts, one, a, other, b, ARM * ahead):
        return EXCLUDED
    if second == HITS and pair_excludes(*parts, other, b, one, a, ARM * ahead):
        return EXCLUDED
    if first == FALLS and second == FALLS and _falls_between(nodes, one, a, other, b, ARM * ahead):
        return EXCLUDED
    if first == STOPS and second == STOPS:
        spherical = covered.locked.spherical
        if _stops_between(nodes, inputs, spherical, one, a, other, b, ahead, width):
            return EXCLUDED
    if first == TOUCHES and pair_excludes(*parts, one, a, other, b, ARM * ahead):
        return TOUCHING
    if second == TOUCHES and pair_excludes(*parts, other, b, one, a, ARM * ahead):
        return TOUCHING
    return HARD


@njit(**STRICT)
def _limits_exclude(nodes, here, there, bend):
    """Whether one joint is outside its limits all along a curve, which may bend by an angle (rad)."""
    limits = nodes.chain.limits
    for j in range(len(here)):
        half = 0.5 * (limits[1, j] - limits[0, j])
        if not half < math.pi:
            continue
        off, off_there = wrapped(here[j] - limits[2, j]), wrapped(there[j] - limits[2, j])
        outside = min(abs(off), abs(off_there)) - half - LIMIT_TOLERANCE
        aside = off * off_there > 0.0 or abs(off) + abs(off_there) >= math.pi  # not through the range
        if outside > bend and aside:
            return True
    return False


@njit(**STRICT)
def _falls_between(nodes, one, a, other, b, ahead):
    """Whether the robot, which falls at both ends of a curve, falls over the same edge all along it.

    Its centre of mass bends no more than points of the arm do, of which each weighs a part of all.
    """
    step = nodes.step[one, a]
    for side in range(2):
        if nodes.pair[one, a, side] != nodes.pair[other, b, side]:
            return False
    if nodes.step[other, b] != step:
        return False
    here, there = nodes.q[one, a], nodes.q[other, b]
    if step > 0:
        here, there = nodes.there[one, a], nodes.there[other, b]
    way = 0.0
    for j in range(len(here)):
        way += abs(wrapped(there[j] - here[j]))
    return min(nodes.depth[one, a], nodes.depth[other, b]) > SAGITTA * way * way + ahead


@njit(**STRICT)
def _stops_between(nodes, inputs, spherical, one, a, other, b, ahead, width):
    """Whether the retreat, on which no branch leads on at both ends of a curve, stops all along it.

    No branch exists there, it is too far away, or one of its joints is outside its limits or turns too far.
    """
    if nodes.step[one, a] != nodes.step[other, b]:
        return False
    before, before_there = nodes.there[one, a], nodes.there[other, b]
    apart = largest_turn(before, before_there, FAR)
    if apart >= FAR:
        return False
    slack = _bend(apart) + ahead
    exist = 0
    for k in range(nodes.absent.shape[2]):
        if nodes.absent[one, a, k]:
            if nodes.absent[other, b, k]:
                if not _radicand_is_negative(nodes.lacking[one, a, k], nodes.lacking[other, b, k], width):
                    return False
            elif spherical:
                return False
            continue
        here = nodes.onward[one, a, k]
        m, least = _nearest_onward(nodes, here, other, b, k if spherical else -1)
        if m < 0:
            return False
        exist += 1
        there = nodes.onward[other, b, m]
        away = min(largest_turn(before, here, math.inf), largest_turn(before_there, there, math.inf))
        if away > RETREAT_TURN + 2.0 * FAR + ahead:
            continue
        bend = _bend(least) + ahead
        if _limits_exclude(nodes, here, there, bend):
            continue
        if not _turns_too_far(inputs.turns, before, before_there, here, there, bend + slack):
            return False
    for k in range(nodes.absent.shape[2]):
        exist -= not nodes.absent[other, b, k]
    return exist == 0


@njit(**STRICT)
def _nearest_onward(nodes, q, at, b, only):
    """Return which branch to which none leads on is nearest to a configuration (n,), and how near (rad).

    It is -1 where none is near enough, and ``only`` is the one that it may be, if it is known.
    """
    nearest, least = -1, FAR
    for k in range(nodes.absent.shape[2]):
        if nodes.absent[at, b, k] or (only >= 0 and k != only):
            continue
        apart = largest_turn(q, nodes.onward[at, b, k], least)
        if apart < least:
            nearest, least = k, apart
    return nearest, least


@njit(**STRICT)
def _turns_too_far(turns, before, before_there, here, there, bend):
    """Whether a joint turns further than it may in one step of the retreat at both ends of a curve."""
    for j in range(len(turns)):
        turned, turned_there = wrapped(here[j] - before[j]), wrapped(there[j] - before_there[j])
        if turned * turned_there > 0.0 and min(abs(turned), abs(turned_there)) > turns[j] + bend:
            return True
    return False
