"""Textbook twins of the filters in the plane: full matrices in NumPy, one realisation.

Nothing is shared with the package. A state is (x, y, vx, vy, …), with the accelerations or the rate of turn.
Derivatives are complex steps.
"""

import math

import numpy as np
from scipy.stats import chi2

SIZES = {"velocity": 4, "acceleration": 6, "turn": 5}
RESOLVED = 10.0  # standard deviations of a predicted velocity in an interval whose fold is known
CENTRE = 1 / 3  # weight of the central sigma point


def jacobian(f, x, h=1e-30):
    """Derivatives of f at x by complex steps: exact to rounding."""
    return np.array([np.imag(f(x + 1j * h * row)) / h for row in np.eye(len(x))]).T


def wrapped(angle):
    return (angle + math.pi) % math.tau - math.pi


def folded(v, span):
    return (v + span / 2) % span - span / 2


# ---- motion ---------------------------------------------------------------------------------------------------------
def sine_ratio(a):
    """sin a over a, of complex a too: near zero a series, as a quotient loses the derivative."""
    if abs(a) > 0.3:
        return np.sin(a) / a
    return sum((-1) ** k * a ** (2 * k) / math.factorial(2 * k + 1) for k in range(8))


def turned(x, dt):
    """Coordinated turn, which has no gap at a rate of zero."""
    a = x[4] * dt
    along, across = dt * sine_ratio(a), dt * np.sin(a / 2) * sine_ratio(a / 2)
    return np.array(
        [
            x[0] + along * x[2] - across * x[3],
            x[1] + across * x[2] + along * x[3],
            np.cos(a) * x[2] - np.sin(a) * x[3],
            np.sin(a) * x[2] + np.cos(a) * x[3],
            x[4],
        ]
    )


def predicted(x, P, model, dt, noise):
    """noise: σ of acceleration, or of jerk; σ of the step of the rate of turn."""
    n, used = len(x), SIZES[model]
    orders = 3 if model == "acceleration" else 2
    g = np.array([dt**p / math.factorial(p) for p in range(orders, 0, -1)])
    F, Q = np.zeros((n, n)), np.zeros((n, n))
    Q[: 2 * orders, : 2 * orders] = noise[0] ** 2 * np.kron(np.outer(g, g), np.eye(2))
    if model == "turn":
        F, Q[4, 4] = jacobian(lambda y: turned(y, dt), x), noise[1] ** 2
        return turned(x, dt), F @ P @ F.T + Q
    powers = range(orders)
    coordinate = [[dt ** (j - i) / math.factorial(j - i) if j >= i else 0 for j in powers] for i in powers]
    F[:used, :used] = np.kron(coordinate, np.eye(2))
    return F @ x, F @ P @ F.T + Q


# ---- a plot ---------------------------------------------------------------------------------------------------------
def polar(x):
    """Range, tangent's angle (of the right derivative, not of the right half), radial velocity; also of complex x."""
    r = np.sqrt(x[0] ** 2 + x[1] ** 2)
    return np.array([r, np.arctan(x[1] / x[0]), (x[0] * x[2] + x[1] * x[3]) / r])


def seen(x):
    return np.array([np.hypot(x[0], x[1]), math.atan2(x[1], x[0]), (x[0] * x[2] + x[1] * x[3]) / np.hypot(x[0], x[1])])


