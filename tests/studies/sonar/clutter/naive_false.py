"""Textbook twin of a track that a false plot begins, with plots drawn in its gate: plain Python, one realisation.

Boxes, probabilities and weights are computed anew; the filter is that of `naive`. Random words are asked for.
"""

import math

import numpy as np
from scipy import stats

from tests.studies.sonar.clutter.naive import H, foretold, nearest, pda

ONE = 2.0**-52


def unit(word):
    """A word as a number between 0 and 1."""
    return (word >> 12) * ONE + ONE / 2


def halves(word):
    """A word as two."""
    return [(half + 0.5) * 2.0**-32 for half in (word >> 32, word & 0xFFFFFFFF)]


def box_of(place, S, gate, sector):
    """Limits of q = r²/2 and of the bearing of the box about a gate within the sector, which is no full circle."""
    (near, far), (first, last) = sector
    wide, high = np.sqrt(gate * S[0, 0]), np.sqrt(gate * S[1, 1])
    q = max(place[0] - wide, near) ** 2 / 2, min(place[0] + wide, far) ** 2 / 2
    return q, (max(place[1] - high, first), min(place[1] + high, last))


def poisson_over_zero(mean, v):
    """The number of which the distribution function, of numbers over zero, first exceeds v."""
    none = math.exp(-mean)
    return next(n for n in range(1, 500) if stats.poisson.cdf(n, mean) > none + v * (1 - none))


def second(first, z, span, sigma):
    """State and covariance of a track of two plots, span apart."""
    A = np.array([[1, -span], [1, 0.0]])
    inverse, lines = np.linalg.inv(A.T @ A), np.linalg.solve(A, np.stack([first, z]))
    P = np.zeros((4, 4))
    P[:2, :2], P[2:, 2:] = sigma[0] ** 2 * inverse, sigma[1] ** 2 * inverse
    return np.array([lines[0, 0], lines[1, 0], lines[0, 1], lines[1, 1]]), P


class FalseTrack:
    """One track; words(k, n) gives the two words of draw n of scan k, field(k) the plots (n, 2) of a whole scan."""

    def __init__(self, choice, given, gate, sector, words, field):
        self.choice, self.given, self.gate, self.sector = choice, given, gate, sector
        self.words, self.field = words, field

    def drawn(self, k, place, S, needed, shifts):
        """Plots in the box, and the factor of the ratio of the law that shifts them; whether it is drawn from."""
        (low, high), (left, right) = box_of(place, S, self.gate, self.sector)
        mean = self.given.density * max(high - low, 0.0) * max(right - left, 0.0)
        if mean == 0:  # the gate is outside the sector
            return np.empty((0, 2)), 1.0
        p = 1 - math.exp(-mean)
        shifted = max(needed, p)
        h = shifted if shifts else p
        one, two = self.words(k, 0)
        if unit(one) >= h:
            return np.empty((0, 2)), (1 - shifted) / (1 - p)
        places = [two]
        number = poisson_over_zero(mean, unit(one) / h)
        while len(places) < number:
            places += self.words(k, (len(places) + 1) // 2)
        found = []
        for word in places[:number]:
            u, v = halves(word)
            found.append((math.sqrt(2 * (low + (high - low) * u)), left + (right - left) * v))
        return np.array(found), shifted / p

    def foretold(self, x, P, first, hits, since):
        """Where the next plot is looked for, S about it, and state and covariance there; since: scans since the last
        of the plots, whose number is hits. A track of one plot, `first`, has no state.
        """
        choice, sigma, T = self.choice, self.given.sigma, self.given.period
        if hits == 1:
            reach = choice.speed * since * T
            return first, np.diag(2 * sigma**2) + np.diag([reach**2, (reach / first[0]) ** 2]), x, P
        x, P, S = foretold(x, P, T, choice.variance, sigma)
        return H @ x, S, x, P

    def updated(self, x, P, place, S, plots, first, hits, since):
        """State and covariance after a scan, and whether one of its plots (n, 2) was in the gate; see `foretold`."""
        choice, sigma = self.choice, self.given.sigma
        squared = np.einsum("ni,ij,nj->n", plots - place, np.linalg.inv(S), plots - place)
        taken = plots[squared <= self.gate]
        if len(taken) == 0:
            return x, P, False
        if hits == 1:
            nearby = taken[np.argmin(squared[squared <= self.gate])]
            return *second(first, nearby, since * self.given.period, sigma), True
        if choice.association == "pda":
            given = (self.given.detection, choice.gate_probability, self.given.density * place[0])
            return *pda(x, P, S, taken, sigma, *given), True
        return *nearest(x, P, S, taken, sigma), True

    def follow(self, first, scans, law, shares):
        """Weights at the end and at each scan held, of the track that the plot `first` (2,) begins.

        law 0: as it is; 1: drawn so that it is confirmed; 2: so that it is held on. shares (3,) of these laws.
        """
        choice, sigma = self.choice, self.given.sigma
        state, hits, misses, last, held, ratios = 1, 1, 0, 0, [], np.ones(3)
        x = P = None
        for k in range(1, scans):
            place, S, x, P = self.foretold(x, P, first, hits, k - last)
            if state == 1:
                plots, factor = self.drawn(k, place, S, (choice.m - hits) / (choice.n - k), law > 0)
                ratios[1:] *= factor
            elif shares[2]:
                plots, factor = self.drawn(k, place, S, 1 / (choice.misses - misses), law == 2)
                ratios[2] *= factor
            else:
                plots = self.field(k)
            x, P, hit = self.updated(x, P, place, S, plots, first, hits, k - last)
            hits, misses, last = (hits + 1, 0, k) if hit else (hits, misses + 1, last)
            if state == 1:
                state = 2 if hits >= choice.m else int(hits + choice.n - k - 1 >= choice.m)
            elif misses >= choice.misses or (np.diag(P)[[0, 2]] > (choice.lost * sigma) ** 2).any():
                state = 0
            held += [1 / (shares @ ratios)] if state == 2 else []
            if state == 0:
                break
        return 1 / (shares @ ratios), held
