"""The polynomial N of arms of which the axes of the last two joints meet; see `symgrasp.ik.pair.solver`."""

from __future__ import annotations

import math

from symgrasp.compiling import njit
from symgrasp.ik.chain import AXES
from symgrasp.ik.pair.geometry import (
    CHAIN_DIRECTION,
    CHAIN_POINT,
    COSINE,
    COSINE_56,
    FIRST_AXIS,
    FIRST_POINT,
    FRAME,
    GENERAL,
    KIND,
    LENGTH,
    MEETING,
    OUTER_LAST,
    SHOULDER_POINT,
    SINE,
    TILT,
    WRIST_POINT,
)  # fmt: skip
from symgrasp.ik.roots import find_roots, inverse_of, size2, start_circle_quartic
from symgrasp.ik.vectors import STRICT, cross, dot, minus, plus, times, vec

__all__ = ["POLYNOMIAL_NUMBERS", "equations_of", "may_reach", "product", "residual_at", "solve_inner"]

POLYNOMIAL_NUMBERS = 9
"""Complex numbers that these functions need memory for."""

QUARTIC, INNER = 0, 5
"""Where the parts of that memory begin."""

SMALL_STEP = 1e-6
"""Step, as a share of b, up to which it is improved: larger ones are between values that all but coincide."""

ON_AXIS = 1e-5
"""Distance (m) from an axis up to which a point is on it."""

BEYOND = 1e-9
"""Distance (m) that rounding is given where the reach ends."""


@njit(**STRICT)
def _circles(g, R, p):
    """Return the points and directions of the inner and the outer joint: (point, direction) of each.

    A point that turns about an axis is given as its values at rest, and the coefficients of cosine and sine.
    """
    chain = (
        (vec(g, CHAIN_POINT), vec(g, CHAIN_POINT + 3), vec(g, CHAIN_POINT + 6)),
        (vec(g, CHAIN_DIRECTION), vec(g, CHAIN_DIRECTION + 3), vec(g, CHAIN_DIRECTION + 6)),
    )
    F = (vec(g, FRAME), vec(g, FRAME + 3), vec(g, FRAME + 6))
    axis, point = vec(g, FIRST_AXIS), vec(g, FIRST_POINT)
    wrist = minus(plus(times(R, vec(g, WRIST_POINT)), p), vec(g, SHOULDER_POINT))
    pose = (
        _circle(axis, point, minus(times(F, wrist), point)),
        _circle(axis, (0.0, 0.0, 0.0), times(F, times(R, vec(g, AXES + 15)))),
    )
    return (pose, chain) if g[OUTER_LAST] else (chain, pose)


@njit(**STRICT)
def _circle(axis, centre, v):
    """Return the circle of e⁻¹ (v + centre) about an axis through a centre."""
    along = dot(axis, v)
    rest = (along * axis[0], along * axis[1], along * axis[2])
    return plus(centre, rest), minus(v, rest), cross(v, axis)


@njit(**STRICT)
def _complex(circle):
    """Return the coefficients of 1/b, 1, b in v·n + i v·(h × n), and of 1, b in v·h, for a circle v(b)."""
    rest, c, s = circle
    return (
        complex(0.5 * (c[0] - s[1]), 0.5 * (c[1] + s[0])),
        complex(rest[0], rest[1]),
        complex(0.5 * (c[0] + s[1]), 0.5 * (c[1] - s[0])),
        rest[2],
        complex(0.5 * c[2], -0.5 * s[2]),
    )


@njit(**STRICT)
def equations_of(g, R, p):
    """Return the equations at a pose: constants, polynomials of the inner joint, circles of the outer one."""
    inner, outer = _circles(g, R, p)
    arm = (g[LENGTH], g[COSINE], g[SINE], g[COSINE_56], g[KIND], g[TILT])
    return arm, _inner_polynomial(inner[0]), _complex(inner[1]), outer