class Filter:
    """A filter of a config: `radar` and `keys` are its parts."""

    def __init__(self, radar, keys, in_clutter):
        self.radar, self.keys, self.in_clutter = radar, keys, in_clutter
        self.m = 3 if keys.doppler else 2
        r, b, v = radar.sigma_range_m, radar.sigma_bearing_rad, radar.sigma_velocity_mps
        both = radar.range_velocity_correlation * r * v
        self.R = np.array([[r * r, 0, both], [0, b * b, 0], [both, 0, v * v]])
        rate = radar.repetition_rate_hz
        self.span = 2 * 12_000.0 if rate is None else radar.wavelength_m * rate / 2
        self.gate = chi2.ppf(keys.gate_probability, self.m)
        self.noise = [
            keys.sigma_jerk_mps3 if keys.model == "acceleration" else keys.sigma_acceleration_mps2,
            keys.sigma_turn_rate_radps,
        ]
        self.models = [(keys.model, self.noise)]
        if keys.kind == "imm":
            self.models.append(("velocity", [keys.quiet_sigma_acceleration_mps2, 0.0]))
            stay = math.exp(-radar.scan_period_s / keys.mean_stay_s)
            self.change = np.array([[stay, 1 - stay], [1 - stay, stay]])

    def start(self, z):
        keys, n = self.keys, SIZES[self.keys.model]
        J = np.array([[math.cos(z[1]), -math.sin(z[1])], [math.sin(z[1]), math.cos(z[1])]])
        told = keys.doppler and self.span >= RESOLVED * keys.sigma_start_velocity_mps
        radial = self.R[2, 2] if told else keys.sigma_start_velocity_mps**2
        P = np.zeros((n, n))
        P[:2, :2] = J @ np.diag([self.R[0, 0], (z[0] * self.radar.sigma_bearing_rad) ** 2]) @ J.T
        P[2:4, 2:4] = J @ np.diag([radial, keys.sigma_start_velocity_mps**2]) @ J.T
        if told:
            P[:2, 2:4] = P[2:4, :2] = J @ np.diag([self.R[0, 2], 0]) @ J.T
        if n == 6:
            P[4:, 4:] = keys.sigma_start_acceleration_mps2**2 * np.eye(2)
        if n == 5:
            P[4, 4] = keys.sigma_start_turn_rate_radps**2
        x = np.zeros(n)
        x[:2], x[2:4] = J @ [z[0], 0], J @ [z[2] if told else 0, 0]
        self.x, self.P = [x.copy() for _ in self.models], [P.copy() for _ in self.models]
        self.p = np.full(len(self.models), 1 / len(self.models))
        self.hits, self.confirmed, self.wrong = [True], False, False

    def predict(self, dt):
        if len(self.models) == 2:  # interaction
            c = self.change.T @ self.p
            mixed = [self.moments(self.change[:, j] * self.p / c[j]) for j in range(2)]
            (self.x, self.P), self.p = map(list, zip(*mixed, strict=True)), c
        for j, (model, noise) in enumerate(self.models):
            self.x[j], self.P[j] = predicted(self.x[j], self.P[j], model, dt, noise)

    def moments(self, p=None):
        p = self.p if p is None else p
        x = sum(q * y for q, y in zip(p, self.x, strict=True))
        return x, sum(q * (P + np.outer(y - x, y - x)) for q, y, P in zip(p, self.x, self.P, strict=True))

    def apart(self, z, mean):
        """Less the expected plot, the numbers in use."""
        velocity = [folded(z[2] - mean[2], self.span)] if self.m == 3 else []
        return np.array([z[0] - mean[0], wrapped(z[1] - mean[1]), *velocity])

    def law(self, x, P):
        """Mean, covariance S (m, m) of a plot, and with the state C (n, m); nothing of a velocity of unknown fold."""
        m, R = self.m, self.R[: self.m, : self.m]
        if self.keys.kind == "unscented":
            n, centre = len(x), seen(x)
            roots = np.linalg.cholesky(n / (1 - CENTRE) * P).T
            w = np.array([CENTRE] + 2 * n * [(1 - CENTRE) / (2 * n)])
            X = np.concatenate([x[None], x + roots, x - roots])
            Z = centre[:m] + np.array([self.apart(seen(y), [*centre]) for y in X])
            mean = w @ Z
            S, C = (Z - mean).T @ (w[:, None] * (Z - mean)) + R, (X - x).T @ (w[:, None] * (Z - mean))
        else:
            H = jacobian(polar, x)[:m]
            mean, S, C = seen(x)[:m], H @ P @ H.T + R, P @ H.T
        if m == 3 and S[2, 2] * RESOLVED**2 >= self.span**2:
            S[2, :2] = S[:2, 2] = 0
            C[:, 2] = 0
        if m == 3:
            S[2, 2] = min(S[2, 2], self.span**2 / (2 * np.pi))
        return mean, S, C

    def update(self, plots, there=None, density=0.0):
        """plots (n, 3): of one scan, that of the target first if `there`; density of false plots, per m²."""
        taken, likelihood, marks = [], [], []
        for j in range(len(self.models)):
            x, P, L, mark = self.taken(self.x[j], self.P[j], np.asarray(plots), there, density)
            taken.append((x, P))
            likelihood.append(L)
            marks.append(mark)
        self.x, self.P = map(list, zip(*taken, strict=True))
        if len(self.models) == 2:
            p = self.p * np.array(likelihood)
            self.p = np.clip(p / p.sum(), 1e-9, 1 - 1e-9) if p.sum() > 0 else self.p
        self.remember(*marks[0])

    def taken(self, x, P, plots, there, density):
        """A state after the plots, their likelihood, and whether there is one in the gate, and whether it is wrong."""
        mean, S, C = self.law(x, P)
        e = np.array([self.apart(z, mean) for z in plots]).reshape(-1, self.m)
        inverse = np.linalg.inv(S)
        d = np.einsum("ni,ij,nj->n", e, inverse, e)
        g = np.exp(-d / 2) / math.sqrt(np.linalg.det(2 * math.pi * S))
        if not self.in_clutter:
            return *self.by_plot(x, P, (mean, S, C), plots[0], e[0]), g[0], (True, False)
        rule, P_D, P_G = self.keys.association, self.radar.detection_probability, self.keys.gate_probability
        if rule == "known":
            if not there:
                return x, P, 1.0, (False, False)
            return *self.by_plot(x, P, (mean, S, C), plots[0], e[0]), g[0], (True, False)
        inside = d < self.gate
        own = bool(there) and bool(inside[0])
        false = density * mean[0] / (self.span if self.m == 3 else 1) * (1 - P_D * P_G) / P_D
        if not inside.any():
            return x, P, false, (False, False)
        best = int(np.argmin(np.where(inside, d, np.inf)))
        mark = True, not (own and best == 0)
        if rule == "nearest":
            return *self.by_plot(x, P, (mean, S, C), plots[best], e[best]), g[best] + false, mark
        beta, e = g[inside] / (false + g[inside].sum()), e[inside]
        mixed = beta @ e
        K = C @ inverse
        spread = np.einsum("n,ni,nj->ij", beta, e, e) - np.outer(mixed, mixed)
        after = P - beta.sum() * K @ S @ K.T + K @ spread @ K.T
        return x + K @ mixed, after, false + g[inside].sum(), mark

    def by_plot(self, x, P, law, z, e):
        if self.keys.kind == "converted":
            return self.by_converted(x, P, z)
        _, S, C = law
        K = C @ np.linalg.inv(S)
        return x + K @ e, P - K @ S @ K.T

    def by_converted(self, x, P, z):
        (r, b, v), keys, n = z, self.keys, len(x)
        sr, sb, sv = np.sqrt(np.diag(self.R))
        cos, sin = math.cos(b), math.sin(b)
        if keys.unbiased:  # Longbin et al. 1998, eq. 10, 11
            one, two = math.exp(-sb * sb / 2), math.exp(-2 * sb * sb)
            place = np.array([cos, sin]) * r / one
            square, half = r * r * (one**-2 - 2), (r * r + sr * sr) / 2
            R = np.empty((2, 2))
            R[0, 0] = square * cos**2 + half * (1 + two * math.cos(2 * b))
            R[1, 1] = square * sin**2 + half * (1 - two * math.cos(2 * b))
            R[0, 1] = square * sin * cos + half * two * math.sin(2 * b)
            R[1, 0] = R[0, 1]
        else:
            J = np.array([[cos, -r * sin], [sin, r * cos]])
            place, R = r * np.array([cos, sin]), J @ np.diag([sr * sr, sb * sb]) @ J.T
        x, P = joseph(x, P, np.eye(2, n), place - x[:2], R)
        if not keys.doppler:
            return x, P
        if keys.doppler_update == "linear":
            H = np.zeros((1, n))
            H[0, 2:4] = cos, sin
            e, R = v - H[0] @ x, sv**2 + sb**2 * (x[3] * cos - x[2] * sin) ** 2
        else:
            H, e, R = jacobian(polar, x)[2:], v - seen(x)[2], sv**2
        if (H @ P @ H.T + R)[0, 0] * RESOLVED**2 >= self.span**2:
            return x, P
        # Of its error, that part is taken away which the linearised error of the position tells.
        J = np.array([[cos, -r * sin], [sin, r * cos]])
        L = (J @ self.R[:2, 2]) @ np.linalg.inv(J @ self.R[:2, :2] @ J.T)
        told = L @ J @ self.R[:2, 2]
        e, H = folded(e, self.span) - L @ (place - x[:2]), H - L @ np.eye(2, n)
        return joseph(x, P, H, np.array([e]), np.array([[R - told]]))

    def remember(self, has_plot, wrong):
        keys = self.keys
        self.hits.append(has_plot)
        self.wrong = wrong
        self.confirmed = self.confirmed or sum(self.hits[-keys.confirming_scans :]) >= keys.confirming_plots

    def estimate(self):
        """Range, bearing, speed, course."""
        x, _ = self.moments()
        return np.array([*seen(x)[:2], np.hypot(x[2], x[3]), math.atan2(x[3], x[2])])

    def covariance(self):
        """Of the estimate (4, 4), not-a-number for a state that stands still."""
        x, P = self.moments()
        if not x[2:4].any():
            return np.full((4, 4), np.nan)
        J = jacobian(lambda y: np.array([*polar(y)[:2], np.sqrt(y[2] ** 2 + y[3] ** 2), np.arctan(y[3] / y[2])]), x)
        return J @ P @ J.T


