"""How an arm follows the tool from the middle of a box of heights and angles to all of it. Compiled.

From the middle, where the joint values are q₀, the tool moves to any other place of the box along a path on
which height h, standoff d and shift s change linearly with the angle θ: its twist in its own frame is
``ξ = Δh ξ_h + Δθ ξ_θ + Δd ξ_d + Δs ξ_s``, and all but constant. Joints that follow it move as

``q' = J(q)⁻¹ ξ = (1 + E)⁻¹ J(q₀)⁻¹ ξ``,  with  ``E = J(q₀)⁻¹ (J(q) − J(q₀))``.

Let ``|q − q₀| <= u``, joint by joint. Column j of J is the twist of joint j in the tool's frame, on which the
joints k > j act by Lie brackets: ``∂J_j/∂q_k = [J_j, J_k]``. From these at q₀, and from bounds on those of
second order, follows a matrix ``M(u) >= |E|``. If ``|J(q₀)⁻¹ ξ| + M(u) u <= u``, then J stays invertible, the
joints follow the whole path, and never leave ``|q − q₀| <= u``: that is what is proven here. The path ends no
further than ``M(u) u`` from where the linear part takes it.

Functions share their arguments: moving is `MovingPieces`, inputs is `CellInput`, work is `CellWork`; box is
roll, level, row and column of a box.
"""

from __future__ import annotations

import math

from symgrasp.collision.simplex import FAST
from symgrasp.compiling import njit
from symgrasp.engine.kinematics import compose, rotate

__all__ = ["follows", "motion_of", "place_tool", "reaches_middle", "tool_motion"]

CLOSE = 1e-9
"""Largest error (m, rad) of a tool pose for which joint values are found."""

WIDEST = 1.0
"""Joints that may move further (rad) are not followed."""

TIGHT = 1e4
"""Where an entry of the inverse (rad/m) is larger the arm is too near to a singular pose."""


@njit(**FAST)
def place_tool(inputs, work, box):
    """Write the tool pose in the middle of a box."""
    roll, level, row, column = box
    rows, r, at = inputs.rows, inputs.first[level] + row, inputs.object
    theta = inputs.start + (column + 0.5) * inputs.width / (1 << level)
    s, c, sign, T = math.sin(theta), math.cos(theta), 1.0 - 2.0 * roll, work.T
    for i in range(3):
        outwards, tangent = c * at[3 * i] + s * at[3 * i + 1], c * at[3 * i + 1] - s * at[3 * i]
        along = at[3 * i + 2]
        T[3 * i], T[3 * i + 1], T[3 * i + 2] = sign * along, sign * tangent, -outwards
        T[9 + i] = (
            at[9 + i] + rows.standoff[r] * outwards - sign * rows.shift[r] * tangent + rows.h[r] * along
        )


@njit(**FAST)
def tool_motion(inputs, box, x, y, z):
    """Return how far (m) a point fixed to the tool moves in a box, and how far along the object.

    Args:
        x, y, z: the point in the world, for the tool in the middle of the box.
    """
    _, level, row, _ = box
    rows, r, at = inputs.rows, inputs.first[level] + row, inputs.object
    across = rows.dstandoff[r] + rows.dshift[r]
    slides = math.sqrt(rows.dh[r] ** 2 + rows.dstandoff[r] ** 2 + rows.dshift[r] ** 2)
    x, y, z = x - at[9], y - at[10], z - at[11]
    a0, a1, a2 = at[2], at[5], at[8]
    c0, c1, c2 = a1 * z - a2 * y, a2 * x - a0 * z, a0 * y - a1 * x
    turn = 0.5 * inputs.width / (1 << level)
    return slides + turn * (math.sqrt(c0 * c0 + c1 * c1 + c2 * c2) + across), slides


@njit(**FAST)
def reaches_middle(moving, inputs, work):
    """Move the joints to the tool pose of ``work`` by Newton's method; return whether they get there.

    What is held stays. Twists and their inverse are then those at these joint values.
    """
    q = work.q
    for _ in range(10):
        _place(moving, inputs, work)
        if not _invert(inputs, work):
            return False
        T, tool, worst = work.T, work.tool, 0.0
        e0 = e1 = e2 = w0 = w1 = w2 = alike = 0.0
        for i in range(3):
            d = T[9 + i] - tool[9 + i]
            e0, e1, e2 = e0 + tool[3 * i] * d, e1 + tool[3 * i + 1] * d, e2 + tool[3 * i + 2] * d
            w0 += 0.5 * (tool[3 * i + 2] * T[3 * i + 1] - tool[3 * i + 1] * T[3 * i + 2])
            w1 += 0.5 * (tool[3 * i] * T[3 * i + 2] - tool[3 * i + 2] * T[3 * i])
            w2 += 0.5 * (tool[3 * i + 1] * T[3 * i] - tool[3 * i] * T[3 * i + 1])
            for k in range(3):
                alike += tool[3 * i + k] * T[3 * i + k]
        if alike < 2.0:  # more than 60° apart, where the skew part says little
            return False
        if math.sqrt(e0 * e0 + e1 * e1 + e2 * e2 + w0 * w0 + w1 * w1 + w2 * w2) < 0.5 * CLOSE:
            return True
        for j in inputs.free:
            row = work.inverse[j]
            step = row[0] * w0 + row[1] * w1 + row[2] * w2 + row[3] * e0 + row[4] * e1 + row[5] * e2
            worst = max(worst, abs(step))
            q[j] += step
        if not worst < WIDEST:
            return False
    return False


