"""Hypotheses on folds and locks: the textbook's list, realisation by realisation, and folded velocity's own filter."""

import copy
import math

import numpy as np
import pytest

from radarsim.api.configs import load
from radarsim.studies import registry
from radarsim.studies.pulses_to_tracks import study
from radarsim.studies.pulses_to_tracks.kernels import block
from radarsim.studies.pulses_to_tracks.kernels.layout import LISTED, NUMBER, RIGHT, TAKEN, WRONG_FOLD, Sums
from tests.studies.pulses_to_tracks.conftest import RANGE, SPECTRUM, A, make_case, plan_and_sums
from tests.studies.pulses_to_tracks.test_kernels import LOCKED_OFF, SPEC, normals, samples_of, textbook_estimate
from tests.tolerances import sigma_error

N = 2048
FOLDING = {"repetition_rate_hz": 1e3, "snr_db": 10.0, "pulse_length_s": 1e-9}  # into 15 m/s
ALL = {"hypotheses": 1000, "prune_below": 0}
MIXTURE = {"use": "mixture", "lock_probability": 0.7}


class List:
    """Hypotheses of one realisation in Python: (track, weight, whether no fold that was taken is wrong) each."""

    def __init__(self, track):
        self.every = [(track, 1.0, True)]

    def take_range(self, z, noise, predict):
        for n, (track, weight, right) in enumerate(self.every):
            predict(track)
            S = track.P[0, 0] + noise**2
            weight *= math.exp(-0.5 * (z - track.x[0]) ** 2 / S) / math.sqrt(S)
            track.take([0], np.array([z]) - track.x[:1], [noise**2])
            self.every[n] = track, weight, right

    def take_burst(self, measured, span, variances, lock, density):
        """All folds of the velocity within nine standard deviations, and a burst that did not lock."""
        rows, branches = list(range(1, 1 + len(measured))), []
        for track, weight, right in self.every:
            if lock < 1:
                branches.append((track, weight * (1 - lock) * density, right))
            reach = math.ceil(9 * math.sqrt(track.P[1, 1] + variances[0]) / span)
            near = round((measured[0] - track.x[1]) / span)
            for n in range(near - reach, near + reach + 1):
                innovation = measured - track.x[rows]
                innovation[0] -= n * span
                branch = copy.deepcopy(track)
                branch.x, branch.P, S = track.updated(rows, innovation, variances)
                distance = innovation @ np.linalg.solve(S, innovation)
                likelihood = math.exp(-0.5 * distance) / math.sqrt(np.linalg.det(2 * math.pi * S))
                good = right and abs(measured[0] - n * span) < span / 2
                branches.append((branch, weight * lock * likelihood, good))
        whole = sum(weight for _, weight, _ in branches)
        self.every = [(track, weight / whole, good) for track, weight, good in branches if weight > 1e-15 * whole]

    @property
    def best(self):
        return max(self.every, key=lambda one: one[1])

    @property
    def mean(self):
        return sum(weight * track.x for track, weight, _ in self.every) / sum(weight for _, weight, _ in self.every)


def textbook_errors(plan, case, f, count):
    """States (K, count, 3) of a filter by its list, and whether its best hypothesis is right (K, count)."""
    from tests.studies.pulses_to_tracks import naive

    spec, options, filter_record = case.spec, case.spec.filters[f], plan.filters.filters[f]
    lock = filter_record["lock"] if options.use == "mixture" else 1.0
    errors, right = np.zeros((spec.scans, count, 3)), np.zeros((spec.scans, count))
    designation, prior = normals(plan, 2, 0, count), plan.world.prior
    noise = [50.0 * normals(plan, 0, k, count)[0] for k in range(spec.scans)]
    bursts = [samples_of(plan, k, np.arange(8))[0] for k in range(spec.scans)]
    for i in range(count):
        every = List(naive.Track(50.0, noise[0][i], prior * [designation[0][i], designation[1][i]], prior))
        for k in range(spec.scans):
            if k:
                variance = options.manoeuvre_variance if k >= 2 else 0.0

                def predict(track, variance=variance, missed=plan.world.model_defects[k]):
                    track.predict(10.0, variance, missed)

                every.take_range(noise[k][i], 50.0, predict)
            x = textbook_estimate(plan, options, f, k, every.best[0], bursts[k][i], [0.0, 0.0], 1 + options.takes)
            measured, variances = (
                (plan.world.measured @ x)[: options.takes],
                plan.filters.sigma[f, k, : options.takes] ** 2,
            )
            measured[0] -= plan.world.span * round(measured[0] / plan.world.span)
            every.take_burst(measured, plan.world.span, variances, lock, filter_record["density"])
            errors[k, i] = every.best[0].x if options.estimate == "best" else every.mean
            right[k, i] = every.best[2]
    return errors, right


