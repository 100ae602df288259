"""Long gaps in recorded plots: σ that is right to its digits, or none."""

import re
from fractions import Fraction

import numpy as np
import pytest

import radarsim
from radarsim.api.configs import load
from radarsim.errors import ConfigError
from radarsim.recordings import csv_output, rounding_guard, rows_by_track, simulate_plots, study_part
from radarsim.recordings.rounding_guard import RoundingGuard, differing_rows
from tests.recordings import plot_files
from tests.tolerances import rounding

SCANS, PERIOD = 14, 10
FIRST_REFUSED_GAP = 1e7  # s, of those tried here, where two scans follow it
RANGE, VELOCITY, JERK = Fraction(250) ** 2, Fraction(15) ** 2, Fraction(1, 1000)  # variances of rls2


def product(a, b):
    return [[sum(x * y for x, y in zip(row, column, strict=True)) for column in zip(*b, strict=True)] for row in a]


def inverse(a):
    rows = [list(row) + [Fraction(i == j) for j in range(3)] for i, row in enumerate(a)]
    for i in range(3):
        rows[i] = [x / rows[i][i] for x in rows[i]]
        rows = [r if j == i else [x - r[i] * y for x, y in zip(r, rows[i], strict=True)] for j, r in enumerate(rows)]
    return [row[3:] for row in rows]


def noise_of_scans(n: int) -> list[list[Fraction]]:
    """The covariance that n scans add for a unit of jerk, each by a jerk of its own: sums over j of F^j g gᵀ (F^j)ᵀ."""
    t, n = Fraction(PERIOD), Fraction(n)
    powers = [n, n * (n - 1) / 2, n * (n - 1) * (2 * n - 1) / 6, (n * (n - 1) / 2) ** 2]
    powers.append(n * (n - 1) * (2 * n - 1) * (3 * n * n - 3 * n - 1) / 30)  # sums of j⁰ … j⁴, j < n
    effects = [t**3 / 6, t**3 / 2, t**3 / 2], [t**2 / 2, t**2], [t]  # F^j g, polynomials in j
    return [
        [sum(x * y * powers[p + q] for p, x in enumerate(a) for q, y in enumerate(b)) for b in effects] for a in effects
    ]