def joseph(x, P, H, e, R):
    S = H @ P @ H.T + R
    K = P @ H.T @ np.linalg.inv(S)
    A = np.eye(len(x)) - K @ H
    return x + K @ e, A @ P @ A.T + K @ R @ K.T


def follow(radar, keys, t, plots):
    """Estimates (K, 4) and covariances (K, 4, 4) over the plots (K, 3) of a realisation, not-a-number where missed."""
    tracker, estimates, covariances = Filter(radar, keys, False), [], []
    for k, z in enumerate(plots):
        if k == 0:
            tracker.start(z)
        else:
            tracker.predict(t[k] - t[k - 1])
            if np.isfinite(z[0]):
                tracker.update([z])
        estimates.append(tracker.estimate())
        covariances.append(tracker.covariance())
    return np.array(estimates), np.array(covariances)


def follow_among_false(radar, keys, t, target, false, truth):
    """As `follow`, with the false plots (K, M, 3); and whether (K, 3) the track is kept, confirmed, and takes a wrong
    plot for the likeliest. truth (K, 2): range and bearing."""
    tracker, estimates, covariances, events, kept = Filter(radar, keys, True), [], [], [], True
    for k, (z, others) in enumerate(zip(target, false, strict=True)):
        there, in_clutter = bool(np.isfinite(z[0])), k > 0 and t[k] >= radar.false_plots_from_s
        if k == 0:
            tracker.start(z)
        else:
            tracker.predict(t[k] - t[k - 1])
            others = others[np.isfinite(others[:, 0])]
            plots = np.concatenate([[z], others]) if there else others
            tracker.update(plots, there, in_clutter * 1e-6 * radar.false_plots_per_km2)
        e = tracker.estimate()[:2] - truth[k]
        off = np.abs([e[0], wrapped(e[1])]) >= [10 * radar.sigma_range_m, 10 * radar.sigma_bearing_rad]
        kept = kept and not (in_clutter and off.any())
        events.append([kept, tracker.confirmed, tracker.wrong])
        estimates.append(tracker.estimate())
        covariances.append(tracker.covariance())
    return np.array(estimates), np.array(covariances), np.array(events)