LISTS = [
    SPECTRUM | ALL,
    SPECTRUM | ALL | {"name": "best", "estimate": "best"},
    SPECTRUM | ALL | MIXTURE | {"name": "mixture"},
    SPECTRUM | ALL | MIXTURE | {"name": "acceleration", "observes": A, "derivatives": 1},
]


def test_hypotheses_equal_the_textbook_list():
    """Where none is dropped: the sum over all sequences of folds, and of bursts that locked or did not."""
    prior = {"sigma_velocity_mps": 12.0, "sigma_acceleration_mps2": 0.5}
    case = make_case(LISTS, scans=3, burst=FOLDING | {"snr_db": -3.0}, prior=prior)
    plan, count = study.prepare(case), 8
    SPEC[:] = [case.spec]
    sums = Sums(**plan.layout.unpack(np.zeros(plan.layout.size)))
    errors = block.simulate_block(plan.world, plan.filters, sums, 0, count)
    for f, options in enumerate(LISTS):
        expected, right = textbook_errors(plan, case, f, count)
        # The highest line of a spectrum is defined, of bursts that lose lock too.
        assert (abs(errors[f] - expected) / np.array([50.0, 1.0, 0.1])).max() <= LOCKED_OFF, options["name"]
        np.testing.assert_array_equal(sums.folds[f, :, RIGHT], right.sum(axis=1))
    assert (sums.folds[:, -1, NUMBER] > 3 * count).all()
    assert 0 < sums.folds[:, :, RIGHT].min() < count
    assert (sums.locks[2:, :, TAKEN] < count).all()


@pytest.fixture(scope="module")
def wide():
    """P1's targets, of which ± 300 m/s and ± 10 m/s² are known, and bursts at its 1 kHz: D = 15 m/s."""
    prior = {"sigma_velocity_mps": 300.0, "sigma_acceleration_mps2": 10.0}
    many = SPECTRUM | {"name": "many", "hypotheses": 300}
    case = make_case([RANGE, SPECTRUM, many, many | {"name": "few", "hypotheses": 3}], 7, FOLDING, prior, variance=0.0)
    return *plan_and_sums(case, N), case


def test_hypotheses_equal_those_of_folded_velocity(wide):
    """A burst that always locks is a velocity with the error of its bound: the filter is the other study's."""
    plan, sums, _ = wide
    memory = "{name: many, doppler: folded, manoeuvre_variance: 0, hypotheses: 300}"
    few = "{name: few, doppler: folded, manoeuvre_variance: 0, hypotheses: 3}"
    radar = [f"radar.sigma_velocity_mps={plan.axes.bound[1, 0, 0]}", "prior.sigma_acceleration_mps2=10"]
    (case,) = load("ambiguous_rls4", [f"filters=[{memory}, {few}]", "scans=7", *radar]).cases
    folded_study = registry.study("ambiguous_doppler")
    expected = folded_study.prepare(case)
    folded_sums = expected.layout.unpack(sum(folded_study.simulate(expected, first, 512) for first in range(0, N, 512)))
    for folded_filter, pulses_filter in ((0, 2), (1, 3)):
        right = folded_sums["folds"][folded_filter, :, 0] / N
        error = np.sqrt(np.maximum(right * (1 - right), 5 / N) * 2 / N)
        assert (abs(sums.folds[pulses_filter, :, RIGHT] / N - right) < 4.5 * error).all()
        assert (
            abs(sums.folds[pulses_filter, :, LISTED] / N - folded_sums["folds"][folded_filter, :, 1] / N) < 4.5 * error
        ).all()
    sigma = np.sqrt(sums.error[2, -1, :, 1] / N), np.sqrt(folded_sums["error"][0, -1, :, 1] / N)
    np.testing.assert_allclose(*sigma, rtol=math.sqrt(2) * sigma_error(N))  # of two samples


def test_rate_of_wrong_nearest_folds_is_exact(wide):
    """At the first scan its innovation is Gaussian, of the designation's variance and the bound's."""
    plan, sums, _ = wide
    S = 300.0**2 + plan.axes.bound[1, 0, 0] ** 2
    right = math.erf(7.5 / math.sqrt(2 * S))
    wrong = sums.locks[1, 0, WRONG_FOLD] / N
    assert abs(wrong - (1 - right)) < 4.5 * math.sqrt(right * (1 - right) / N)
    assert sums.locks[2, -1, WRONG_FOLD] / N < 0.01 < sums.locks[1, -1, WRONG_FOLD] / N
