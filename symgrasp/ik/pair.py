"""Arms of which the axes of the last two joints meet, compiled: Baxter, G1, Gen3, xArm and most others.

Six joints, or seven with one locked; the axes of joints 5 and 6 meet in a point W (or the same read
backwards). The displacement of the tool from its pose at zero is

    G = e1 e2 e3 e4 e5 e6,     ek = rotation by qk about the line (hk, ok),

so that with p = G W and m = R_G h6

    e2 e3 z(q4) = w(q1),                    z = e4 W,  w = e1⁻¹ p
    m(q1) · R2 R3 d(q4) = h5 · h6,          d = R4 h5,  R1 m(q1) = m.

For a value of q1 the first equation is one of three joints that reach a point. With the feet of the common
normal n of axes 2 and 3 as origins of w and z, a its length and α the angle of the axes,

    P = (|w|² − |z|² − a²) / 2a,   Q = (h2·w − cos α h3·z) / sin α,   P² + Q² = |z|² − (h3·z)²

for the coordinates P and Q of R3 z along n and h3 × n: a polynomial of degree 4 in b = exp(i q4) (D. L.
Pieper, The Kinematics of Manipulators under Computer Control, 1968); where axes 2 and 3 meet or are parallel,
two of degree 2. Its four complex roots give four residuals r of the second equation. Their product, times
ρ⁴ K for the poles at which q2 or q3 is infinite,

    N(q1) = ρ⁴ K r₁ r₂ r₃ r₄,   ρ² = |w|² − (h2·w)²,   K = |Res_b(z·n + i z·(h3 × n), P − i Q)|²,

is a trigonometric polynomial of degree 8, the number of solutions of a general arm being 16. It is computed
from its values, and all its roots at once; a solution is where one of the residuals vanishes. Newton's
method on the arm itself ends each.

Where z does not depend on q4 (a wrist whose axes meet), q1 and q4 change their parts: what is called outer
below is q4, and inner q1.
"""

from __future__ import annotations

import math

import numpy as np

from symgrasp.compiling import njit
from symgrasp.ik.chain import AXES
from symgrasp.ik.joints import misses, nearest_turn, tool_motion, within, write_branch
from symgrasp.ik.newton import polish_in
from symgrasp.ik.pair_geometry import (
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
    PAIR_PHI,
    SHOULDER_POINT,
    SINE,
    WRIST_POINT,
)  # fmt: skip
from symgrasp.ik.roots import find_roots, inverse_of, size2
from symgrasp.ik.vectors import (
    STRICT,
    cross,
    dot,
    minus,
    perpendicular,
    plus,
    rotate,
    subproblem1,
    times,
    vec,
)  # fmt: skip

__all__ = ["NUMBERS", "PAIR_BRANCHES", "pair_branches"]

PAIR_BRANCHES = 16
"""Configurations of a pose and a redundancy value, at most."""

DEGREE = 8
"""Of the trigonometric polynomial N."""

SAMPLES = 20
"""Values of the outer joint at which N is computed."""

NUMBERS = 80
"""Complex numbers that `pair_branches` needs memory for."""

VALUES, COEFFICIENTS, ROOTS, QUARTIC, INNER = 0, SAMPLES, SAMPLES + 17, SAMPLES + 33, SAMPLES + 38
"""Where the parts of that memory begin."""

LEAST_COEFFICIENT2 = 1e-24
"""Square of the ratio to the largest below which the leading coefficient of N is rounding."""

NEARLY_REAL = 0.1
"""Imaginary part (rad) up to which a root is tried as a real one: of two solutions that all but coincide,
rounding makes a conjugate pair."""

NEARLY_ZERO = 0.1
"""Residual up to which a root is tried."""

SAME = 1e-7
"""Largest difference (rad) of the joints of configurations that count as one."""

_TURNS = 2.0 * np.pi * np.arange(SAMPLES) / SAMPLES
COSINES, SINES = np.cos(_TURNS), np.sin(_TURNS)