@njit(**STRICT)
def may_reach(equations):
    """Whether the distances of the point allow that any values of the two joints bring it together."""
    (a, _, _, _, _, _), polynomial, _, (outer, _) = equations
    square, square1 = polynomial[5], 2.0 * math.sqrt(size2(polynomial[6]))
    least, most = math.sqrt(max(square - square1, 0.0)), math.sqrt(square + square1)
    rest, c, s = outer
    square, square1 = dot(rest, rest) + dot(c, c), 2.0 * math.hypot(dot(rest, c), dot(rest, s))
    nearest, furthest = math.sqrt(max(square - square1, 0.0)), math.sqrt(square + square1)
    return nearest <= most + a + BEYOND and least <= furthest + a + BEYOND


@njit(**STRICT)
def _at(circle, c, s):
    """Return the point of a circle at an angle of that cosine and sine."""
    rest, a, b = circle
    return (rest[0] + c * a[0] + s * b[0], rest[1] + c * a[1] + s * b[1], rest[2] + c * a[2] + s * b[2])


@njit(**STRICT)
def _inner_polynomial(circle):
    """Return the coefficients of `_complex` for the inner point v, and then those of 1 and b in |v|²."""
    low, rest, high, along, along1 = _complex(circle)
    square1 = high * rest.conjugate() + rest * low.conjugate() + 2.0 * along * along1
    square = size2(high) + size2(rest) + size2(low) + along * along + 2.0 * size2(along1)
    return low, rest, high, along, along1, square, square1


@njit(**STRICT)
def _numerators(arm, polynomial, w):
    """Return the coefficients of 1 and b in 2a P and in sin(α) Q, for an outer point w."""
    a, cosine, _, _, _, tilt = arm
    _, _, _, along, along1, square, square1 = polynomial
    P, P1 = dot(w, w) - a * a - square, -square1
    Q, Q1 = w[2] - cosine * along, -cosine * along1
    if tilt != 0.0:  # then the outer axis is not normal to that along which P is
        share = 0.5 * tilt / a
        Q, Q1 = Q - a * tilt - share * P, Q1 - share * P1
    return P, P1, Q, Q1


@njit(**STRICT)
def product(equations, c, s, work):
    """Return N where the outer joint has that cosine and sine; work is memory of `POLYNOMIAL_NUMBERS`."""
    solve_inner(equations, c, s, work)
    total = 1.0 + 0.0j
    arm, polynomial, _, (outer, _) = equations
    w = _at(outer, c, s)
    for i in range(4):
        total *= residual_at(equations, c, s, work, i)[0]
    rho = w[0] * w[0] + w[1] * w[1]
    return total.real * rho * rho * _poles(arm, polynomial, _numerators(arm, polynomial, w))


@njit(**STRICT)
def solve_inner(equations, c, s, work):
    """Write the four values of b at which the first three joints reach the point, for `residual_at`."""
    arm, polynomial, _, (outer, _) = equations
    _reach(arm, polynomial, _numerators(arm, polynomial, _at(outer, c, s)), work)


@njit(**STRICT)
def _poles(arm, polynomial, numerators):
    """Return K: the square of the resultant of ``v·n + i v·(h × n)`` and ``P − i Q``, times a constant."""
    a, _, sine, _, kind, _ = arm
    low, rest, high = polynomial[0], polynomial[1], polynomial[2]
    P, P1, Q, Q1 = numerators
    if kind == GENERAL:
        x, x1 = sine * P - 2.0j * a * Q, sine * P1 - 2.0j * a * Q1
        x2 = sine * P1.conjugate() - 2.0j * a * Q1.conjugate()
    elif kind == MEETING:
        x, x1, x2 = P + 0.0j, P1, P1.conjugate()
    else:
        x, x1, x2 = Q + 0.0j, Q1, Q1.conjugate()
    ends = high * x2 - low * x1
    return size2(ends * ends - (high * x - rest * x1) * (rest * x2 - low * x))


