"""Textbook twin of the target's track drawn where it ends: plain Python and NumPy, one realisation.

Laws, ratios and weights are computed anew; the filter is that of `naive`, boxes are those of `naive_false.box_of`.
"""

import functools
import math

import numpy as np
from scipy import integrate, special

from tests.studies.sonar.clutter.naive import H
from tests.studies.sonar.clutter.naive_false import FalseTrack, box_of

MOST = 16.0  # false plots in a box, in the mean, up to which they are drawn in it


def run_comes(length, p):
    """The probability, by misses in a row and scans left, that so many misses in a row come; p a scan."""

    @functools.cache
    def comes(misses, left):
        if misses == length:
            return 1.0
        return p * comes(misses + 1, left - 1) + (1 - p) * comes(0, left - 1) if left else 0.0

    return comes


def ended_by(detection, m, n, misses, scans):
    """Probability (scans,) that the first confirmed track has ended, with open gates and without false plots.

    A chain of states: none; tentative of an age with so many plots; confirmed with so many misses in a row; ended.
    """
    now, out = {"none": 1.0}, []
    for _ in range(scans):
        then = {}
        for state, share in now.items():
            for seen, p in ((True, detection), (False, 1 - detection)):
                to = follows(state, seen, m, n, misses)
                then[to] = then.get(to, 0.0) + share * p
        now = then
        out.append(now.get("ended", 0.0))
    return np.array(out)


def follows(state, seen, m, n, most):
    """The state after a scan that gave a plot or none."""
    if state in ("none", "ended"):
        return ("tentative", 1, 1) if seen and state == "none" else state
    kind, age, number = state
    if kind == "confirmed":
        return ("confirmed", 0, 0 if seen else number + 1) if seen or number + 1 < most else "ended"
    age, number = age + 1, number + seen
    if number == m:
        return ("confirmed", 0, 0)
    return ("tentative", age, number) if number + n - age >= m else "none"


def shortest(t, j, out=3):
    """The shortest errors with which `out` plots after the first j are each their σ off the line through these."""
    A = np.zeros((out, len(t)))
    for h in range(out):
        for i in range(j):
            A[h, i] = -np.polyval(np.polyfit(t[:j], np.eye(j)[i], 1), t[j + h])
        A[h, j + h] = 1.0
    return np.linalg.lstsq(A, np.linalg.norm(A, axis=1), rcond=None)[0]


def missing(off, S, gate, sigma):
    """The probability that a plot off a gate's centre by `off` (2,) in the mean is outside the gate: an integral.

    Over the angle of which the sine gives the range: with the range itself, roots at the gate's ends cost digits.
    """
    wide = math.sqrt(gate * S[0, 0])
    low, high = max(-wide, off[0] - 9 * sigma[0]), min(wide, off[0] + 9 * sigma[0])
    if low >= high:
        return 1.0

    centre, reach = (low + high) / 2, (high - low) / 2

    def density(angle):
        r = centre + reach * math.sin(angle)
        half = math.sqrt(max(gate - r**2 / S[0, 0], 0) * (S[1, 1] - S[0, 1] ** 2 / S[0, 0]))
        middle, z = S[0, 1] / S[0, 0] * r - off[1], (r - off[0]) / sigma[0]
        across = special.ndtr((middle + half) / sigma[1]) - special.ndtr((middle - half) / sigma[1])
        return reach * math.cos(angle) * math.exp(-(z**2) / 2) / sigma[0] / math.sqrt(2 * math.pi) * across

    middle = math.asin((min(max(off[0], low), high) - centre) / reach)
    return 1 - sum(
        integrate.quad(density, *ends, epsabs=1e-13, epsrel=1e-12, limit=200)[0]
        for ends in ((-math.pi / 2, middle), (middle, math.pi / 2))
    )


class Laws:
    """The laws of a tracker whose target may give a plot at all scans, with shares of their own."""

    def __init__(self, choice, given, gate, scans, misses):
        self.p = 1 - given.detection * choice.gate_probability
        self.runs = {length: run_comes(length, self.p) for length in range(1, misses + 1)}
        t = given.period * np.arange(choice.m + 6)
        shift = [shortest(t, j) for j in range(choice.m, choice.m + 4)] if choice.gate_probability < 1 else []
        self.far = [one / np.linalg.norm(one) for one in shift]
        self.squared = [max(gate * (one @ one) / 2, 2.0) for one in shift]
        self.scans, self.inside, self.detection = scans, choice.gate_probability, given.detection

    def undetected(self, length, longest, misses, k):
        """h of the law for a run of this length; 0: the law itself."""
        if longest >= length:
            return 1 - self.detection
        comes, left = self.runs[length], self.scans - 1 - k
        missed, hit = self.p * comes(misses + 1, left), (1 - self.p) * comes(0, left)
        return 1 - hit / (missed + hit) / self.inside if missed + hit else 1 - self.detection