@njit(**STRICT)
def pair_branches(g, joint, limits, forward, fixed, T, q, exists, inside, memory):
    """Solve one pose (4, 4); see `symgrasp.ik.branches.branches_at` for arguments and result.

    Unlike the closed forms, it checks itself that a configuration reaches the pose.
    """
    R, p = tool_motion(g, joint[7], T)
    work = memory.numbers
    inner, outer = _circles(g, R, p)
    arm = (g[LENGTH], g[COSINE], g[SINE], g[COSINE_56], g[KIND])
    polynomial = _inner_polynomial(arm, inner)
    _start(work, INNER, 4)
    for k in range(SAMPLES):
        work[VALUES + k] = _product(arm, inner, outer, polynomial, COSINES[k], SINES[k], work)
    first, last = _interpolate(work)
    if last <= first:
        return False
    _start(work, ROOTS, last - first)
    find_roots(work, first, last, work[ROOTS : ROOTS + 16])
    found = 0
    for k in range(last - first):
        found = _solutions(
            g, joint, limits, forward, fixed, T, q, exists, inside, memory, R, arm, inner, outer,
            polynomial, k, found,
        )  # fmt: skip
    return found > 0


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
def _at(circle, c, s):
    """Return the point of a circle at an angle of that cosine and sine."""
    rest, a, b = circle
    return (rest[0] + c * a[0] + s * b[0], rest[1] + c * a[1] + s * b[1], rest[2] + c * a[2] + s * b[2])


@njit(**STRICT)
def _inner_polynomial(arm, inner):
    """Return the coefficients of `_complex` for the inner point v, and then those of 1 and b in |v|²."""
    low, rest, high, along, along1 = _complex(inner[0])
    square1 = high * rest.conjugate() + rest * low.conjugate() + 2.0 * along * along1
    square = size2(high) + size2(rest) + size2(low) + along * along + 2.0 * size2(along1)
    return low, rest, high, along, along1, square, square1


@njit(**STRICT)
def _numerators(arm, polynomial, w):
    """Return the coefficients of 1 and b in 2a P and in sin(α) Q, for an outer point w."""
    a, cosine = arm[0], arm[1]
    _, _, _, along, along1, square, square1 = polynomial
    return dot(w, w) - a * a - square, -square1, w[2] - cosine * along, -cosine * along1


@njit(**STRICT)
def _product(arm, inner, outer, polynomial, c, s, work):
    """Return N where the outer joint has that cosine and sine."""
    w, m = _at(outer[0], c, s), _at(outer[1], c, s)
    numerators = _numerators(arm, polynomial, w)
    _reach(arm, polynomial, numerators, work)
    product = 1.0 + 0.0j
    for i in range(4):
        b, P, Q = _solution(arm, polynomial, numerators, work, i)
        product *= _turned(arm, inner, w, m, b, P, Q)[0]
    rho = w[0] * w[0] + w[1] * w[1]
    return product.real * rho * rho * _poles(arm, polynomial, numerators)


@njit(**STRICT)
def _poles(arm, polynomial, numerators):
    """Return K: the square of the resultant of ``v·n + i v·(h × n)`` and ``P − i Q``, times a constant."""
    a, _, sine, _, kind = arm
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
    """Write the four values of b at which the first three joints reach a point: first to last of INNER."""
    a, _, sine, _, kind = arm
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
        find_roots(work, QUARTIC, QUARTIC + 4, work[INNER : INNER + 4])
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
def _solution(arm, polynomial, numerators, work, i):
    """Return b, P and Q of one of the four."""
    a, _, sine, _, kind = arm
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
def _turned(arm, inner, w, m, b, P, Q):
    """Return the residual of the direction at a solution, and exp(i q) of the two joints in the middle."""
    a, cosine, sine, wanted, _ = arm
    low, rest, high, along, along1 = _complex(inner[0])
    back = inverse_of(b)
    z = low * back + rest + high * b
    z_ = high.conjugate() * back + rest.conjugate() + low.conjugate() * b
    zh = along + along1 * b + along1.conjugate() * back
    e, e_ = _turn(P + 1j * Q, P - 1j * Q, z, z_)
    low, rest, high, along, along1 = _complex(inner[1])
    d = (low * back + rest + high * b) * e
    d_ = (high.conjugate() * back + rest.conjugate() + low.conjugate() * b) * e_
    dh = along + along1 * b + along1.conjugate() * back
    x, y = 0.5 * (d + d_), -0.5j * (d - d_)
    y, h = cosine * y - sine * dh, cosine * dh + sine * y
    side = cosine * Q - sine * zh
    f, f_ = _turn(complex(w[0], w[1]), complex(w[0], -w[1]), P + a + 1j * side, P + a - 1j * side)
    u, u_ = (x + 1j * y) * f, (x - 1j * y) * f_
    return 0.5 * (complex(m[0], -m[1]) * u + complex(m[0], m[1]) * u_) + m[2] * h - wanted, e, f


@njit(**STRICT)
def _turn(to, to_, of, of_):
    """Return ``e = exp(i q)`` and 1/e of a rotation: ``to = e of`` and ``to_ = of_ / e``."""
    return (
        to * inverse_of(of) if size2(of) > size2(to_) else of_ * inverse_of(to_),
        to_ * inverse_of(of_) if size2(of_) > size2(to) else of * inverse_of(to),
    )