@njit(**STRICT)
def _reach(arm, polynomial, numerators, work):
    """Write the four values of b at which the first three joints reach a point."""
    a, _, sine, _, kind, _ = arm
    _, _, _, along, along1, square, square1 = polynomial
    P, P1, Q, Q1 = numerators
    if kind == GENERAL:
        s2, a2 = sine * sine, 4.0 * a * a
        across, across1 = square - along * along - 2.0 * size2(along1), square1 - 2.0 * along * along1
        work[QUARTIC + 4] = s2 * P1 * P1 + a2 * (Q1 * Q1 + s2 * along1 * along1)
        work[QUARTIC + 3] = 2.0 * s2 * P * P1 + a2 * (2.0 * Q * Q1 - s2 * across1)
        work[QUARTIC + 2] = s2 * (P * P + 2.0 * size2(P1)) + a2 * (Q * Q + 2.0 * size2(Q1) - s2 * across)
        work[QUARTIC + 1] = work[QUARTIC + 3].conjugate()
        work[QUARTIC] = work[QUARTIC + 4].conjugate()
        start_circle_quartic(work, QUARTIC, INNER)
        find_roots(work, QUARTIC, QUARTIC + 4, work[INNER : INNER + 4])
        for i in range(4):
            _refine(arm, polynomial, numerators, work, i)
    else:
        x, x1 = (P, P1) if kind == MEETING else (Q, Q1)
        rest = x * x - 4.0 * size2(x1)
        if rest >= 0.0:
            larger = -0.5 * (x + math.copysign(math.sqrt(rest), x)) + 0.0j
        else:
            larger = complex(-0.5 * x, 0.5 * math.sqrt(-rest))
        work[INNER] = work[INNER + 1] = larger * inverse_of(x1)
        work[INNER + 2] = work[INNER + 3] = x1.conjugate() * inverse_of(larger)


@njit(**STRICT)
def _refine(arm, polynomial, numerators, work, i):
    """Improve a value of b where a or the sine is small, and its square in the quartic all but lost.

    With the other coordinate from P² + Q² = |z|² − (h3·z)², the equation of P or Q is solved to all digits.
    """
    a, _, sine, _, _, _ = arm
    _, P1, _, Q1 = numerators
    b, P, Q = _solution(arm, polynomial, numerators, work, i)
    value, x1 = _defect(arm, numerators, b, P, Q), P1 if 2.0 * a < abs(sine) else Q1
    step = value * inverse_of(x1 - x1.conjugate() * inverse_of(b * b))
    if size2(step) < SMALL_STEP * SMALL_STEP * size2(b):
        work[INNER + i] = b - step


@njit(**STRICT)
def _defect(arm, numerators, b, P, Q):
    """Return by how much b misses the equation of that of P and Q that is divided by the smaller number."""
    a, _, sine, _, _, _ = arm
    X, X1, Y, Y1 = numerators
    if 2.0 * a < abs(sine):
        return X + X1 * b + X1.conjugate() * inverse_of(b) - 2.0 * a * P
    return Y + Y1 * b + Y1.conjugate() * inverse_of(b) - sine * Q


@njit(**STRICT)
def _solution(arm, polynomial, numerators, work, i):
    """Return b, P and Q of one of the four."""
    a, _, sine, _, kind, _ = arm
    _, _, _, along, along1, square, square1 = polynomial
    P, P1, Q, Q1 = numerators
    b = work[INNER + i]
    back = inverse_of(b)
    p, q = P + P1 * b + P1.conjugate() * back, Q + Q1 * b + Q1.conjugate() * back
    h = along + along1 * b + along1.conjugate() * back
    across = square + square1 * b + square1.conjugate() * back - h * h
    if kind == GENERAL:
        p, q = p * (0.5 / a), q * (1.0 / sine)
        # Where a or the sine is small, a quotient by it is less exact than P² + Q² = |z|² − (h3·z)².
        if 2.0 * a < abs(sine):
            if size2(p) > 4.0 * a * a:
                p = _root_near(across - q * q, p)
        elif size2(q) > sine * sine:
            q = _root_near(across - p * p, q)
        return b, p, q
    if kind == MEETING:
        q *= 1.0 / sine
        p = _root(across - q * q)
        return b, (p if i % 2 else -p), q
    p *= 0.5 / a
    q = _root(across - p * p)
    return b, p, (q if i % 2 else -q)