class TargetTrack(FalseTrack):
    """One track of the target; see `FalseTrack`. truth (K, 2) are the target's places."""

    def end(self, laws, law, shares, truth, errors, u, scans):
        """The scan of the end, whether it is lost, whether a false plot came beside the target's, and the weight.

        None for the scan if it does not end.

        law counts the law itself, runs, far plots, false plots; shares are of these. errors (K, 2) of the plots over
        σ, u (K,) the numbers that decide on detection.
        """
        choice, sigma, n = self.choice, self.given.sigma, len(laws.runs)
        J = choice.m + 6
        errors = errors.copy()
        if n < law <= n + len(laws.far):
            along, s = laws.far[law - 1 - n], math.sqrt(laws.squared[law - 1 - n])
            errors[:J] += (s - 1) * np.outer(along, along @ errors[:J])
        rho = [np.sum((along @ errors[:J]) ** 2) for along in laws.far]
        far = [math.exp(r / 2 * (1 - 1 / s)) / s for r, s in zip(rho, laws.squared, strict=True)]
        ratios = np.array([1.0, *np.ones(n), *far, *([1.0, 1.0] if self.given.density else [])])
        lured = self.given.density and law == len(ratios) - 1
        state = longest = came = seduced = misses = hits = 0
        begun = last = first = x = P = S = place = None
        for k in range(scans):
            z = truth[k] + sigma * errors[k]
            if state:
                place, S, x, P = self.foretold(x, P, first, hits, k - last)
            d, p, eta = 1 - laws.detection, 0.0, 0.0
            if state:
                p = self.in_box(k - begun, place, S)
                left = choice.n + 3 - (k - begun)
                eta = max(2 / (1 + left), d * p) if p and k < J and not seduced else 0.0
            h = eta + (1 - eta) * d * (1 - p) / (1 - d * p) if lured and eta else d
            if state == 2 and 1 <= law <= n:
                h = laws.undetected(law, max(longest, misses), misses, k)
            seen = u[k] < 1 - h
            if state == 2:
                longest = max(longest, misses)
                if longest < n:
                    nu, c = z - place, 0.0
                    hit = seen
                    if k >= J:
                        hit = seen and nu @ np.linalg.inv(S) @ nu <= self.gate
                        c = 0.0 if hit else missing(truth[k] - place, S, self.gate, sigma)
                    for length in laws.runs:
                        drawn = laws.undetected(length, longest, misses, k)
                        ratios[length] *= (
                            (1 - drawn) / (1 - d) if hit else (drawn + (1 - drawn) * c) / (d + (1 - d) * c)
                        )
            if state == 0:
                if seen:
                    state, begun, last, hits, misses, first = 1, k, k, 1, 0, z
                continue
            plots = np.empty((0, 2)) if not self.given.density else self.field(k) if not p else None
            if plots is None:
                needed = 0.0 if came else 2 / (1 + left)
                drawn = needed if law == len(ratios) - 2 else eta / h if lured and eta and not seen else 0.0
                plots, _ = self.drawn(k, place, S, drawn, True)
                some = len(plots) > 0
                ratios[-2] *= max(needed, p) / p if some else (1 - max(needed, p)) / (1 - p)
                came = came or some
                if eta:
                    seduced = some and not seen
                    ratios[-1] *= eta / (d * p) if seduced else (1 - eta) / (1 - d * p)
            plots = np.concatenate([z[None], plots]) if seen else plots
            x, P, taken = self.updated(x, P, place, S, plots, first, hits, k - last)
            hits, misses, last = (hits + 1, 0, k) if taken else (hits, misses + 1, last)
            if hits < 2:
                state = int(hits + choice.n - (k - begun) - 1 >= choice.m)
                continue
            off = (np.abs(H @ x - truth[k]) > choice.lost * sigma).any()
            vague = (np.diag(P)[[0, 2]] > (choice.lost * sigma) ** 2).any()
            if state == 1:
                confirmed = hits >= choice.m
                state = 2 * (not off) if confirmed else int(hits + choice.n - (k - begun) - 1 >= choice.m)
            elif misses >= choice.misses or off or vague:
                return k, bool(off and misses < choice.misses), bool(came and not seduced), 1 / (shares @ ratios)
        return None, False, False, 1 / (shares @ ratios)

    def in_box(self, age, place, S):
        """p of a box about the gate where false plots are drawn in it, else zero."""
        (low, high), (left, right) = box_of(place, S, self.gate, self.sector)
        mean = self.given.density * max(high - low, 0.0) * max(right - left, 0.0)
        return 1 - math.exp(-mean) if age < self.choice.n + 3 and mean <= MOST else 0.0
