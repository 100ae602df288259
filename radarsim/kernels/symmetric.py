"""Small algebra of a hypothesis: nine states, their covariance as six 3 x 3 blocks, for plain numbers or lanes alike.

An axis is the triple (coordinate, velocity, acceleration). A block on the diagonal, own to one axis, is packed
symmetric: p = (xx, xv, xa, vv, va, aa); a block between two axes is full, row by row: c = (xx, xv, xa, vx, vv, va,
ax, av, aa). Packing keeps the covariance symmetric by construction: `P - K S K'` on full storage drifts and
diverges silently.

Differences are written term by term, `p - g0*h0 - g1*h1 - g2*h2`: each is one fused instruction; `p - dot(g, h)` is
not.
"""

from radarsim.kernels.compile import inline


@inline
def predicted_axis(x, f):
    """F x of one axis; f = (f01, f02, f11, f12, f22) are the elements of F = [[1, f01, f02], [0, f11, f12], [0, 0,
    f22]]."""
    return x[0] + f[0] * x[1] + f[1] * x[2], f[2] * x[1] + f[3] * x[2], f[4] * x[2]


@inline
def predicted_own(p, f, q):
    """F p F' + Q of an own block (P2 eq. 6)."""
    x0 = p[0] + f[0] * p[1] + f[1] * p[2]
    x1 = p[1] + f[0] * p[3] + f[1] * p[4]
    x2 = p[2] + f[0] * p[4] + f[1] * p[5]
    v1 = f[2] * p[3] + f[3] * p[4]
    v2 = f[2] * p[4] + f[3] * p[5]
    return (
        x0 + f[0] * x1 + f[1] * x2 + q[0],
        f[2] * x1 + f[3] * x2 + q[1],
        f[4] * x2 + q[2],
        f[2] * v1 + f[3] * v2 + q[3],
        f[4] * v2 + q[4],
        f[4] * (f[4] * p[5]) + q[5],
    )


@inline
def predicted_cross(c, f):
    """F c F' of a block between two axes; the axes' noises are independent, so nothing is added."""
    a0, a1, a2 = predicted_axis((c[0], c[3], c[6]), f)
    b0, b1, b2 = predicted_axis((c[1], c[4], c[7]), f)
    d0, d1, d2 = predicted_axis((c[2], c[5], c[8]), f)
    return predicted_axis((a0, b0, d0), f) + predicted_axis((a1, b1, d1), f) + predicted_axis((a2, b2, d2), f)


@inline
def factored(s):
    """L D L' of a symmetric positive 3 x 3 matrix s = (00, 01, 02, 11, 12, 22): (l10, l20, l21), 1 / D, determinant.

    Updates go by whitened rows and not by the inverse: its rounding, of the size of the condition number (3·10⁶ for
    angles of one degree at 200 km), made covariances negative after some 600 scans.
    """
    minor = s[0] * s[3] - s[1] * s[1]
    m = s[0] * s[4] - s[1] * s[2]
    whole = minor * (s[0] * s[5] - s[2] * s[2]) - m * m  # the determinant times s00
    scale = 1.0 / (s[0] * minor * whole)  # one division for all, they are slow
    i0, by_minor = scale * minor * whole, scale * s[0] * whole
    i2 = s[0] * minor * (scale * s[0] * minor)
    return (s[1] * i0, s[2] * i0, m * by_minor), (i0, s[0] * by_minor, i2), whole * i0


@inline
def whitened(h, lower):
    """L⁻¹ h of a row h (3)."""
    y1 = h[1] - lower[0] * h[0]
    return h[0], y1, h[2] - lower[1] * h[0] - lower[2] * y1


@inline
def scaled(y, i):
    """Row y (3) by the diagonal i (3)."""
    return y[0] * i[0], y[1] * i[1], y[2] * i[2]


@inline
def dot(a, b):
    """Scalar product of two triples."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inline
def shrunk(p, g, h):
    """p - g h' of one element: h a whitened row of P H', g a scaled one."""
    return p - g[0] * h[0] - g[1] * h[1] - g[2] * h[2]


@inline
def shrunk_own(p, g, h):
    """Own block after an update; g and h are the three rows of its axis."""
    return (
        shrunk(p[0], g[0], h[0]),
        shrunk(p[1], g[0], h[1]),
        shrunk(p[2], g[0], h[2]),
        shrunk(p[3], g[1], h[1]),
        shrunk(p[4], g[1], h[2]),
        shrunk(p[5], g[2], h[2]),
    )


@inline
def shrunk_cross(c, g, h):
    """Block between two axes after an update: g the rows of the first axis, h those of the second."""
    return (
        shrunk(c[0], g[0], h[0]),
        shrunk(c[1], g[0], h[1]),
        shrunk(c[2], g[0], h[2]),
        shrunk(c[3], g[1], h[0]),
        shrunk(c[4], g[1], h[1]),
        shrunk(c[5], g[1], h[2]),
        shrunk(c[6], g[2], h[0]),
        shrunk(c[7], g[2], h[1]),
        shrunk(c[8], g[2], h[2]),
    )