@njit(**STRICT)
def _root(z):
    """Return a square root of a complex number."""
    size = math.sqrt(size2(z))
    re, im = math.sqrt(max(0.5 * (size + z.real), 0.0)), math.sqrt(max(0.5 * (size - z.real), 0.0))
    return complex(re, math.copysign(im, z.imag))


@njit(**STRICT)
def _root_near(z, to):
    """Return the square root of a complex number that is nearer to another number."""
    root = _root(z)
    return root if root.real * to.real + root.imag * to.imag >= 0.0 else -root


@njit(**STRICT)
def residual_at(equations, c, s, work, i):
    """Return the residual of the direction at a solution of `solve_inner`, and exp(i q) of three joints.

    They are the inner one, and the two in the middle. Last comes the square of how far (m) the point is
    from the axis of one of these: on it, the joint may have any value, and has whichever rounding makes it.
    """
    arm, polynomial, direction, (outer, outer_direction) = equations
    a, cosine, sine, wanted, _, tilt = arm
    rise = math.sqrt(1.0 - tilt * tilt)
    lean, scale = tilt / rise, 1.0 / rise
    w, m = _at(outer, c, s), _at(outer_direction, c, s)
    b, P, Q = _solution(arm, polynomial, _numerators(arm, polynomial, w), work, i)
    low, rest, high, along, along1, _, _ = polynomial
    back = inverse_of(b)
    z = low * back + rest + high * b
    z_ = high.conjugate() * back + rest.conjugate() + low.conjugate() * b
    zh = along + along1 * b + along1.conjugate() * back
    e, e_, far = _turn(P + 1j * Q, P - 1j * Q, z, z_)
    low, rest, high, along, along1 = direction
    d = (low * back + rest + high * b) * e
    d_ = (high.conjugate() * back + rest.conjugate() + low.conjugate() * b) * e_
    dh = along + along1 * b + along1.conjugate() * back
    x, y = 0.5 * (d + d_), -0.5j * (d - d_)
    h = cosine * dh + sine * y
    x, y, h = rise * x - lean * h, scale * (cosine * y - sine * dh), h + tilt * x
    out, side = rise * (P + a) - lean * (cosine * zh + sine * Q), scale * (cosine * Q - sine * zh)
    f, f_, further = _turn(complex(w[0], w[1]), complex(w[0], -w[1]), out + 1j * side, out - 1j * side)
    u, u_ = (x + 1j * y) * f, (x - 1j * y) * f_
    r = 0.5 * (complex(m[0], -m[1]) * u + complex(m[0], m[1]) * u_) + m[2] * h - wanted
    return r, b, e, f, min(far, further)


@njit(**STRICT)
def _turn(to, to_, of, of_):
    """Return ``e = exp(i q)`` and 1/e of a rotation: ``to = e of`` and ``to_ = of_ / e``.

    Last comes the largest square of their sizes.
    """
    largest = max(size2(to), size2(to_), size2(of), size2(of_))
    if largest < ON_AXIS * ON_AXIS:
        angle = math.atan2(to.imag, to.real) - math.atan2(of.imag, of.real)
        e = complex(math.cos(angle), math.sin(angle))
        return e, e.conjugate(), largest
    return (
        to * inverse_of(of) if size2(of) > size2(to_) else of_ * inverse_of(to_),
        to_ * inverse_of(of_) if size2(of_) > size2(to) else of * inverse_of(to),
        largest,
    )
