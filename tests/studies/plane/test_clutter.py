"""The filters in the plane among false plots, against textbook twins, realisation by realisation."""

import numpy as np
import pytest

from radarsim.engine.results import CaseResult
from radarsim.errors import ConfigError
from radarsim.report import tables
from radarsim.studies.registry import study
from tests.studies.plane import naive
from tests.studies.plane.cases import STRAIGHT, case_of, member, plots_of, run_of
from tests.studies.plane.test_filters import MOVED, SIZE, assert_close, assert_nees_close, difference

CLUTTER = {
    "repetition_rate_hz": 40e3,
    "false_plots_per_km2": 0.06,
    "false_plots_from_s": 22.0,
    "sigma_bearing_rad": 3e-3,
}
FEW = [
    member("extended", association="pda"),
    member("converted", doppler=False),
    member("imm", "turn", association="nearest"),
]
MORE = [
    [member("extended", "turn", association=rule) for rule in ("known", "nearest", "pda")],
    [member("unscented", "acceleration", False, association=rule) for rule in ("nearest", "pda")],
    [member("imm", model, association=rule) for model, rule in (("acceleration", "nearest"), ("turn", "pda"))],
    [member("converted", association=rule, doppler_update="linear") for rule in ("known", "nearest")],
]


def compare(filters, n, first=0):
    """Errors of kept tracks, predicted variances, NEES, and what is counted, of single realisations. Returns how many
    tracks are lost, and how many plots are wrong."""
    case, lost, wrong = case_of(filters, STRAIGHT, 10, **CLUTTER), 0, 0
    t, z, truth, false = plots_of(case, n, first)
    for i in range(n):
        sums = run_of(case, first + i)
        for f, keys in enumerate(case.spec.filters):
            (estimate, P, events), (moved, moved_P, _) = (
                naive.follow_among_false(case.spec.radar, keys, t, z[i] * factor, false[i] * factor, truth[i, :, :2])
                for factor in (1.0, MOVED)
            )
            kept = events[:, 0]
            np.testing.assert_array_equal(sums["counts"][f], events & kept[:, None])
            np.testing.assert_array_equal(sums["estimates"][f], np.repeat(kept[:, None], 4, axis=1))
            e, other, P, moved_P = (
                values[kept] for values in (difference(estimate, truth[i]), difference(moved, truth[i]), P, moved_P)
            )
            assert_close(sums["error"][f, kept, :, 0], e, other, SIZE)
            variance, moved_variance = (np.einsum("kii->ki", matrix) for matrix in (P, moved_P))
            assert_close(sums["believed"][f, kept], variance, moved_variance, variance)
            assert_nees_close(sums["nees"][f, kept, 0], (e, P), (other, moved_P))
            assert not any(sums[name][f, ~kept].any() for name in ("error", "believed", "nees"))
            lost, wrong = lost + (not kept[-1]), wrong + events[:, 2].sum()
    return lost, wrong


def test_tracks_among_false_plots_are_the_twins():
    lost, wrong = compare(FEW, 10, first=32)
    assert lost >= len(FEW)
    assert wrong > 0


@pytest.mark.slow
@pytest.mark.parametrize("filters", MORE, ids=lambda filters: filters[0]["name"])
def test_tracks_of_more_filters_are_the_twins(filters):
    compare(filters, 20)


def test_gains_are_of_the_tracks_that_both_filters_keep():
    dense = CLUTTER | {"false_plots_per_km2": 0.3}
    case, n = (
        case_of([member("converted", doppler=False), member("extended", association="pda")], STRAIGHT, 10, **dense),
        40,
    )
    plan = study("plane").prepare(case)
    single = [run_of(case, i) for i in range(n)]
    e, kept = (np.array([sums[name] for sums in single]) for name in ("error", "estimates"))
    both = kept * kept[:, :1]
    assert (kept[:, 0] != kept[:, 1]).any(axis=0)[-1].all()
    base_square, square = ((both[:, 1, -1] * e[:, f, -1, :, 0] ** 2).sum(0) for f in (0, 1))
    sums = plan.layout.unpack(study("plane").simulate(plan, 0, n))
    gains = tables.gains([CaseResult(case.name, case.study, case.spec, (), n, sums, plan.axes)])
    last = gains[gains["k"] == 10]
    expected = 100 * (1 - np.sqrt(square / base_square))
    np.testing.assert_allclose(last["gain_percent"], expected, rtol=1e-9)


def test_recorded_plots_do_not_say_which_is_the_targets():
    with pytest.raises(ConfigError, match=r"filters\.0\.association: known: .*: give nearest or pda"):
        study("plane").tracker(case_of([member("extended", association="known")], STRAIGHT, 10, **CLUTTER))


@pytest.mark.parametrize("noise", [1e3, 1e17])
def test_gates_with_too_many_false_plots_are_refused(noise):
    """Whatever a search tries."""
    case = case_of([member("extended") | {"sigma_acceleration_mps2": noise}], STRAIGHT, 10, **CLUTTER)
    with pytest.raises(ConfigError, match="false plots in and about the widest gate"):
        study("plane").prepare(case)