def exact(observes: int, start: int, steps: list[int], unseen=()) -> np.ndarray:
    """Believed σ (len(steps), 3) of the paper's filter at scans 10 s apart and then after these whole periods, exactly.

    At the intervals `unseen` there is no plot.
    """
    variances, H = (RANGE, VELOCITY)[:observes], [[1, 0, 0], [0, 1, 0]][:observes]
    information = [[Fraction(0)] * 3 for _ in range(3)]
    for k in range(start):
        t = Fraction(10 * (k - start + 1))
        F = [[1, t, t * t / 2], [0, 1, t], [0, 0, 1]]
        for h, variance in zip(product(H, F), variances, strict=True):
            information = [[information[i][j] + h[i] * h[j] / variance for j in range(3)] for i in range(3)]
    P, told = inverse(information), []
    for k, step in enumerate([10] * (SCANS - start) + steps, start - SCANS):
        t = Fraction(step)
        F = [[1, t, t * t / 2], [0, 1, t], [0, 0, 1]]
        P, Q = product(product(F, P), list(zip(*F, strict=True))), noise_of_scans(step // PERIOD)
        P = [[P[i][j] + JERK * Q[i][j] for j in range(3)] for i in range(3)]
        for m, variance in enumerate(() if k in unseen else variances):
            S = P[m][m] + variance
            P = [[P[i][j] - P[i][m] * P[m][j] / S for j in range(3)] for i in range(3)]
        told.append([float(P[i][i]) ** 0.5 for i in range(3)])
    return np.array(told)[-len(steps) :]


def file_with(tmp_path, steps):
    t = np.concatenate([10.0 * np.arange(SCANS), 10.0 * (SCANS - 1) + np.cumsum(steps)])
    columns = {"t_s": t, "range_m": 1e5 + 0 * t, "velocity_mps": 0 * t}
    csv_output.write_columns(columns, tmp_path / "plots.csv")
    return tmp_path / "plots.csv"


@pytest.mark.parametrize("gap", [10, 100, 1000, 5000, 10_000])
def test_sigma_after_a_gap_is_that_of_exact_arithmetic(tmp_path, gap):
    one = load("rls2")
    _, track = plot_files.track(one, file_with(tmp_path, [gap, 10, 10]))
    for f, options in enumerate(one.cases[0].spec.filters):
        expected = exact(len(options.observes), options.initial_scans, [gap, 10, 10])
        np.testing.assert_allclose(
            track.sigma[f, -3:], expected, rtol=rounding_guard.MAX_SIGMA_CHANGE
        )  # else it is refused


@pytest.mark.parametrize("after", [0, 2])
@pytest.mark.parametrize("gap", [1e6, 1e7, 1e8, 1e9, 1e10, 1e12])
def test_after_a_huge_gap_sigma_is_right_or_the_track_ends_with_its_place(tmp_path, gap, after):
    one, steps, refusal = load("rls2"), [int(gap)] + [10] * after, ""
    try:
        _, track = plot_files.track(one, file_with(tmp_path, steps))
    except ConfigError as error:
        refusal = str(error)
    assert bool(refusal) == (after > 0 and gap >= FIRST_REFUSED_GAP)
    if refusal:
        assert re.search(rf"plots\.csv:{SCANS + 2}: t_s: after a gap of .* s .*split the file here", refusal)
        return
    for f, options in enumerate(one.cases[0].spec.filters):
        expected = exact(len(options.observes), options.initial_scans, steps)
        np.testing.assert_allclose(track.sigma[f, -len(steps) :], expected, rtol=rounding_guard.MAX_SIGMA_CHANGE)


def test_fit_refuses_a_gap_that_leaves_no_digit(tmp_path):
    rng, t = np.random.default_rng(1), np.concatenate([10.0 * np.arange(30), 1e10 + 10.0 * np.arange(30)])
    rows = [f"{time},{90_000 + rng.normal(0, 60):.2f},{rng.normal(0, 2):.3f}" for time in t]
    path = tmp_path / "plots.csv"
    path.write_text("\n".join(["t_s,range_m,velocity_mps", *rows]))
    with pytest.raises(ConfigError, match=r"after a gap of 1e\+10 s \(1\.16e\+05 days\) the target may be so far away"):
        radarsim.fit("rls2", path)


def test_the_gap_of_one_number_among_rows_of_the_other(tmp_path):
    """A file without long intervals, whose range fails for a long time: the filter of ranges counts its own gap."""
    columns = plot_files.read(file_with(tmp_path, [1000] * 100 + [10]), (("t_s", "range_m", "velocity_mps"),))
    columns["range_m"][SCANS:-1] = np.nan
    (case,) = load("rls2").cases
    study = study_part.recording_interface(case)
    twin, track = RoundingGuard(study.tracker(case), 10.0), study.tracker(case).feed(columns)
    assert not twin.has_lost_digits(columns, track)
    assert (twin.gap_s, twin.gap_row) == (100_010, SCANS + 100)
    expected = exact(1, 3, [1000] * 100 + [10], unseen=range(100))
    # Each interval adds what is positive: twelve operations an element, and a last update.
    np.testing.assert_allclose(track.sigma[0, -1], expected[-1], rtol=rounding(operations=12 * 102))


@pytest.mark.parametrize(
    ("config", "overrides", "gap", "lost"),
    [
        ("multimodel", ("scans=600",), 10.0, False),
        ("multimodel", ("scans=600",), 1e4, True),
        ("multimodel", ("scans=600",), 1e7, True),
        ("sonar_smoothing", (), 1e4, False),
        ("sonar_smoothing", (), 1e6, True),
        ("sonar_smoothing", (), 1e10, True),
    ],
)
def test_other_studies_print_nothing_that_is_lost(tmp_path, config, overrides, gap, lost):
    one = load(config, overrides)
    columns = simulate_plots.simulate_realisation(one)
    middle = len(columns["t_s"]) // 2
    columns["t_s"][middle:] += gap
    csv_output.write_columns({n: c for n, c in columns.items() if not n.startswith("true_")}, tmp_path / "plots.csv")
    if lost:
        with pytest.raises(ConfigError, match=r"plots\.csv:.* t_s: "):
            plot_files.track(one, tmp_path / "plots.csv")
    else:
        _, track = plot_files.track(one, tmp_path / "plots.csv")
        known = np.isfinite(track.estimate)
        assert (track.sigma[known] >= 0).all()
        assert (track.sigma[..., 0][known[..., 0]] > 0).all()


def test_pieces_of_a_file_lose_their_digits_where_the_whole_does(tmp_path):
    one = load("rls2")
    columns = plot_files.read(file_with(tmp_path, [1e7, 10, 10]), (("t_s", "range_m", "velocity_mps"),))
    (case,) = one.cases
    study = study_part.recording_interface(case)
    for size in (1, 5, 14, 100):
        tracker, twin, lost = study.tracker(case), RoundingGuard(study.tracker(case), 10.0), []
        for i in range(0, SCANS + 3, size):
            piece = {name: column[i : i + size] for name, column in columns.items()}
            lost.append(twin.has_lost_digits(piece, tracker.feed(piece)))
            if lost[-1]:
                break
        assert lost[-1], size
        assert (twin.gap_s, twin.gap_row) == (1e7, SCANS)


def test_tracks_differ_by_sigma_estimate_or_an_impossible_sigma(tmp_path):
    _, track = plot_files.track(load("rls2"), file_with(tmp_path, [10]))
    assert not differing_rows(track, track).any()
    for name, value in (("sigma", np.nan), ("sigma", 0.0), ("estimate", np.nan), ("estimate", 7.0)):
        other = rows_by_track.select_rows(track, np.arange(SCANS + 1))
        getattr(other, name)[1, 9, 0] = value
        assert differing_rows(other, track).nonzero()[0].tolist() == [9]
        assert differing_rows(track, other).nonzero()[0].tolist() == [9]
