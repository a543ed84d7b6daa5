"""The search that covers the redundancy φ of infeasible cells: it steps over nothing that is free. Compiled.

The range of φ is divided into parts, and a part is halved until every branch is excluded on it, or it is
narrower than `FINEST`. A branch is excluded on a part by what is the matter with it at both ends:

* the same joint is outside its limits by more than joints deviate from a straight line in between;
* the same pair of pieces collides, deeper than their motion deviates from a straight line (see
  `symgrasp.engine.inner_pieces` for how deep). Between two ends, the distance of two convex bodies along a
  fixed direction is at most the larger one, but for how much their points leave straight lines, and for a
  quarter of the way that the turn of each body moves its far end: other points may be nearest at the
  other end;
* the same root of the closed form has a negative radicand, by more than it bends in between.

Where two branches end in a root, they are one curve: it is excluded from one branch to the other.

By how much curves bend is bounded by what is usual for arms, not by a proof: so an infeasible cell is
infeasible to the resolution of the parts that were left. What does not depend on φ is proven: a hand that
collides, and a pose further away than the arm ever reaches.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from symgrasp.compiling import ENTRY, njit
from symgrasp.engine.balance import stands
from symgrasp.engine.checks import FREE_BAND, HIT_BAND, UNDECIDED, check_arm
from symgrasp.engine.cover_types import OPEN_KEPT, CoverInput, CoverResult, new_nodes
from symgrasp.engine.distance import distance_bounds
from symgrasp.engine.kinematics import MovingPieces, Scratch, copied, place_arm, place_hand
from symgrasp.engine.pieces import PackedPieces
from symgrasp.engine.retreat_search import arm_retreats, copy_row, tool_clearance, tool_retreats
from symgrasp.engine.search_types import (
    BLOCKED,
    FEASIBLE,
    RETREAT_UNDECIDED,
    Balance,
    RowChecks,
    SearchInput,
    new_branches,
)
from symgrasp.engine.threads import in_parallel
from symgrasp.engine.tree import Tree
from symgrasp.ik.at_phi import geometry_at
from symgrasp.ik.branches import branch_count, branches_at
from symgrasp.ik.chain import Chain
from symgrasp.ik.spherical import reach_cosine
from symgrasp.ik.vectors import STRICT

__all__ = ["COARSE", "FINEST", "cover"]

FINEST = 1e-4
"""Width (rad) of a part of the range of φ that is not halved any more."""

COARSE = 3e-3
"""The same where both ends fail in a way of which no measure is known: balance, the retreat, pieces that
all but touch."""

UNKNOWN = 0.05
"""The same where a branch exists at neither end, and no radicand is known."""

GONE, OUTSIDE, HITS, FALLS, STUCK, UNSURE, SKIPPED = range(7)
"""States of a branch at a value of φ: it does not exist, is outside the limits, collides, the robot falls,
the retreat is blocked, only PyBullet can decide, or it is excluded all around there."""

SAME_CURVE = 0.7
"""Largest difference (rad) of joints of two configurations that are taken for ends of one smooth curve."""

BEND = 1.5
"""By how much (1/rad) joint values leave the range of their values at both ends of a curve, for the square
of the largest difference of any joint."""

SAGITTA = 0.25
"""By how much (m/rad²) points of the arm leave a straight line between their places at both ends of a
curve, for the square of the sum of the differences of the joints that move them."""

RADICAND_BEND = 1.0
"""The same (1/rad²) for radicands, for the square of the width of a part."""

MOST_VISITED = 20_000
"""Values of φ of a cell after which the search gives up."""

HARD, SOFT, EXCLUDED = 0, 1, 2
"""What is known of a part of the range: nothing, nothing that a measure is known of, or that nothing is
free."""


def cover(
    chain: Chain,
    moving: MovingPieces,
    pieces: PackedPieces,
    tree: Tree,
    scratch: Scratch,
    inputs: SearchInput,
    balance: Balance,
    rows: RowChecks,
    covered: CoverInput,
    joints: int,
) -> CoverResult:
    """Search all of φ for free configurations of some cells, on all cores.

    Args:
        chain, moving, pieces, tree, scratch, inputs, balance, joints: see `symgrasp.engine.search.search`.
        rows: the row checks of that search.
        covered: what to cover.
    """
    c = len(covered.cells)
    result = CoverResult(
        found=np.zeros(c, dtype=bool),
        q=np.full((c, joints), np.nan),
        phi=np.full(c, np.nan),
        branch=np.full(c, -1, dtype=np.int16),
        clearance=np.full(c, np.nan),
        proven=np.zeros(c, dtype=bool),
        left=np.zeros(c),
        visited=np.zeros(c, dtype=np.int64),
        undecided_count=np.zeros(c, dtype=np.int32),
        undecided_phi=np.empty((c, OPEN_KEPT)),
        undecided_branch=np.empty((c, OPEN_KEPT), dtype=np.int16),
    )
    own = [
        (
            new_nodes(chain, branch_count(chain), joints),
            copied(scratch),
            new_branches(chain, joints, len(inputs.retreat), len(moving.frame)),
        )
        for _ in range(inputs.parts)
    ]

    def cover_part(part: int) -> None:
        _cover_part(*own[part], moving, pieces, tree, inputs, balance, rows, covered, result, part)

    cover_part(0)
    in_parallel(partial(cover_part), range(1, inputs.parts))
    return result


@njit(**ENTRY)
def _cover_part(nodes, scratch, branches, moving, pieces, tree, inputs, balance, rows, covered, result, part):
    """Cover the cells of one part; parts are interleaved."""
    for i in range(part, len(covered.cells), inputs.parts):
        _cover_cell(nodes, scratch, branches, moving, pieces, tree, inputs, balance, rows, covered, result, i)


@njit(**STRICT)
def _cover_cell(nodes, scratch, branches, moving, pieces, tree, inputs, balance, rows, covered, result, i):
    """Cover one cell and write its result."""
    cell = covered.cells[i]
    T, run = inputs.T_base_tool[cell], cell * len(inputs.row) // len(inputs.T_base_tool)
    locked = covered.locked
    if _out_of_reach(nodes, locked, T):
        result.proven[i] = True
        return
    hand = tool_clearance(moving, pieces, tree, scratch, inputs, rows, run, T)
    if hand == -math.inf:
        result.proven[i] = True
        return
    tool = FEASIBLE
    if len(inputs.retreat):
        tool = tool_retreats(moving, pieces, tree, scratch, branches, inputs, rows, run, T)
        place_hand(moving, pieces, scratch, inputs.T_world_base, T, inputs.row[run])
        if tool == BLOCKED:
            result.proven[i] = True
            return
    scratch.hit[2] = -1
    nodes.used[:] = False
    step = (locked.upper - locked.lower) / covered.first
    left = _slot(nodes)
    nodes.excluded[left] = False
    those = i, T, inputs.row[run], hand, tool
    free = _visit(
        nodes, scratch, branches, moving, pieces, tree, inputs, balance, covered, result, run, those, left,
        locked.lower,
    )  # fmt: skip
    for k in range(covered.first):
        if free:
            return
        nodes.stack[0] = _slot(nodes)
        nodes.excluded[nodes.stack[0]] = False
        count = 1
        free = _visit(
            nodes, scratch, branches, moving, pieces, tree, inputs, balance, covered, result, run, those,
            nodes.stack[0], locked.lower + (k + 1) * step,
        )  # fmt: skip
        while count > 0 and not free:
            right = nodes.stack[count - 1]
            width = nodes.phi[right] - nodes.phi[left]
            known = _known(nodes, scratch, moving, pieces, inputs, covered, left, right, width)
            if known != EXCLUDED:
                ends = width <= FINEST or (known == SOFT and width <= COARSE)
                if not ends and result.visited[i] < MOST_VISITED:
                    middle = _slot(nodes)
                    nodes.stack[count] = middle
                    copy_row(nodes.excluded[right], nodes.excluded[middle])
                    count += 1
                    free = _visit(
                        nodes, scratch, branches, moving, pieces, tree, inputs, balance, covered, result, run,
                        those, middle, 0.5 * (nodes.phi[left] + nodes.phi[right]),
                    )  # fmt: skip
                    continue
                result.left[i] = max(result.left[i], width)
            nodes.used[left] = False
            left = right
            count -= 1


@njit(**STRICT)
def _slot(nodes):
    """Take a free slot and return it."""
    k = 0
    while nodes.used[k]:
        k += 1
    nodes.used[k] = True
    return k


@njit(**STRICT)
def _out_of_reach(nodes, locked, T):
    """Whether a pose (4, 4) is further away than the arm reaches at any φ; else it may be, too.

    Where all free joints are on one side of the locked one, the cosine that joint 4 needs is a trigonometric
    polynomial of φ of degree 2, so five values determine it.
    """
    if not locked.spherical:
        return False
    for k in range(1, 6):
        if locked.after[k] != locked.after[0]:
            return False
    mean = c1 = s1 = c2 = s2 = 0.0
    for k in range(5):
        angle = 0.4 * math.pi * k
        geometry_at(locked, angle, nodes.chain.geometry[0])
        value = 0.2 * reach_cosine(nodes.chain.geometry[0], nodes.chain.joint, T)
        mean += value
        c1 += 2.0 * value * math.cos(angle)
        s1 += 2.0 * value * math.sin(angle)
        c2 += 2.0 * value * math.cos(2.0 * angle)
        s2 += 2.0 * value * math.sin(2.0 * angle)
    return abs(mean) - math.sqrt(c1 * c1 + s1 * s1) - math.sqrt(c2 * c2 + s2 * s2) > 1.0 + 1e-9


@njit(**STRICT)
def _visit(
    nodes, scratch, branches, moving, pieces, tree, inputs, balance, covered, result, run, those, at, phi
):
    """Check all candidates of a cell at a value of φ, and write them into slot ``at``.

    Args:
        run: index of the cell's run.
        those: what is known of the cell: its index, tool pose (4, 4) and row, the clearance (m) of the
            pieces that are fixed to the tool, and what `tool_retreats` says of their retreat.

    Returns:
        Whether one is free; it is then in the result.
    """
    i, T, row, hand, tool = those
    q, exists, inside = branches.q[0], branches.exists[0], branches.inside[0]
    result.visited[i] += 1
    nodes.phi[at] = phi
    geometry_at(covered.locked, phi, nodes.chain.geometry[0])
    branches_at(nodes.chain, 0, T, False, q, exists, inside, branches.memory)
    falls = len(balance.edges) > 0
    for b in range(len(exists)):
        nodes.missing[at, b] = branches.memory.missing[b]
    for b in range(len(exists)):
        nodes.state[at, b] = SKIPPED if nodes.excluded[at, b] else GONE
        if nodes.excluded[at, b] or not exists[b]:
            continue
        copy_row(q[b], nodes.q[at, b])
        nodes.state[at, b] = OUTSIDE
        if not inside[b]:
            continue
        place_arm(moving, pieces, scratch, q[b])
        if falls and not stands(balance, scratch.frames, inputs.T_world_base, T, row, True):
            nodes.state[at, b] = FALLS
            continue
        gap = check_arm(moving, pieces, tree, scratch, inputs.margin, hand, -math.inf)
        if gap == -math.inf:
            nodes.state[at, b] = HITS
            for side in range(2):
                piece = scratch.hit[side]
                nodes.pair[at, b, side] = piece
                _copy_pose(scratch.pose[piece], nodes.pose[at, b, side])
            nodes.depth[at, b], nodes.level[at, b] = -1.0, 0
            continue
        if gap != UNDECIDED and len(inputs.retreat):
            furthest = arm_retreats(
                nodes.chain, moving, pieces, tree, scratch, branches, inputs, balance, run, T, 0, b, tool
            )
            place_hand(moving, pieces, scratch, inputs.T_world_base, T, row)
            if furthest == BLOCKED:
                nodes.state[at, b] = STUCK
                continue
            if furthest == RETREAT_UNDECIDED:
                gap = UNDECIDED
        if gap == UNDECIDED:
            nodes.state[at, b] = UNSURE
            kept = result.undecided_count[i]
            result.undecided_count[i] += 1
            if kept < OPEN_KEPT:
                result.undecided_phi[i, kept], result.undecided_branch[i, kept] = phi, b
            continue
        result.found[i], result.phi[i], result.branch[i] = True, phi, b
        result.clearance[i] = max(0.0, gap - FREE_BAND)
        copy_row(q[b], result.q[i])
        return True
    return False


@njit(**STRICT)
def _known(nodes, scratch, moving, pieces, inputs, covered, left, right, width):
    """Return what is known of the part of the range between two slots, and write down what is excluded."""
    least = EXCLUDED
    for b in range(nodes.state.shape[1]):
        if nodes.excluded[right, b]:
            continue
        here, there = nodes.state[left, b] != GONE, nodes.state[right, b] != GONE
        known = EXCLUDED
        if here:
            known = _curve(nodes, scratch, moving, pieces, inputs, covered, left, right, b)
        elif not there:
            known = _none(nodes.missing[left, b], nodes.missing[right, b], width)
        if known != HARD and there and not (here and _apart(nodes, left, b, right, b) <= SAME_CURVE):
            known = min(known, _curve(nodes, scratch, moving, pieces, inputs, covered, right, left, b))
        least = min(least, known)
        if not covered.locked.spherical:  # whose branches may change places
            if least == HARD:
                return HARD
        elif known == EXCLUDED:
            nodes.excluded[right, b] = True
    return least


@njit(**STRICT)
def _none(here, there, width):
    """Return what is known of a branch that exists at neither end of a part, from what is missing there."""
    if here == 0.0 or there == 0.0:
        return EXCLUDED if width <= UNKNOWN else HARD
    root, other = _root(here), _root(there)
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
def _apart(nodes, one, a, other, b):
    """Return the largest difference (rad) of the joints of two configurations."""
    most = 0.0
    for j in range(nodes.q.shape[2]):
        most = max(most, abs(_turn(nodes.q[other, b, j] - nodes.q[one, a, j])))
    return most


@njit(**STRICT)
def _turn(angle):
    """Return an angle (rad) less full turns, from -π to π."""
    return angle - 2.0 * math.pi * math.floor(angle / (2.0 * math.pi) + 0.5)


@njit(**STRICT)
def _curve(nodes, scratch, moving, pieces, inputs, covered, one, other, a):
    """Return what is known of the curve that starts with a branch at one end of a part.

    It leads to the nearest configuration: at the other end, or at this one where both end in between.
    """
    if nodes.state[other, a] != GONE and _apart(nodes, one, a, other, a) <= SAME_CURVE:
        return _between(nodes, scratch, moving, pieces, inputs, covered, one, a, other, a)
    nearest, at, least = -1, other, math.inf
    for b in range(nodes.state.shape[1]):
        if nodes.excluded[one, b] or nodes.excluded[other, b]:
            continue
        if nodes.state[other, b] != GONE:
            apart = _apart(nodes, one, a, other, b)
            if apart < least:
                nearest, at, least = b, other, apart
        elif b != a and nodes.state[one, b] != GONE and nodes.state[other, a] == GONE:
            apart = _apart(nodes, one, a, one, b)
            if apart < least:
                nearest, at, least = b, one, apart
    if nearest < 0 or least > SAME_CURVE:
        return HARD
    return _between(nodes, scratch, moving, pieces, inputs, covered, one, a, at, nearest)


@njit(**STRICT)
def _between(nodes, scratch, moving, pieces, inputs, covered, one, a, other, b):
    """Return what is known of a curve between two configurations: slots and branches."""
    apart = _apart(nodes, one, a, other, b)
    if _limits_exclude(nodes, one, a, other, b, apart):
        return EXCLUDED
    first, second = nodes.state[one, a], nodes.state[other, b]
    if first == HITS and _pair_excludes(nodes, scratch, moving, pieces, inputs, covered, one, a, other, b):
        return EXCLUDED
    if second == HITS and _pair_excludes(nodes, scratch, moving, pieces, inputs, covered, other, b, one, a):
        return EXCLUDED
    return SOFT if first >= FALLS and second >= FALLS else HARD


@njit(**STRICT)
def _limits_exclude(nodes, one, a, other, b, apart):
    """Whether one joint is outside of its limits all along a curve."""
    limits = nodes.chain.limits
    for j in range(nodes.q.shape[2]):
        half = 0.5 * (limits[1, j] - limits[0, j])
        if not half < math.pi:
            continue
        here = _turn(nodes.q[one, a, j] - limits[2, j])
        there = _turn(nodes.q[other, b, j] - limits[2, j])
        outside = min(abs(here), abs(there)) - half
        aside = here * there > 0.0 or abs(here) + abs(there) >= math.pi  # not through the range
        if outside > BEND * apart * apart and aside:
            return True
    return False


@njit(**STRICT)
def _pair_excludes(nodes, scratch, moving, pieces, inputs, covered, one, a, other, b):
    """Whether the pair that collides at one end of a curve does so all along it."""
    first, second = nodes.pair[one, a, 0], nodes.pair[one, a, 1]
    last = -1
    for side in range(2):
        piece = nodes.pair[one, a, side]
        if moving.hand.shape[1] <= piece < len(moving.frame):
            last = max(last, moving.frame[piece])
    way = 0.0
    for j in range(last + 1):
        way += abs(_turn(nodes.q[other, b, j] - nodes.q[one, a, j]))
    bend = SAGITTA * way * way
    if not _deeper(nodes, scratch, moving, pieces, inputs, covered, one, a, bend):
        return False
    if (
        nodes.state[other, b] == HITS
        and nodes.pair[other, b, 0] == first
        and nodes.pair[other, b, 1] == second
    ):
        for side in range(2):
            angle = _turned(nodes.pose[one, a, side], nodes.pose[other, b, side])
            bend += 0.25 * angle * _length(pieces.size, nodes.pair[one, a, side])
        return _deeper(nodes, scratch, moving, pieces, inputs, covered, one, a, bend) and _deeper(
            nodes, scratch, moving, pieces, inputs, covered, other, b, bend
        )
    place_arm(moving, pieces, scratch, nodes.q[other, b])
    for side in range(2):
        piece = nodes.pair[one, a, side]
        angle = _turned(nodes.pose[one, a, side], scratch.pose[piece])
        bend += 0.25 * angle * _length(pieces.size, piece)
    for level in range(len(covered.inner)):
        if _depth(scratch, moving, pieces, inputs, covered, first, second, level) > bend:
            return _deeper(nodes, scratch, moving, pieces, inputs, covered, one, a, bend)
    return False


@njit(**STRICT)
def _deeper(nodes, scratch, moving, pieces, inputs, covered, at, b, depth):
    """Whether the pair that a candidate hits collides deeper than ``depth`` (m)."""
    first, second = nodes.pair[at, b, 0], nodes.pair[at, b, 1]
    while nodes.depth[at, b] <= depth:
        level = nodes.level[at, b]
        if level == len(covered.inner):
            return False
        _copy_pose(nodes.pose[at, b, 0], scratch.pose[first])
        _copy_pose(nodes.pose[at, b, 1], scratch.pose[second])
        known = _depth(scratch, moving, pieces, inputs, covered, first, second, level)
        nodes.depth[at, b], nodes.level[at, b] = max(nodes.depth[at, b], known), level + 1
    return True


@njit(**STRICT)
def _copy_pose(pose, out):
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
def _depth(scratch, moving, pieces, inputs, covered, first, second, level):
    """Return by how much (m) more than it takes two pieces are certain to collide; else it is not positive.

    Args:
        level: which of the bodies inside the pieces tell.
    """
    bar = -HIT_BAND - pieces.size[first, 1] - pieces.size[second, 1]
    if second > moving.objects[-1]:
        bar += inputs.margin
    if bar == -math.inf:
        return -1.0
    _, upper = distance_bounds(
        covered.inner[level], scratch.pose, first, second, bar, math.inf, -math.inf, scratch.simplex
    )
    return bar - upper