@njit(**FAST)
def _place(moving, inputs, work):
    """Write the joint frames, and the twists of the joints."""
    n, frames, tool = len(work.q), work.frames, work.tool
    for j in range(n):
        if j == 0:
            for i in range(12):
                frames[0, i] = moving.joint_origin[0, i]
        else:
            compose(frames[j - 1], moving.joint_origin[j], frames[j])
        rotate(frames[j], moving.joint_axis[j], work.q[j])
    compose(frames[n - 1], inputs.tool, tool)
    for j in range(n):
        w0, w1, w2 = _axis(moving, frames, j)
        f = frames[j]
        r0, r1, r2 = tool[9] - f[9], tool[10] - f[10], tool[11] - f[11]
        v0, v1, v2 = w1 * r2 - w2 * r1, w2 * r0 - w0 * r2, w0 * r1 - w1 * r0
        for i in range(3):
            work.twist[j, i] = tool[i] * w0 + tool[3 + i] * w1 + tool[6 + i] * w2
            work.twist[j, 3 + i] = tool[i] * v0 + tool[3 + i] * v1 + tool[6 + i] * v2


@njit(**FAST)
def _axis(moving, frames, j):
    """Return the axis of a joint in the world."""
    f, a = frames[j], moving.joint_axis[j]
    return (
        f[0] * a[0] + f[1] * a[1] + f[2] * a[2],
        f[3] * a[0] + f[4] * a[1] + f[5] * a[2],
        f[6] * a[0] + f[7] * a[1] + f[8] * a[2],
    )


@njit(**FAST)
def _invert(inputs, work):
    """Invert the twists of the free joints; return whether that is well conditioned."""
    m = work.matrix
    for i in range(6):
        for k in range(6):
            m[i, k], m[i, 6 + k] = work.twist[inputs.free[k], i], 1.0 if i == k else 0.0
    for k in range(6):
        pivot = k
        for i in range(k + 1, 6):
            if abs(m[i, k]) > abs(m[pivot, k]):
                pivot = i
        if abs(m[pivot, k]) < 1e-9:
            return False
        for c in range(12):
            m[k, c], m[pivot, c] = m[pivot, c], m[k, c]
        scale = 1.0 / m[k, k]
        for c in range(12):
            m[k, c] *= scale
        for i in range(6):
            if i != k:
                factor = m[i, k]
                for c in range(12):
                    m[i, c] -= factor * m[k, c]
    for k in range(6):
        j = inputs.free[k]
        angular = linear = 0.0
        for c in range(3):
            work.inverse[j, c], work.inverse[j, 3 + c] = m[k, 6 + c], m[k, 9 + c]
            angular, linear = angular + m[k, 6 + c] ** 2, linear + m[k, 9 + c] ** 2
        work.size[j, 0], work.size[j, 1] = math.sqrt(angular), math.sqrt(linear)
        if not max(angular, linear) < TIGHT * TIGHT:
            return False
    return True


@njit(**FAST)
def follows(inputs, work, box):
    """Whether the arm follows the tool from the middle of a box to all of it.

    If so, ``work`` has how far the joints move; `reaches_middle` has been called before.
    """
    roll, level, row, _ = box
    rows, r, sign = inputs.rows, inputs.first[level] + row, 1.0 - 2.0 * roll
    change = work.change
    change[0], change[1] = rows.dh[r], 0.5 * inputs.width / (1 << level)
    change[2], change[3] = rows.dstandoff[r], rows.dshift[r]
    d, s, curved = rows.standoff[r], rows.shift[r], change[1] * (change[2] + change[3])
    for i in inputs.free:
        g = work.inverse[i]
        work.along[0, i] = sign * g[3]
        work.along[1, i] = sign * (g[0] + d * g[4] - s * g[5])
        work.along[2, i], work.along[3, i] = -g[5], -g[4]
        base = curved * work.size[i, 1] + CLOSE * (work.size[i, 0] + work.size[i, 1])
        for k in range(4):
            base += change[k] * abs(work.along[k, i])
        work.base[i] = base
        work.most[i] = 1.05 * base + 1e-9
        if not work.most[i] < WIDEST:
            return False
    _bends(inputs, work)
    for _ in range(12):
        if _stays(inputs, work):
            for i in inputs.free:  # all of `base` but for the linear part, and what the bends add
                linear = 0.0
                for k in range(4):
                    linear += change[k] * abs(work.along[k, i])
                work.rest[i] += work.base[i] - linear
            return True
        for i in inputs.free:
            work.most[i] = max(work.most[i], 1.1 * (work.base[i] + work.rest[i]))
            if not work.most[i] < WIDEST:
                return False
    return False


