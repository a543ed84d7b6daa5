"""Proofs that straight lines in joint space are free, by conservative advancement. Compiled.

At a point of the line every pair of pieces is certified to be apart by some distance, see
`symgrasp.collision.distance`. No point of a piece moves further in a stretch of the line to both sides of it
than its speed and the largest acceleration allow, so a stretch in which no piece can use up the distance is
free as a whole. The line is proven when such stretches cover all of it. Nothing is sampled.

For joint values ``q + t·d``, a point of a piece has the speed ``Σ dⱼ ∂p/∂qⱼ`` at ``t = 0``, and since
``∂²p/∂qᵢ∂qⱼ`` is no longer than ``∂p/∂qⱼ`` if i comes before j in the chain, its acceleration is at most
``Σᵢⱼ |dᵢ dⱼ| L`` with the lever L of the later one of both. Of a pair only the joints count that carry one of
its pieces and not the other: the others change no distance. The centre of mass of a robot moves in the same
way as the points of which it is the mean, and must stay within the area that the robot stands on.
"""

from __future__ import annotations

import math

from symgrasp.collision.boxes import box_of, boxes_apart
from symgrasp.collision.distance import distance_bounds
from symgrasp.collision.simplex import FAST
from symgrasp.compiling import ENTRY, njit
from symgrasp.engine.checks import FREE_BAND
from symgrasp.engine.kinematics import compose, rotate

__all__ = ["BLOCKED", "CLOSEST", "FALLEN", "TILTED", "clearances", "line_clearance", "place", "tilt_excess"]

CLOSEST = 1e-4
"""Where pieces are closer than allowed and this (m), a line is not proven free: steps become too short."""

SHARE = 0.7
"""Share of a distance that a stretch may use up."""

FAR = 0.1
"""No piece moves further (m) in a stretch: distances above it need not be known."""

EXPECTED = 0.95
"""Share of the length of a stretch that is expected of those beside it."""

SHORTEST = 1e-12
"""Parts of a line that are shorter are gaps by rounding between stretches that meet."""

MANY = 64
"""So many stretches may wait for proofs before the newest is looked at first."""

CLOSEST_ANGLE = 1e-4
"""The same as `CLOSEST` for the angle (rad) that is left to the largest tilt."""

BLOCKED = -1.0
"""Stands for the clearance of a line that is not proven free."""

TILTED, FALLEN = -1, -2
"""Stand for a pair of pieces where the object is tilted too far, or a robot would fall."""


@njit(**ENTRY)
def clearances(linkage, pieces, tree, work, start, end, most, found, hits):
    """Write the clearance and the room (m) that each of E lines is proven to have, or `BLOCKED` twice.

    Args:
        linkage: see `Linkage`.
        pieces: see `PackedPieces`.
        tree: boxes of the standing pieces that all moving ones are checked against.
        work: see `Workspace`.
        start: (E, J) joint values.
        end: (E, J) joint values.
        most: clearance (m) above which it need not be known.
        found: (E, 2) receives the clearances; and how far any point may be off the line before the object
            sinks into what it rests on, or a robot falls.
        hits: (E, 2) receives the pair of pieces that each blocked line meets first.
    """
    for e in range(len(start)):
        found[e, 0], found[e, 1] = line_clearance(linkage, pieces, tree, work, start[e], end[e], most, 0.5)
        hits[e, 0], hits[e, 1] = work.hit[0], work.hit[1]


