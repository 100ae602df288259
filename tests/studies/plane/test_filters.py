"""The filters in the plane without false plots, against textbook twins, realisation by realisation."""

import numpy as np
import pytest

import radarsim
from radarsim.studies import step_programs
from radarsim.studies.plane import moments
from radarsim.studies.registry import study
from tests.studies.plane import naive
from tests.studies.plane.cases import RADAR, STRAIGHT, case_of, member, plots_of, run_of

MODELS = ("velocity", "acceleration", "turn")
FOLDS = {"unfolded": {}, "folded": {"repetition_rate_hz": 4000.0}, "fold not known": {"repetition_rate_hz": 800.0}}
SIZE = np.array([60e3, 1.0, 250.0, 1.0])  # of range, bearing, speed, course
EQUAL = 1e-9  # of the size
MOVED = 1 + 2.0**-50  # a plot, to see how a realisation multiplies rounding
# The kernels of configs/plane.yaml.
SHIPPED = [
    member("extended", doppler=False),
    member("extended"),
    member("unscented"),
    member("converted", doppler=False),
    member("converted"),
    member("imm", "turn"),
]


def every(model):
    """The filters of a model."""
    updates = ({"doppler": False}, {"doppler_update": "linear"}, {"doppler_update": "sequential"})
    return [
        *(member(kind, model, doppler) for kind in ("extended", "unscented", "imm") for doppler in (False, True)),
        *(member("converted", model, unbiased=unbiased, **update) for unbiased in (False, True) for update in updates),
    ]


def difference(estimate, true):
    e = estimate - true
    e[..., 1::2] = naive.wrapped(e[..., 1::2])
    return e


def sigmas(P):
    return np.sqrt(np.einsum("kii->ki", P))


def assert_close(found, wanted, moved, size):
    """Differences within EQUAL and ten times what moved plots make of the wanted ones; no not-a-number."""
    allowed = EQUAL * size + 10 * np.abs(difference(moved, wanted))
    off = np.abs(difference(found, wanted))
    assert not (off > allowed).any(), f"off by {np.nanmax(off / allowed):.3g} times what is permitted"


def compare_tracks(model, folds, n):
    """In plain Python, from whose text the kernels are made; some plots are missed."""
    case, names = case_of(every(model), **FOLDS[folds]), ("range_m", "bearing_rad", "velocity_mps")
    t, z, _, _ = plots_of(case_of(every(model)[:1], **FOLDS[folds]), n)
    for plots in z:
        track = study("plane").tracker(case).feed({"t_s": t} | dict(zip(names, plots.T, strict=True)))
        for f, keys in enumerate(case.spec.filters):
            estimate, P = naive.follow(case.spec.radar, keys, t, plots)
            moved, moved_P = naive.follow(case.spec.radar, keys, t, plots * MOVED)
            assert_close(track.estimate[f], estimate, moved, SIZE)
            assert_close(track.sigma[f], sigmas(P), sigmas(moved_P), sigmas(P))
    return z


def test_every_filter_is_its_twin_over_plots_of_a_realisation():
    compare_tracks("turn", "folded", 1)


@pytest.mark.slow
@pytest.mark.parametrize("folds", FOLDS)
@pytest.mark.parametrize("model", MODELS)
def test_every_filter_is_its_twin_over_plots_of_ten_realisations(model, folds):
    z = compare_tracks(model, folds, 10)
    assert np.isnan(z[:, 1:, 0]).any()


def compare_runs(case, n):
    """Errors, predicted variances and NEES of single realisations of a run."""
    t, z, truth, _ = plots_of(case, n)
    for i in range(n):
        sums = run_of(case, i)
        for f, keys in enumerate(case.spec.filters):
            (estimate, P), (moved, moved_P) = (
                naive.follow(case.spec.radar, keys, t, plots) for plots in (z[i], z[i] * MOVED)
            )
            e, other = difference(estimate, truth[i]), difference(moved, truth[i])
            assert_close(sums["error"][f, ..., 0], e, other, SIZE)
            variance, moved_variance = (np.einsum("kii->ki", matrix) for matrix in (P, moved_P))
            assert_close(sums["believed"][f], variance, moved_variance, variance)
            assert_nees_close(sums["nees"][f, :, 0], (e, P), (other, moved_P))


def assert_nees_close(found, wanted, moved):
    """Of errors and covariances; an error is known to EQUAL of the size of its component, not of itself."""
    value, shifted = nees(*wanted), nees(*moved)
    slope = 2 * np.sqrt(value * np.einsum("c,kcc,c->k", SIZE, inverses(wanted[1]), SIZE))
    allowed = EQUAL * (slope + value) + 10 * np.abs(shifted - value)
    assert not (np.abs(found - value) > allowed).any()


def inverses(P):
    return np.array([np.linalg.inv(one) if np.isfinite(one).all() else one for one in P])


def nees(e, P):
    return np.einsum("ki,kij,kj->k", e, inverses(P), e)


def test_kernels_are_the_twins():
    compare_runs(case_of(SHIPPED, detection_probability=1.0), 10)


@pytest.mark.slow
@pytest.mark.parametrize("folds", FOLDS)
@pytest.mark.parametrize("model", MODELS)
def test_kernels_of_every_filter_are_the_twins(model, folds):
    compare_runs(case_of(every(model), **FOLDS[folds]), 10)


def test_a_filter_is_traced_anew_only_where_its_branches_differ(monkeypatch):
    """A search of tune asks for many values of a key."""
    traced = []
    trace = step_programs.trace_filter
    monkeypatch.setattr(step_programs, "trace_filter", lambda *given: traced.append(1) or trace(*given))
    monkeypatch.setattr(step_programs, "TRACED", {})
    plane = study("plane")
    first = plane.prepare(case_of([member("extended", sigma_start_velocity_mps=100.0)]))
    second = plane.prepare(case_of([member("extended", sigma_start_velocity_mps=200.0)]))
    assert len(traced) == 1
    assert second.filters[0].kernel is first.filters[0].kernel
    assert not np.array_equal(second.filters[0].numbers, first.filters[0].numbers)
    plane.prepare(case_of([member("extended", doppler=False)]))
    plane.prepare(case_of([member("extended") | {"sigma_acceleration_mps2": 0.0}]))
    assert len(traced) == 3


@pytest.mark.parametrize("rate_hz", [100.0, 800.0, 1500.0, 40e3])
def test_a_filter_whose_velocities_never_count_is_as_without_doppler(rate_hz):
    filters = [
        member(kind, model, doppler=doppler)
        for kind, model in (("extended", "velocity"), ("converted", "velocity"), ("imm", "turn"))
        for doppler in (False, True)
    ]
    spec, plane = case_of(filters, STRAIGHT, 12, repetition_rate_hz=rate_hz).spec, study("plane")
    last = [moments(*list(plane.typical_states(spec, keys))[-1]) for keys in spec.filters]
    for i in range(0, len(filters), 2):
        (_, without), (_, P) = last[i : i + 2]
        assert plane.tells_folds(spec, spec.filters[i + 1]) != np.allclose(P, without, rtol=1e-2)


def test_the_answer_names_filters_whose_velocities_never_count():
    keys = {"study": "plane", "target": STRAIGHT, "scans": 6, "realisations": 200, "filters": SHIPPED[:2]}
    answers = [
        [text for text in radarsim.run(keys | {"radar": RADAR | rate}).answer if "No velocity counts" in text]
        for rate in ({}, {"repetition_rate_hz": 800.0})
    ]
    assert not answers[0]
    assert len(answers[1]) == 1
    assert "“extended velocity Vr”" in answers[1][0]