@njit(**STRICT)
def _start(work, first, count):
    """Write estimates of roots: near the unit circle, without its symmetry, which the method would keep."""
    for k in range(count):
        angle, radius = (2.0 * math.pi * k + 0.7) / count, 0.8 if k % 2 else 1.2
        work[first + k] = complex(radius * math.cos(angle), radius * math.sin(angle))


@njit(**STRICT)
def _interpolate(work):
    """Write the coefficients of N as a polynomial in exp(i q); return where the first and the last are."""
    largest = 0.0
    for k in range(DEGREE + 1):
        total = 0.0j
        for i in range(SAMPLES):
            turn = (i * k) % SAMPLES
            total += work[VALUES + i].real * complex(COSINES[turn], -SINES[turn])
        work[COEFFICIENTS + DEGREE + k] = total
        work[COEFFICIENTS + DEGREE - k] = total.conjugate()
        largest = max(largest, size2(total))
    degree = DEGREE
    while degree > 0 and not size2(work[COEFFICIENTS + DEGREE + degree]) > LEAST_COEFFICIENT2 * largest:
        degree -= 1
    return COEFFICIENTS + DEGREE - degree, COEFFICIENTS + DEGREE + degree


@njit(**STRICT)
def _solutions(
    g, joint, limits, forward, fixed, T, q, exists, inside, memory, R, arm, inner, outer, polynomial,
    k, found,
):  # fmt: skip
    """Write the configurations at root k of N after those that were found; return how many there are now."""
    work = memory.numbers
    z = work[ROOTS + k]
    if not abs(math.log(size2(z))) < 2.0 * NEARLY_REAL:
        return found
    x = math.atan2(z.imag, z.real)
    c, s = math.cos(x), math.sin(x)
    w, m = _at(outer[0], c, s), _at(outer[1], c, s)
    numerators = _numerators(arm, polynomial, w)
    _reach(arm, polynomial, numerators, work)
    for i in range(4):
        b, P, Q = _solution(arm, polynomial, numerators, work, i)
        r, e, f = _turned(arm, inner, w, m, b, P, Q)
        if not size2(r) < NEARLY_ZERO * NEARLY_ZERO or found == q.shape[0]:
            continue
        other = math.atan2(b.imag, b.real)
        q2, q3 = math.atan2(f.imag, f.real), math.atan2(e.imag, e.real)
        q1, q4 = x, other
        if g[OUTER_LAST]:
            q1, q2, q3, q4 = other, q3, q2, x
        row = q[found]
        fits = write_branch(joint, limits, g[PAIR_PHI], (q1, q2, q3, q4, *_wrist(g, R, q1, q2, q3, q4)), row)
        reaches = polish_in(forward, fixed, row, T, memory.J, memory.A)
        if not reaches or misses(forward, row, T) or _is_known(q, found):
            continue
        fits = True
        for j in range(row.shape[0]):
            if not fixed[j]:
                row[j] = nearest_turn(limits, j, row[j])
            fits = fits and within(limits, j, row[j])
        exists[found], inside[found] = True, fits
        found += 1
    return found


@njit(**STRICT)
def _wrist(g, R, q1, q2, q3, q4):
    """Return joints 5 and 6: R5 R6 = (R1 R2 R3 R4)⁻¹ R_G."""
    h5, h6 = vec(g, AXES + 12), vec(g, AXES + 15)
    side = perpendicular(h6)
    a, b = times(R, h6), times(R, side)
    h1, h2, h3, h4 = vec(g, AXES), vec(g, AXES + 3), vec(g, AXES + 6), vec(g, AXES + 9)
    for axis, angle in ((h1, q1), (h2, q2), (h3, q3), (h4, q4)):
        c, s = math.cos(angle), math.sin(angle)
        a, b = rotate(axis, -s, c, a), rotate(axis, -s, c, b)
    y, x = subproblem1(h5, h6, a)
    q5 = math.atan2(y, x)
    y, x = subproblem1(h6, side, rotate(h5, -math.sin(q5), math.cos(q5), b))
    return q5, math.atan2(y, x)


@njit(**STRICT)
def _is_known(q, found):
    """Whether the configuration in a row is that of a row before it, up to full turns."""
    for i in range(found):
        largest = 0.0
        for j in range(q.shape[1]):
            d = q[i, j] - q[found, j]
            largest = max(largest, abs(d - 2.0 * math.pi * math.floor(d / (2.0 * math.pi) + 0.5)))
        if largest < SAME:
            return True
    return False
