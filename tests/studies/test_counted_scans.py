"""From which scan on errors count where no study has a rule of its own, against σ computed and drawn here."""

import numpy as np
import pytest

from radarsim.api.configs import load
from radarsim.studies import registry
from radarsim.studies.counted_scans import settled_scan


def test_an_exponential_start_ends_when_it_is_within_5_percent_of_what_follows():
    k = np.arange(60)
    spread = 1 + 3 * np.exp(-k / 5)
    first = settled_scan(spread) - 1
    window = spread[first : first + max(5, round(first / 2)) + 1]
    assert np.median(window) >= 0.95 * spread[first]
    assert 8 <= first <= 20
    assert 1 < spread[first] < 1.3


@pytest.mark.parametrize("scans", [40, 400, 4000])
def test_a_memory_that_grows_for_good_never_settles(scans):
    assert settled_scan(1 / np.sqrt(np.arange(1, scans + 1))) == scans + 1


def test_what_grows_counts_from_its_last_fall_on():
    k = np.arange(60)
    spread = np.where(k < 10, 20.0 - k, 10 * 1.1 ** (k - 9))
    first = settled_scan(spread)
    assert first <= 11
    assert spread[first - 1 :].max() == spread[-1]


def test_a_hump_after_the_first_plot_belongs_to_the_start():
    spread = np.array([30.4, 32.5, 42.9, 52.1, 55.8, 54.8, 46.2, 35.2, 24.5, 13.9, *[12.4] * 30])
    assert settled_scan(spread) >= 9


@pytest.mark.parametrize("stem", ["ambiguous_orders", "multimodel_1hz", "sonar_manoeuvre_turning"])
def test_a_target_that_manoeuvres_counts_from_its_first_acceleration_on(stem):
    case = load(stem).cases[-1]
    study = registry.study(case.study)
    start_s, scans = study.manoeuvre_start_s(case.spec), study.counted_scans(case)
    t_s = np.asarray(study.prepare(case).axes.t_s)
    assert scans.reason == "manoeuvre"
    assert scans.t_s == t_s[t_s >= start_s][0] > 0


def test_a_manoeuvre_of_size_zero_is_none():
    case = load("ambiguous_manoeuvre").cases[0]
    assert case.spec.target.acceleration_g == 0
    assert registry.study(case.study).counted_scans(case).reason == "settled"


def test_the_scan_does_not_depend_on_the_seed():
    scans = []
    for seed in (1, 2, 3):
        (case,) = load("ambiguous_rls4", ["scans=20", f"seed={seed}"]).cases
        scans.append(registry.study(case.study).counted_scans(case))
    assert scans[0] == scans[1] == scans[2]