@njit(**FAST)
def line_clearance(linkage, pieces, tree, work, start, end, most, first):
    """Return clearance and room (m), at most ``most``, that a line (J,) to (J,) is proven to have.

    Both are `BLOCKED` where it is not proven free; see `clearances`. Then ``work.hit`` names the pair of
    pieces.

    Each proof at a point covers a stretch to both sides of it. What is left of the line waits in a queue, so
    that points far from each other are looked at first, and a line that is not free is given up early.

    Args:
        linkage, pieces, tree, work, start, end, most: see `clearances`.
        first: where on the line (0 to 1) to look first.
    """
    q, d, waiting = work.q[0], work.q[1], work.waiting
    count = len(q)
    for j in range(count):
        d[j] = end[j] - start[j]
    for k in range(len(linkage.piece)):
        work.speed[k, 1] = _acceleration(linkage, d, k, -1)
    least, room = most, most
    low, high, t, expected = 0.0, 1.0, first, 1.0
    head, left = 0, 0
    while True:
        for j in range(count):
            q[j] = start[j] + t * d[j] if t < 1.0 else end[j]
        place(linkage, pieces.size, work, q)
        step = min(max(t - low, high - t), expected)
        if linkage.tilted >= 0:
            step = _tilt_step(linkage, work, d, step)
            if step < 0.0:
                return BLOCKED, BLOCKED
        _twists(linkage, work, d)
        for k in range(len(linkage.piece)):
            v, a = _speed(linkage, work, k, -1), work.speed[k, 1]
            work.speed[k, 0] = v
            step = min(step, _time(FAR, v, a))
        step, least, room = _free_step(linkage, pieces, tree, work, d, step, least, room)
        if step >= 0.0 and len(linkage.balance.edge):
            step, room = _standing_step(linkage, work, d, step, room)
        if step < 0.0 or left > len(waiting) - 2:  # the latter is never seen
            return BLOCKED, BLOCKED
        for side in range(2):
            a, b = (low, t - step) if side == 0 else (t + step, high)
            if b - a > SHORTEST:
                behind = (head + left) % len(waiting)
                waiting[behind, 0], waiting[behind, 1], waiting[behind, 2] = a, b, step
                left += 1
        if left == 0:
            return max(least, 0.0), max(room, 0.0)
        # The oldest stretch is the longest; the newest when many wait, so that their number stays small.
        left -= 1
        taken = head
        if left < MANY:
            head = (head + 1) % len(waiting)
        else:
            taken = (head + left) % len(waiting)
        low, high, step = waiting[taken, 0], waiting[taken, 1], waiting[taken, 2]
        # Points in the middles of equal parts need the fewest of them, if they are all as far from things.
        parts = math.ceil((high - low) / (2.0 * EXPECTED * step))
        t = low + (parts // 2 + 0.5) * (high - low) / parts
        expected = (high - low) / parts


@njit(**FAST)
def place(linkage, size, work, q):
    """Write the poses and boxes of the moving pieces at joint values q (J,)."""
    frames = work.frames
    for j in range(len(q)):
        parent = linkage.parent[j]
        if parent < 0:
            for i in range(12):
                frames[j, i] = linkage.origin[j, i]
        else:
            compose(frames[parent], linkage.origin[j], frames[j])
        if linkage.slides[j]:
            for i in range(3):
                along = (
                    frames[j, 3 * i] * linkage.axis[j, 0]
                    + frames[j, 3 * i + 1] * linkage.axis[j, 1]
                    + frames[j, 3 * i + 2] * linkage.axis[j, 2]
                )
                frames[j, 9 + i] += along * q[j]
        else:
            rotate(frames[j], linkage.axis[j], q[j])
    for k in range(len(linkage.piece)):
        p = linkage.piece[k]
        compose(frames[linkage.frame[k]], linkage.local[k], work.pose[p])
        box_of(size, work.pose, p, work.box[p])


@njit(**FAST)
def _free_step(linkage, pieces, tree, work, d, step, least, room):
    """Return a step of the line that is free, and the clearance and room (m) that it has at least.

    Args:
        step: the longest step to take.
        least: the clearance (m) so far.
        room: the room (m) so far.

    Returns:
        The step, -1 where a pair is too close, the clearance and the room.
    """
    box = work.box
    for k in range(len(linkage.piece) - 1, -1, -1):  # the last ones move most, and hit most
        keep = linkage.margin[k] + FREE_BAND
        if keep == math.inf:
            continue
        p, v, a = linkage.piece[k], work.speed[k, 0], work.speed[k, 1]
        moved = v * step + 0.5 * a * step * step
        node = 0
        while node < len(tree.skip):
            reach = keep + max(moved / SHARE, moved + least, CLOSEST)
            if boxes_apart(box, p, node, tree.box, reach):
                node = tree.skip[node]
                continue
            if tree.piece[node] >= 0:
                step, moved, least = _pair_step(pieces, work, p, tree.piece[node], keep, v, a, step, least)
                if step < 0.0:
                    return step, least, room
            node += 1
    for i in range(len(linkage.pair)):
        k, p, other = linkage.pair[i, 0], linkage.pair[i, 1], linkage.other[i]
        keep = linkage.distance[i] + FREE_BAND
        own = linkage.piece[k]
        v, a = work.speed[k, 0], work.speed[k, 1]
        if other >= 0:
            v, a = v + work.speed[other, 0], a + work.speed[other, 1]
        moved = v * step + 0.5 * a * step * step
        known = room if linkage.rests[i] else least
        if boxes_apart(box, own, p, box, keep + max(moved / SHARE, moved + known, CLOSEST)):
            continue
        if other >= 0 and linkage.common[i] >= 0:
            stop = linkage.common[i]
            v = _speed(linkage, work, k, stop) + _speed(linkage, work, other, stop)
            a = _acceleration(linkage, d, k, stop) + _acceleration(linkage, d, other, stop)
        if linkage.rests[i]:
            step, moved, room = _pair_step(pieces, work, own, p, keep, v, a, step, room)
        else:
            step, moved, least = _pair_step(pieces, work, own, p, keep, v, a, step, least)
        if step < 0.0:
            return step, least, room
    return step, least, room


@njit(**FAST)
def _pair_step(pieces, work, p, other, keep, v, a, step, least):
    """Return a step that is free for a pair of pieces too, how far (m) they move in it, and the clearance."""
    moved = v * step + 0.5 * a * step * step
    reach = keep + max(moved / SHARE, moved + least, CLOSEST)
    near = keep + CLOSEST
    gap, _ = distance_bounds(pieces, work.pose, p, other, reach, near, near, work.simplex)
    if gap < near:
        work.hit[0], work.hit[1] = p, other
        return BLOCKED, moved, least
    gap -= keep
    if moved > SHARE * gap:
        step = min(step, _time(SHARE * gap, v, a))
        moved = v * step + 0.5 * a * step * step
    return step, moved, min(least, gap - moved)


@njit(**FAST)
def _time(distance, v, a):
    """Return in which time a point gets no further than a distance, at a speed v and acceleration a."""
    across = v + math.sqrt(v * v + 2.0 * a * distance)
    return 2.0 * distance / across if across > 0.0 else math.inf


@njit(**FAST)
def _twists(linkage, work, d):
    """Write how each joint frame turns and moves at rates d (J,), see `Workspace`."""
    frames, twist = work.frames, work.twist
    for j in range(len(d)):
        f, axis, rate, parent = frames[j], linkage.axis[j], d[j], linkage.parent[j]
        for i in range(6):
            twist[j, i] = twist[parent, i] if parent >= 0 else 0.0
        x0 = rate * (f[0] * axis[0] + f[1] * axis[1] + f[2] * axis[2])
        x1 = rate * (f[3] * axis[0] + f[4] * axis[1] + f[5] * axis[2])
        x2 = rate * (f[6] * axis[0] + f[7] * axis[1] + f[8] * axis[2])
        if linkage.slides[j]:
            twist[j, 3] += x0
            twist[j, 4] += x1
            twist[j, 5] += x2
        else:
            twist[j, 0] += x0
            twist[j, 1] += x1
            twist[j, 2] += x2
            twist[j, 3] += x2 * f[10] - x1 * f[11]
            twist[j, 4] += x0 * f[11] - x2 * f[9]
            twist[j, 5] += x1 * f[9] - x0 * f[10]


@njit(**FAST)
def _speed(linkage, work, k, stop):
    """Return the largest speed of points of moving piece k, if only joints after joint ``stop`` move."""
    box, twist, p, j = work.box, work.twist, linkage.piece[k], linkage.frame[k]
    c0 = 0.5 * (box[p, 0] + box[p, 3])
    c1 = 0.5 * (box[p, 1] + box[p, 4])
    c2 = 0.5 * (box[p, 2] + box[p, 5])
    w0, w1, w2, v0, v1, v2 = twist[j, 0], twist[j, 1], twist[j, 2], twist[j, 3], twist[j, 4], twist[j, 5]
    if stop >= 0:
        w0, w1, w2 = w0 - twist[stop, 0], w1 - twist[stop, 1], w2 - twist[stop, 2]
        v0, v1, v2 = v0 - twist[stop, 3], v1 - twist[stop, 4], v2 - twist[stop, 5]
    v0 += w1 * c2 - w2 * c1
    v1 += w2 * c0 - w0 * c2
    v2 += w0 * c1 - w1 * c0
    v = math.sqrt(v0 * v0 + v1 * v1 + v2 * v2)
    return v + math.sqrt(w0 * w0 + w1 * w1 + w2 * w2) * linkage.radius[k]


@njit(**FAST)
def _acceleration(linkage, d, k, stop):
    """Return the largest acceleration of points of moving piece k, likewise, at rates d (J,)."""
    later = a = 0.0
    j = linkage.frame[k]
    while j != stop:
        rate = abs(d[j])
        if not linkage.slides[j]:
            a += 2.0 * rate * later + rate * rate * linkage.lever[k, j]
        later += rate * linkage.lever[k, j]
        j = linkage.parent[j]
    return a


@njit(**FAST)
def tilt_excess(linkage, frames):
    """Return by how much (rad) the object is tilted beyond its largest tilt."""
    f, u = frames[linkage.tilted], linkage.upright
    x = f[0] * u[0] + f[1] * u[1] + f[2] * u[2]
    y = f[3] * u[0] + f[4] * u[1] + f[5] * u[2]
    z = f[6] * u[0] + f[7] * u[1] + f[8] * u[2]
    return math.atan2(math.sqrt(x * x + y * y), z) - linkage.tilt


@njit(**FAST)
def _tilt_step(linkage, work, d, step):
    """Return a step in which the object is not tilted too far, -1 where it is so already."""
    left = -tilt_excess(linkage, work.frames)
    if left < CLOSEST_ANGLE:
        work.hit[0] = work.hit[1] = TILTED
        return -1.0
    rate = 0.0
    j = linkage.tilted
    while j >= 0:
        if not linkage.slides[j]:
            rate += abs(d[j])
        j = linkage.parent[j]
    return min(step, SHARE * left / rate) if rate > 0.0 else step


@njit(**FAST)
def _standing_step(linkage, work, d, step, room):
    """Return a step in which no robot falls, -1 where one would at once, and the room (m) that is left."""
    b, load = linkage.balance, work.load
    for j in range(len(d)):
        f, w = work.frames[j], b.weight[j]
        load[j, 0] = w[0]
        for i in range(3):
            load[j, 1 + i] = f[3 * i] * w[1] + f[3 * i + 1] * w[2] + f[3 * i + 2] * w[3] + f[9 + i] * w[0]
        parent = linkage.parent[j]
        load[j, 4] = 0.0
        if parent >= 0:
            load[j, 4] = load[parent, 4] + (0.0 if linkage.slides[parent] else abs(d[parent]))
    for j in range(len(d) - 1, -1, -1):  # children come later
        if linkage.parent[j] >= 0:
            for i in range(4):
                load[linkage.parent[j], i] += load[j, i]
    for e in range(len(b.edge)):
        r = b.edge_robot[e]
        x, y, left = b.edge[e, 0], b.edge[e, 1], b.edge[e, 2]
        v = a = 0.0
        for j in range(len(d)):
            if b.robot[j] != r:
                continue
            if linkage.parent[j] < 0:
                left -= (x * load[j, 1] + y * load[j, 2]) / b.mass[r]
            f, axis, rate, m = work.frames[j], linkage.axis[j], d[j], load[j, 0]
            a0 = f[0] * axis[0] + f[1] * axis[1] + f[2] * axis[2]
            a1 = f[3] * axis[0] + f[4] * axis[1] + f[5] * axis[2]
            a2 = f[6] * axis[0] + f[7] * axis[1] + f[8] * axis[2]
            if linkage.slides[j]:
                v += rate * m * (x * a0 + y * a1) / b.mass[r]
                a += 2.0 * abs(rate) * load[j, 4] * b.sway[j]
            else:
                s0, s1, s2 = load[j, 1] - m * f[9], load[j, 2] - m * f[10], load[j, 3] - m * f[11]
                v += rate * (x * (a1 * s2 - a2 * s1) + y * (a2 * s0 - a0 * s2)) / b.mass[r]
                a += abs(rate) * (abs(rate) + 2.0 * load[j, 4]) * b.sway[j]
        if left < CLOSEST:
            work.hit[0] = work.hit[1] = FALLEN
            return -1.0, room
        v = abs(v)  # the stretch goes both ways
        step = min(step, _time(SHARE * left, v, a))
        room = min(room, left - v * step - 0.5 * a * step * step)
    return step, room