@njit(**FAST)
def _bends(inputs, work):
    """Write by how much the joints would move for the Lie brackets of the twists."""
    for a in range(6):
        j = inputs.free[a]
        t = work.twist[j]
        for b in range(6):
            k = inputs.free[b]
            if k <= j:
                continue
            o = work.twist[k]
            w0, w1, w2 = t[1] * o[2] - t[2] * o[1], t[2] * o[0] - t[0] * o[2], t[0] * o[1] - t[1] * o[0]
            v0 = t[1] * o[5] - t[2] * o[4] + t[4] * o[2] - t[5] * o[1]
            v1 = t[2] * o[3] - t[0] * o[5] + t[5] * o[0] - t[3] * o[2]
            v2 = t[0] * o[4] - t[1] * o[3] + t[3] * o[1] - t[4] * o[0]
            for i in inputs.free:
                g = work.inverse[i]
                work.bend[i, j, k] = abs(
                    g[0] * w0 + g[1] * w1 + g[2] * w2 + g[3] * v0 + g[4] * v1 + g[5] * v2
                )


@njit(**FAST)
def _stays(inputs, work):
    """Whether joints that may move by ``most`` move by no more; ``rest`` is then what the bends add."""
    most, lever = work.most, work.lever
    turn = reach = 0.0
    for j in range(len(most) - 1, -1, -1):
        t = work.twist[j]
        lever[j, 0] = math.sqrt(t[3] * t[3] + t[4] * t[4] + t[5] * t[5]) + reach
        lever[j, 1], lever[j, 2] = turn, reach
        turn, reach = turn + most[j], reach + most[j] * lever[j, 0]
    stays = True
    for i in inputs.free:
        rest = 0.0
        for j in inputs.free:
            s1, s2 = lever[j, 1], lever[j, 2]
            angular = 0.5 * s1 * s1
            e = 1e-9 + work.size[i, 0] * angular + work.size[i, 1] * (lever[j, 0] * angular + s1 * s2)
            for k in inputs.free:
                if k > j:
                    e += work.bend[i, j, k] * most[k]
            rest += e * most[j]
        work.rest[i] = rest
        stays = stays and work.base[i] + rest <= most[i]
    return stays


@njit(**FAST)
def motion_of(moving, work, frame, stop, x, y, z, radius):
    """Return how far (m) points of a ball move that a joint carries, when `follows` holds.

    Args:
        frame: the joint that carries it.
        stop: the joint in whose frame it moves: those up to it do not count.
        x, y, z: its middle in the world, for the arm in the middle of the box.
        radius: its radius (m).
    """
    along, change, frames = work.along, work.change, work.frames
    bent = later = first = 0.0
    for j in range(frame, stop, -1):
        w0, w1, w2 = _axis(moving, frames, j)
        r0, r1, r2 = x - frames[j, 9], y - frames[j, 10], z - frames[j, 11]
        v0, v1, v2 = w1 * r2 - w2 * r1, w2 * r0 - w0 * r2, w0 * r1 - w1 * r0
        away = math.sqrt(v0 * v0 + v1 * v1 + v2 * v2) + radius
        most = work.most[j]
        bent += work.rest[j] * away + most * later + 0.5 * most * most * (away + later)
        later += most * (away + later)
    for k in range(4):
        if change[k] == 0.0:
            continue
        v0 = v1 = v2 = u0 = u1 = u2 = 0.0
        for j in range(frame, stop, -1):
            g = along[k, j]
            w0, w1, w2 = _axis(moving, frames, j)
            r0, r1, r2 = x - frames[j, 9], y - frames[j, 10], z - frames[j, 11]
            u0, u1, u2 = u0 + g * w0, u1 + g * w1, u2 + g * w2
            v0, v1, v2 = (
                v0 + g * (w1 * r2 - w2 * r1),
                v1 + g * (w2 * r0 - w0 * r2),
                v2 + g * (w0 * r1 - w1 * r0),
            )
        turn = math.sqrt(u0 * u0 + u1 * u1 + u2 * u2)
        first += change[k] * (math.sqrt(v0 * v0 + v1 * v1 + v2 * v2) + radius * turn)
    return first + bent
