"""Rare wrong folds: half-spaces against textbook covariances, exact laws and products; rates against brute force."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ndtr, ndtri
from scipy.stats import chi2

import radarsim
from radarsim.app.configs import load
from radarsim.errors import ConfigError
from radarsim.kernels.random import stream
from radarsim.report import rare as report
from radarsim.studies.ambiguous_doppler import filters, study
from radarsim.studies.ambiguous_doppler.kernels import records
from radarsim.studies.ambiguous_doppler.kernels import sums as kernels
from tests.studies.ambiguous_doppler.conftest import FIXED, MEMORY, NEAREST, ORACLE, added, config_of, made
from tests.tolerances import Z, assert_rounded, column_sizes, mean_error, rounding, scaled_condition, share_error

ALL = MEMORY | {"hypotheses": 3000, "prune_below": 0}
KNOWN = {"sigma_velocity_mps": 3.0, "sigma_acceleration_mps2": 0.1}
NARROW = {"sigma_velocity_mps": 30.0, "sigma_acceleration_mps2": 3.0}


def case_of(one, scans, radar="RLS 5", others=(), **keys):
    """A case whose sought filter is `one`, before others."""
    given = {"rare": {"filter": one["name"]}} | keys
    return made(radar, [one, *others], scans, **given)


def reseeded(plan, seed):
    """The plan under other noise."""
    keys = np.stack([stream(seed, str(i)) for i in range(4)])
    mixture = plan.mixture and plan.mixture._replace(key=keys[3])
    return replace(plan, world=plan.world._replace(keys=keys[:3]), mixture=mixture)


def rate(plan, n, f=0):
    """The weighted share of wrong folds of filter f at the last scan, and its standard error."""
    weight, square, *_ = added(plan, n)["events"][f, -1, kernels.WRONG]
    return weight / n, math.sqrt(square / n - (weight / n) ** 2) / math.sqrt(n)


def brute(case, seed, n, f=0):
    """The share of n plain realisations with a wrong fold at the last scan, and its standard error."""
    plan = study.prepare(replace(case, spec=case.spec.model_copy(update={"rare": None})))
    wrong = n - added(reseeded(plan, seed), n)["folds"][f, -1, records.RIGHT_SUM]
    return wrong / n, math.sqrt(max(wrong, 1)) / n


def linear_of(case):
    one = case.spec.filters[0]
    return study.linear_innovations(study.prepare(case).world, case.spec, one)


def plots_covariance(case):
    """Covariance of (V_1, r_2 − r_1, V_2, …) as a filter believes it: what is drawn, process noise, errors of plots."""
    spec, scans = case.spec, case.spec.scans
    (member,) = filters.members(spec.filters[0])
    F, Q = filters.model(member.order, member.manoeuvre_variance, spec.radar.scan_period_s)
    sizes, vectors = np.linalg.eigh(Q)  # of rank one
    root = vectors * np.sqrt(np.maximum(sizes, 0.0))
    wide = 2 + 3 * scans + 2 * scans
    x = np.zeros((3, wide))  # columns: V, a, process noise, errors of ranges and velocities
    x[1, 0], x[2, 1] = np.sqrt(filters.prior_variances(member.order, spec.prior))
    rows, first = [], None
    for k in range(scans):
        if k:
            x = F @ x
            x[:, 2 + 3 * k : 5 + 3 * k] += root
        r, v = x[0].copy(), x[1].copy()
        r[2 + 3 * scans + k] += spec.radar.sigma_range_m
        v[2 + 4 * scans + k] += spec.radar.sigma_velocity_mps
        if first is None:
            first = r
        else:
            rows.append(r - first)
        rows.append(v)
    return np.array(rows) @ np.array(rows).T


@pytest.mark.parametrize("variance", [0.0, 1e-1])
def test_distances_between_sequences_are_the_textbooks(variance):
    """|A m|² is the form of the plots' inverse covariance in the velocities' offsets, and |ν|² that in the plots."""
    case = case_of(ALL, 5, prior=NARROW, variance=variance)
    of, D = linear_of(case), case.spec.radar.spans_mps[0]
    covariance = plots_covariance(case)
    inverse, velocities = np.linalg.inv(covariance), [0, 2, 4, 6, 8]
    precision = {"condition": scaled_condition(covariance), "operations": 50}  # ten operations of each of five scans
    folds, form = of.until(5)[2], D**2 * inverse[np.ix_(velocities, velocities)]
    size = np.sqrt(np.outer(np.diag(form), np.diag(form)))
    assert_rounded(folds.T @ folds, form, size=size, **precision)
    world, z = study.prepare(case).world, np.random.default_rng(3).standard_normal(12)
    v = world.truth[:, 1] + z[0] * world.spread[0] + z[1] * world.spread[1] * world.t
    r = world.truth[:, 0] + z[0] * world.spread[0] * world.t + z[1] * world.spread[1] * world.t**2 / 2
    r, v = r + world.sigma[0] * z[2:7], v + world.sigma[1] * z[7:]
    plots = np.array([v[0], *itertools.chain.from_iterable(zip(r[1:] - r[0], v[1:], strict=True))])
    nu = of.until(5)[0] + of.until(5)[1] @ z
    assert_rounded(nu @ nu, plots @ inverse @ plots, **precision)


def test_where_truth_and_filter_agree_distances_are_half_of_those_between_sequences():
    case = case_of(ALL, 6, prior=NARROW, variance=0.0)
    of = linear_of(case)
    _, L, A = of.until(6)
    precision = {"condition": scaled_condition(plots_covariance(case)), "operations": 60}  # ten operations a scan
    assert_rounded(L[1:] @ L[1:].T, np.eye(11), size=1, **precision)  # the first range tells nothing
    m = np.array([[1.0, 0, 0, 0, 0, 0], [0, 1, -1, 0, 2, 0]])
    found = study.sequence_half_spaces(of.until(6), m, 0.0)
    assert_rounded(found.distance, np.linalg.norm(m @ A.T, axis=1) / 2, **precision)
    assert_rounded(np.linalg.norm(found.units, axis=1), np.ones(2), operations=20)


def test_short_vectors_are_all_that_there_are():
    """Against all whole numbers in a box, of a skew basis."""
    A = np.array([[1.0, 7.9, 3.1], [0.0, 1.0, -4.2], [0.0, 0.0, 1.5], [0.3, -0.2, 0.1]])
    T = filters.reduce_basis(A, np.eye(3))
    assert np.array_equal(T, np.rint(T))
    assert np.rint(abs(np.linalg.det(T))) == 1  # that of whole numbers is whole
    assert np.linalg.norm(A @ T, axis=0).max() < np.linalg.norm(A, axis=0).max()
    found = {tuple(m) for m in filters.lattice_vectors(A, T, 5.0, 1000)}
    box = np.array(list(itertools.product(range(-60, 61), range(-12, 13), range(-4, 5))), dtype=float)
    expected = {tuple(m) for m in box[(np.linalg.norm(box @ A.T, axis=1) <= 5.0) & box.any(axis=1)]}
    assert found == expected
    assert len(found) == 38
    with pytest.raises(filters.TooManyVectors):
        filters.lattice_vectors(A, T, 5.0, 10)


def each(plan, n):
    """Normals (n, 2 + 2K), whether a fold is wrong in the end (n,), of realisations one by one."""
    normals, wrong = np.empty((n, plan.mixture.units.shape[1])), np.empty(n, dtype=bool)
    room, chosen, weights = np.zeros(8 * normals.shape[1]), np.zeros(8, np.int64), np.zeros(8)
    for i in range(n):
        if i % 8 == 0:
            kernels.fill_shifted(plan.world, plan.mixture, i, room, chosen, weights)
        normals[i] = room.reshape(-1, 8)[:, i % 8]
        wrong[i] = plan.layout.unpack(study.simulate(plan, i, 1))["events"][0, -1, kernels.WRONG, 2]
    return normals, wrong


@pytest.mark.parametrize(
    ("one", "keys"),
    [
        (NEAREST, {"prior": KNOWN, "repetition_rate_hz": 700.0}),
        (ALL, {"prior": NARROW, "repetition_rate_hz": 1000.0}),
        (ALL, {"prior": NARROW, "target": FIXED | {"coefficients": [100e3, -45.0, 4.0]}}),
        (ALL, {"prior": NARROW, "repetition_rate_hz": [1300.0, 1700.0], "variance": 0.1}),
    ],
)
def test_folds_are_wrong_just_where_the_half_spaces_are(one, keys):
    """Realisation by realisation, half of them shifted to where it is undecided."""
    case = case_of(one, 5, **keys)
    plan, of = study.prepare(case), linear_of(case)
    if one["hypotheses"] == 1:
        found = study.nearest_fold_half_spaces(of)
    else:
        found = study.half_spaces_within(of, study.reduced_bases(of), filters.UNLIMITED_DEPTH, 8.5)
    normals, wrong = each(plan, 120)
    assert 30 < wrong.sum() < 90
    assert np.array_equal((normals @ found.units.T > found.distance).any(axis=1), wrong)


def test_what_is_dropped_early_is_dropped_in_a_half_space():
    """With a short memory more folds are wrong, and all where some half-space says so."""
    one, keys = ALL | {"prune_below": 0.05}, {"prior": NARROW, "repetition_rate_hz": 1000.0}
    case = case_of(one, 6, **keys)
    of = linear_of(case)
    found = study.half_spaces_within(of, study.reduced_bases(of), -math.log(0.05), 8.0)
    at_last = study.half_spaces_within(of, study.reduced_bases(of), filters.UNLIMITED_DEPTH, 8.0)
    normals, wrong = each(study.prepare(case), 400)
    within = (normals @ found.units.T > found.distance).any(axis=1)
    assert not (wrong & ~within).any()
    assert (within & ~wrong).sum() < 0.05 * wrong.sum()
    early = wrong & ~(normals @ at_last.units.T > at_last.distance).any(axis=1)
    assert early.sum() > 20


def test_weights_bring_back_the_normal_law():
    """The mean weight is one, and P(uᵀz > s) is Φ(−s) across every half-space."""
    plan = study.prepare(case_of(ALL, 8))
    law, n = plan.mixture, 20_000
    normals, chosen, weights = np.zeros(8 * law.units.shape[1]), np.zeros((n // 8, 8), np.int64), np.zeros((n // 8, 8))
    along = np.empty((n // 8, 8, len(law.shift)))
    for i in range(n // 8):
        kernels.fill_shifted(plan.world, law, 8 * i, normals, chosen[i], weights[i])
        along[i] = normals.reshape(-1, 8).T @ law.units.T
    weights, along, chosen = weights.ravel(), along.reshape(n, -1), chosen.ravel()
    assert abs(weights.mean() - 1) < mean_error(n, weights.std())
    assert weights.max() <= 1 / law.cumulative[0]
    assert np.mean(chosen == 0) == pytest.approx(0.1, abs=share_error(0.1, n))
    looked = 0
    for m, shift in enumerate(law.shift):
        if np.count_nonzero(chosen == m + 1) < 500:
            continue
        x = weights * (along[:, m] > shift)
        assert abs(x.mean() - ndtr(-shift)) < mean_error(n, x.std())
        assert x.std() / math.sqrt(n) < 0.1 * ndtr(-shift)
        looked += 1
    assert looked >= 6


@pytest.mark.parametrize(("hertz", "about"), [(1000.0, 1e-2), (1500.0, 1e-3), (2000.0, 1e-5), (2400.0, 1e-8)])
def test_the_nearest_fold_is_wrong_as_often_as_the_exact_product_says(hertz, about):
    plan = study.prepare(case_of(NEAREST, 12, prior=KNOWN, variance=0.0, repetition_rate_hz=hertz))
    exactly = 1 - plan.axes.exact_right[0, -1]
    assert about / 10 < exactly < 10 * about
    mean, error = rate(plan, 10_000)
    assert error < 0.05 * exactly
    assert abs(mean - exactly) < Z * error


@pytest.mark.parametrize("hertz", [2000.0, 4000.0, 6000.0])
def test_two_scans_are_wrong_as_often_as_the_integral_over_a_hexagon_says(hertz):
    """Of two folds all that decides lies in a plane, where the right ones hold a cell of six sides about the origin."""
    case = case_of(ALL, 2, prior=NARROW, variance=0.0, repetition_rate_hz=hertz)
    of = linear_of(case)
    found = study.half_spaces_within(of, study.reduced_bases(of), filters.UNLIMITED_DEPTH, 9.0)
    basis = np.linalg.svd(found.units, full_matrices=False)[2][:2]
    plane = found.units @ basis.T
    assert_rounded(np.linalg.norm(plane, axis=1), np.ones(len(plane)), operations=20)
    angle = (np.arange(20_000) + 0.5) * (2 * math.pi / 20_000)
    toward = np.cos(angle) * plane[:, :1] + np.sin(angle) * plane[:, 1:]
    reach = (found.distance[:, None] / toward.clip(1e-300)).min(axis=0)  # away from a half-space there is no end
    exactly = float(np.mean(np.exp(-(reach**2) / 2)))
    mean, error = rate(study.prepare(case), 20_000)
    assert error < 0.04 * exactly
    assert abs(mean - exactly) < Z * error


def test_a_hundred_thousandth_lies_in_its_bracket():
    """The nearest two half-spaces never meet, and all of them together bound the rate from above."""
    case = case_of(MEMORY | {"hypotheses": 1000, "prune_below": 1e-9}, 10, repetition_rate_hz=970.0)
    plan, of = study.prepare(case), linear_of(case)
    found = study.find_half_spaces(of, case.spec.filters[0])
    chance = study.probabilities(found)
    assert found.units[0] == pytest.approx(-found.units[1], abs=rounding(operations=20))
    mean, error = rate(plan, 20_000)
    assert 3e-6 < mean < 3e-5
    assert error < 0.05 * mean
    assert chance[:2].sum() - Z * error < mean < chance.sum() + Z * error


CASES = {
    "memory": (MEMORY | {"hypotheses": 1000}, {"repetition_rate_hz": 760.0}),
    "memory, rarer": (MEMORY | {"hypotheses": 1000}, {"repetition_rate_hz": 860.0}),
    "dropped early": (MEMORY | {"prune_below": 1e-3}, {"repetition_rate_hz": 1100.0, "prior": NARROW}),
    "not of its model": (
        MEMORY | {"hypotheses": 1000},
        {"target": FIXED, "variance": 1e-2, "repetition_rate_hz": 1000.0},
    ),
}


@pytest.mark.slow_cases("memory")
@pytest.mark.parametrize("name", ["memory", "dropped early", "not of its model"])
def test_wrong_folds_are_those_of_plain_realisations(name):
    one, keys = CASES[name]
    case = case_of(one, 10, **keys)
    mean, error = rate(study.prepare(case), 5_000)
    plain, plain_error = brute(case, 11, 50_000)
    assert error < 0.1 * mean
    assert abs(mean - plain) < Z * math.hypot(error, plain_error)
    assert 1e-4 < mean < 1e-2


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_wrong_folds_are_those_of_plain_realisations_on_twenty_seeds(name):
    """At 10⁻³ and 10⁻⁴: in one try of a hundred any difference is beyond the bound; means are not shifted."""
    one, keys = CASES[name]
    case = case_of(one, 10, **keys)
    plan, z = study.prepare(case), []
    for seed in range(20):
        mean, error = rate(reseeded(plan, seed), 20_000)
        plain, plain_error = brute(case, 100 + seed, 200_000)
        z.append((mean - plain) / math.hypot(error, plain_error))
    assert np.abs(z).max() < ndtri(1 - 0.005 / (20 * len(CASES)))
    assert abs(np.mean(z)) < ndtri(1 - 0.005 / len(CASES)) / math.sqrt(20)


@pytest.mark.slow
def test_a_hundred_thousandth_is_known_to_a_fifth():
    """Twenty runs of 20 000 realisations scatter as their intervals say, by less than 20 %."""
    plan = study.prepare(case_of(MEMORY | {"hypotheses": 1000}, 15))
    found = np.array([rate(reseeded(plan, seed), 20_000) for seed in range(20)])
    assert 5e-6 < found[:, 0].mean() < 2e-5
    assert found[:, 0].std() < 0.2 * found[:, 0].mean()
    z = (found[:, 0] - found[:, 0].mean()) / found[:, 1]
    low, high = chi2.ppf([1e-4, 1 - 1e-4], 19) / 20
    assert low < np.mean(z**2) < high


def test_sums_are_those_of_the_weights_and_add_up():
    case = case_of(MEMORY, 6, others=[ORACLE])
    plan = study.prepare(case)
    sums = plan.layout.unpack(study.simulate(plan, 104, 60))
    parts = plan.layout.unpack(study.simulate(plan, 104, 37) + study.simulate(plan, 141, 23))
    for name, values in sums.items():
        assert_rounded(values, parts[name], size=column_sizes(values, 60), operations=60)
    room, chosen, weights = np.zeros(8 * 14), np.zeros((8, 8), np.int64), np.zeros((8, 8))
    for i in range(8):
        kernels.fill_shifted(plan.world, plan.mixture, 104 + 8 * i, room, chosen[i], weights[i])
    chosen, weights = chosen.ravel()[:60], weights.ravel()[:60]
    plain = chosen == 0
    assert_rounded(sums["drawn"], [plain.sum(), weights.sum(), weights @ weights], operations=60)
    wrong = np.array(
        [plan.layout.unpack(study.simulate(plan, 104 + i, 1))["events"][0, -1, kernels.WRONG, 2] for i in range(60)]
    )
    of_wrong = [weights @ wrong, weights**2 @ wrong, wrong.sum(), weights**4 @ wrong]
    assert_rounded(sums["events"][0, -1, kernels.WRONG], of_wrong, operations=60)
    assert not sums["events"][1].any()  # the oracle folds nothing
    assert sums["folds"][0, -1, records.RIGHT_SUM] == (plain & (wrong == 0)).sum()
    assert (sums["estimates"] == plain.sum()).all()
    alone = study.prepare(replace(case, spec=case.spec.model_copy(update={"rare": None})))
    first = 104 + int(np.flatnonzero(plain)[0])  # a plain realisation has the noise that it would have
    shared = plan.layout.unpack(study.simulate(plan, first, 1))
    expected = alone.layout.unpack(study.simulate(alone, first, 1))
    assert np.array_equal(shared["error"], expected["error"])


MISSING = made("RLS 5", [MEMORY], 8, detection_probability=0.9).spec.radar.model_dump(exclude_none=True)


def result_of(n, *others, **keys):
    return radarsim.run(config_of(MEMORY, *others, rare={"filter": "memory"}, realisations=n, **keys))


def test_tables_tell_the_rate_and_how_well_it_is_known():
    result = result_of(6000, NEAREST | {"manoeuvre_variance": 1e-3})
    table = result.tables["rare"]
    assert list(table.columns[6:13]) == ["n", "rate", "rate_lo", "rate_hi", "events", "n_eff", "variance_factor"]
    row, sums = table.iloc[0], result.cases[0].sums
    weight, square, number, _ = sums["events"][0, -1, kernels.WRONG]
    assert row["rate"] == weight / 6000
    assert row["events"] == number
    assert_rounded(row["n_eff"], weight**2 / square, operations=3)
    assert row["rate_lo"] < row["rate"] < row["rate_hi"]
    assert row["variance_factor"] > 5
    assert list(table["sought"]) == [True, False, False]
    assert list(table["event"]) == ["wrong fold", "wrong fold", "wrong fold that found no room"]
    folds = result.tables["folds"]
    last = folds[(folds["filter"] == "memory") & (folds["k"] == 8)].iloc[0]
    assert_rounded(last["right"], 1 - row["rate"])
    assert_rounded(last["right_hi"], 1 - row["rate_lo"])
    weight = sums["events"][0, -1, kernels.BEYOND, 0]
    assert last["beyond"] == weight / 6000
    assert result.curves["n"].max() <= row["plain"]
    assert "by importance sampling" in " ".join(result.answer)
    assert not any("rare event" in line for line in result.warnings)


def test_wrong_folds_of_full_lists_are_told():
    """With room for few hypotheses many wrong folds are of a right one that found no room, and no shift leads there."""
    short, long = (
        radarsim.run(
            "ambiguous_rare",
            realisations=1000,
            overrides=["sweep.radar.repetition_rate_hz=[700]", f"filters.1.hypotheses={most}"],
        )
        for most in (100, 1000)
    )
    for result, told in ((short, True), (long, False)):
        whole, _, full = result.tables["rare"].to_dict("records")
        assert full["event"] == "wrong fold that found no room"
        assert full["events"] <= whole["events"]
        squares = [row["rate"] ** 2 / max(row["n_eff"], 1) for row in (full, whole)]
        assert (squares[0] > 0.1 * squares[1]) == told
        assert (whole["note"] == report.ASTRAY) == told
        assert any("may be too narrow" in line for line in result.warnings) or not told


def test_calibration_and_curves_are_marked_by_their_own_realisations():
    """Effective events of the wrong folds say nothing of tables that are of the plain realisations."""
    result = result_of(24)
    for name in ("calibration", "curves"):
        table = result.tables[name]
        assert not table.get("note", table["case"]).str.contains("effective events").any()


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"rare": {"filter": "oracle"}}, "rare.filter: must be the name of a filter of one order that lists its folds"),
        ({"rare": {"filter": "memory", "shift": 3}}, "rare.shift: unknown key"),
        ({"rare": {"filter": "memory"}, "scans": 65}, "rare: needs at most 64 scans, got 65"),
        ({"rare": {}}, "rare.filter: "),
        ({"rare": {"filter": "memory"}, "radar": MISSING}, "rare: needs every plot"),
    ],
)
def test_wrong_values_are_told_by_their_key(keys, words):
    with pytest.raises(ConfigError) as error:
        load(config_of(MEMORY, *([] if "radar" in keys else [ORACLE]), **keys))
    assert any(words in line for line in error.value.lines), error.value.lines


def test_a_filter_that_is_never_wrong_is_refused():
    with pytest.raises(ConfigError, match="rare: memory has no wrong fold within 8 σ"):
        study.prepare(case_of(MEMORY, 6, prior=KNOWN, repetition_rate_hz=6000.0))


def test_a_filter_that_is_hardly_ever_right_is_refused():
    with pytest.raises(ConfigError, match="rare: memory has over 300000 sequences of folds near the right one"):
        study.prepare(case_of(MEMORY, 6, repetition_rate_hz=1.0, prior={"sigma_velocity_mps": 100.0}))
