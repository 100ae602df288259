"""Rare wrong folds: half-spaces against textbook covariances, exact laws and products; rates against brute force."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ndtr, ndtri
from scipy.stats import chi2

import radarsim
from radarsim.api.configs import load
from radarsim.errors import ConfigError
from radarsim.kernels.random import stream
from radarsim.report import rare_events
from radarsim.studies.ambiguous_doppler import filter_design, importance_sampling, lattice, study
from radarsim.studies.ambiguous_doppler.kernels import layout, weighted_sums
from tests.studies.ambiguous_doppler.conftest import (
    FIXED,
    MEMORY,
    NEAREST,
    ORACLE,
    config_document,
    make_case,
    simulate_sums,
)
from tests.tolerances import Z, assert_rounded, column_sizes, mean_error, rounding, scaled_condition, share_error

ALL = MEMORY | {"hypotheses": 3000, "prune_below": 0}
KNOWN = {"sigma_velocity_mps": 3.0, "sigma_acceleration_mps2": 0.1}
NARROW = {"sigma_velocity_mps": 30.0, "sigma_acceleration_mps2": 3.0}


def rare_case(aimed_filter, scans, radar="RLS 5", other_filters=(), **keys):
    """A case that aims at a filter, which comes before others."""
    all_keys = {"rare": {"filter": aimed_filter["name"]}} | keys
    return make_case(radar, [aimed_filter, *other_filters], scans, **all_keys)


def with_seed(plan, seed):
    """The plan under other noise."""
    keys = np.stack([stream(seed, str(i)) for i in range(4)])
    mixture = plan.mixture and plan.mixture._replace(key=keys[3])
    return replace(plan, world=plan.world._replace(keys=keys[:3]), mixture=mixture)


def rate(plan, n, f=0):
    """The weighted share of wrong folds of filter f at the last scan, and its standard error."""
    weight, square, *_ = simulate_sums(plan, n)["events"][f, -1, weighted_sums.WRONG]
    return weight / n, math.sqrt(square / n - (weight / n) ** 2) / math.sqrt(n)


def plain_rate(case, seed, n, f=0):
    """The share of n plain realisations with a wrong fold at the last scan, and its standard error."""
    plan = study.prepare(replace(case, spec=case.spec.model_copy(update={"rare": None})))
    wrong = n - simulate_sums(with_seed(plan, seed), n)["folds"][f, -1, layout.RIGHT_SUM]
    return wrong / n, math.sqrt(max(wrong, 1)) / n


def innovations_of(case):
    options = case.spec.filters[0]
    return importance_sampling.linear_innovations(study.prepare(case).world, case.spec, options)


def plots_covariance(case):
    """Covariance of (V_1, r_2 − r_1, V_2, …) as a filter believes it: what is drawn, process noise, errors of plots."""
    spec, scans = case.spec, case.spec.scans
    (member,) = filter_design.members(spec.filters[0])
    F, Q = filter_design.model(member.order, member.manoeuvre_variance, spec.radar.scan_period_s)
    sizes, vectors = np.linalg.eigh(Q)  # of rank one
    root = vectors * np.sqrt(np.maximum(sizes, 0.0))
    wide = 2 + 3 * scans + 2 * scans
    x = np.zeros((3, wide))  # columns: V, a, process noise, errors of ranges and velocities
    x[1, 0], x[2, 1] = np.sqrt(filter_design.prior_variances(member.order, spec.prior))
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
    case = rare_case(ALL, 5, prior=NARROW, variance=variance)
    innovations, D = innovations_of(case), case.spec.radar.spans_mps[0]
    covariance = plots_covariance(case)
    inverse, velocities = np.linalg.inv(covariance), [0, 2, 4, 6, 8]
    precision = {"condition": scaled_condition(covariance), "operations": 50}  # ten operations of each of five scans
    folds, form = innovations.until(5)[2], D**2 * inverse[np.ix_(velocities, velocities)]
    size = np.sqrt(np.outer(np.diag(form), np.diag(form)))
    assert_rounded(folds.T @ folds, form, size=size, **precision)
    world, z = study.prepare(case).world, np.random.default_rng(3).standard_normal(12)
    v = world.truth[:, 1] + z[0] * world.spread[0] + z[1] * world.spread[1] * world.t
    r = world.truth[:, 0] + z[0] * world.spread[0] * world.t + z[1] * world.spread[1] * world.t**2 / 2
    r, v = r + world.sigma[0] * z[2:7], v + world.sigma[1] * z[7:]
    plots = np.array([v[0], *itertools.chain.from_iterable(zip(r[1:] - r[0], v[1:], strict=True))])
    nu = innovations.until(5)[0] + innovations.until(5)[1] @ z
    assert_rounded(nu @ nu, plots @ inverse @ plots, **precision)


def test_distances_are_half_of_those_between_sequences_if_truth_and_filter_agree():
    case = rare_case(ALL, 6, prior=NARROW, variance=0.0)
    innovations = innovations_of(case)
    _, L, A = innovations.until(6)
    precision = {"condition": scaled_condition(plots_covariance(case)), "operations": 60}  # ten operations a scan
    assert_rounded(L[1:] @ L[1:].T, np.eye(11), size=1, **precision)  # the first range tells nothing
    m = np.array([[1.0, 0, 0, 0, 0, 0], [0, 1, -1, 0, 2, 0]])
    spaces = importance_sampling.sequence_half_spaces(innovations.until(6), m, 0.0)
    assert_rounded(spaces.distance, np.linalg.norm(m @ A.T, axis=1) / 2, **precision)
    assert_rounded(np.linalg.norm(spaces.units, axis=1), np.ones(2), operations=20)


def test_lattice_vectors_are_complete():
    """Against all whole numbers in a box, of a skew basis."""
    A = np.array([[1.0, 7.9, 3.1], [0.0, 1.0, -4.2], [0.0, 0.0, 1.5], [0.3, -0.2, 0.1]])
    T = lattice.reduce_basis(A, np.eye(3))
    assert np.array_equal(T, np.rint(T))
    assert np.rint(abs(np.linalg.det(T))) == 1  # that of whole numbers is whole
    assert np.linalg.norm(A @ T, axis=0).max() < np.linalg.norm(A, axis=0).max()
    vectors = {tuple(m) for m in lattice.lattice_vectors(A, T, 5.0, 1000)}
    box = np.array(list(itertools.product(range(-60, 61), range(-12, 13), range(-4, 5))), dtype=float)
    expected = {tuple(m) for m in box[(np.linalg.norm(box @ A.T, axis=1) <= 5.0) & box.any(axis=1)]}
    assert vectors == expected
    assert len(vectors) == 38
    with pytest.raises(lattice.TooManyVectors):
        lattice.lattice_vectors(A, T, 5.0, 10)


def simulate_each(plan, n):
    """Normals (n, 2 + 2K), whether a fold is wrong in the end (n,), of realisations one by one."""
    normals, wrong = np.empty((n, plan.mixture.units.shape[1])), np.empty(n, dtype=bool)
    room, chosen, weights = np.zeros(8 * normals.shape[1]), np.zeros(8, np.int64), np.zeros(8)
    for i in range(n):
        if i % 8 == 0:
            weighted_sums.fill_shifted(plan.world, plan.mixture, i, room, chosen, weights)
        normals[i] = room.reshape(-1, 8)[:, i % 8]
        wrong[i] = plan.layout.unpack(study.simulate(plan, i, 1))["events"][0, -1, weighted_sums.WRONG, 2]
    return normals, wrong


@pytest.mark.parametrize(
    ("options", "keys"),
    [
        (NEAREST, {"prior": KNOWN, "repetition_rate_hz": 700.0}),
        (ALL, {"prior": NARROW, "repetition_rate_hz": 1000.0}),
        (ALL, {"prior": NARROW, "target": FIXED | {"coefficients": [100e3, -45.0, 4.0]}}),
        (ALL, {"prior": NARROW, "repetition_rate_hz": [1300.0, 1700.0], "variance": 0.1}),
    ],
)
def test_folds_are_wrong_exactly_in_the_half_spaces(options, keys):
    """Realisation by realisation, half of them shifted to where it is undecided."""
    case = rare_case(options, 5, **keys)
    plan, innovations = study.prepare(case), innovations_of(case)
    if options["hypotheses"] == 1:
        spaces = importance_sampling.nearest_fold_half_spaces(innovations)
    else:
        spaces = importance_sampling.half_spaces_within(
            innovations, importance_sampling.reduced_bases(innovations), filter_design.UNLIMITED_DEPTH, 8.5
        )
    normals, wrong = simulate_each(plan, 120)
    assert 30 < wrong.sum() < 90
    assert np.array_equal((normals @ spaces.units.T > spaces.distance).any(axis=1), wrong)


def test_early_drops_lie_in_a_half_space():
    """With a short memory more folds are wrong, and all where some half-space says so."""
    options, keys = ALL | {"prune_below": 0.05}, {"prior": NARROW, "repetition_rate_hz": 1000.0}
    case = rare_case(options, 6, **keys)
    innovations = innovations_of(case)
    spaces = importance_sampling.half_spaces_within(
        innovations, importance_sampling.reduced_bases(innovations), -math.log(0.05), 8.0
    )
    at_last = importance_sampling.half_spaces_within(
        innovations, importance_sampling.reduced_bases(innovations), filter_design.UNLIMITED_DEPTH, 8.0
    )
    normals, wrong = simulate_each(study.prepare(case), 400)
    within = (normals @ spaces.units.T > spaces.distance).any(axis=1)
    assert not (wrong & ~within).any()
    assert (within & ~wrong).sum() < 0.05 * wrong.sum()
    early = wrong & ~(normals @ at_last.units.T > at_last.distance).any(axis=1)
    assert early.sum() > 20


def test_weights_restore_the_normal_law():
    """The mean weight is one, and P(uᵀz > s) is Φ(−s) across every half-space."""
    plan = study.prepare(rare_case(ALL, 8))
    law, n = plan.mixture, 20_000
    normals, chosen, weights = np.zeros(8 * law.units.shape[1]), np.zeros((n // 8, 8), np.int64), np.zeros((n // 8, 8))
    along = np.empty((n // 8, 8, len(law.shift)))
    for i in range(n // 8):
        weighted_sums.fill_shifted(plan.world, law, 8 * i, normals, chosen[i], weights[i])
        along[i] = normals.reshape(-1, 8).T @ law.units.T
    weights, along, chosen = weights.ravel(), along.reshape(n, -1), chosen.ravel()
    assert abs(weights.mean() - 1) < mean_error(n, weights.std())
    assert weights.max() <= 1 / law.cumulative[0]
    assert np.mean(chosen == 0) == pytest.approx(0.1, abs=share_error(0.1, n))
    checked = 0
    for m, shift in enumerate(law.shift):
        if np.count_nonzero(chosen == m + 1) < 500:
            continue
        x = weights * (along[:, m] > shift)
        assert abs(x.mean() - ndtr(-shift)) < mean_error(n, x.std())
        assert x.std() / math.sqrt(n) < 0.1 * ndtr(-shift)
        checked += 1
    assert checked >= 6


@pytest.mark.parametrize(("hertz", "about"), [(1000.0, 1e-2), (1500.0, 1e-3), (2000.0, 1e-5), (2400.0, 1e-8)])
def test_rate_of_wrong_nearest_folds_is_the_exact_product(hertz, about):
    plan = study.prepare(rare_case(NEAREST, 12, prior=KNOWN, variance=0.0, repetition_rate_hz=hertz))
    exactly = 1 - plan.axes.exact_right[0, -1]
    assert about / 10 < exactly < 10 * about
    mean, error = rate(plan, 10_000)
    assert error < 0.05 * exactly
    assert abs(mean - exactly) < Z * error


@pytest.mark.parametrize("hertz", [2000.0, 4000.0, 6000.0])
def test_rate_of_two_scans_is_the_integral_over_a_hexagon(hertz):
    """Of two folds all that decides lies in a plane, where the right ones hold a cell of six sides about the origin."""
    case = rare_case(ALL, 2, prior=NARROW, variance=0.0, repetition_rate_hz=hertz)
    innovations = innovations_of(case)
    spaces = importance_sampling.half_spaces_within(
        innovations, importance_sampling.reduced_bases(innovations), filter_design.UNLIMITED_DEPTH, 9.0
    )
    basis = np.linalg.svd(spaces.units, full_matrices=False)[2][:2]
    plane = spaces.units @ basis.T
    assert_rounded(np.linalg.norm(plane, axis=1), np.ones(len(plane)), operations=20)
    angle = (np.arange(20_000) + 0.5) * (2 * math.pi / 20_000)
    toward = np.cos(angle) * plane[:, :1] + np.sin(angle) * plane[:, 1:]
    reach = (spaces.distance[:, None] / toward.clip(1e-300)).min(axis=0)  # away from a half-space there is no end
    exactly = float(np.mean(np.exp(-(reach**2) / 2)))
    mean, error = rate(study.prepare(case), 20_000)
    assert error < 0.04 * exactly
    assert abs(mean - exactly) < Z * error


def test_rate_of_1e_5_lies_between_its_bounds():
    """The nearest two half-spaces never meet, and all of them together bound the rate from above."""
    case = rare_case(MEMORY | {"hypotheses": 1000, "prune_below": 1e-9}, 10, repetition_rate_hz=970.0)
    plan, innovations = study.prepare(case), innovations_of(case)
    spaces = importance_sampling.find_half_spaces(innovations, case.spec.filters[0])
    chance = importance_sampling.probabilities(spaces)
    assert spaces.units[0] == pytest.approx(-spaces.units[1], abs=rounding(operations=20))
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
def test_rate_agrees_with_plain_realisations(name):
    options, keys = CASES[name]
    case = rare_case(options, 10, **keys)
    mean, error = rate(study.prepare(case), 5_000)
    plain, plain_error = plain_rate(case, 11, 50_000)
    assert error < 0.1 * mean
    assert abs(mean - plain) < Z * math.hypot(error, plain_error)
    assert 1e-4 < mean < 1e-2


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_rate_agrees_with_plain_realisations_for_twenty_seeds(name):
    """At 10⁻³ and 10⁻⁴: in one try of a hundred any difference is beyond the bound; means are not shifted."""
    options, keys = CASES[name]
    case = rare_case(options, 10, **keys)
    plan, z = study.prepare(case), []
    for seed in range(20):
        mean, error = rate(with_seed(plan, seed), 20_000)
        plain, plain_error = plain_rate(case, 100 + seed, 200_000)
        z.append((mean - plain) / math.hypot(error, plain_error))
    assert np.abs(z).max() < ndtri(1 - 0.005 / (20 * len(CASES)))
    assert abs(np.mean(z)) < ndtri(1 - 0.005 / len(CASES)) / math.sqrt(20)


@pytest.mark.slow
def test_rate_of_1e_5_has_20_percent_error():
    """Twenty runs of 20 000 realisations scatter as their intervals say, by less than 20 %."""
    plan = study.prepare(rare_case(MEMORY | {"hypotheses": 1000}, 15))
    rates = np.array([rate(with_seed(plan, seed), 20_000) for seed in range(20)])
    assert 5e-6 < rates[:, 0].mean() < 2e-5
    assert rates[:, 0].std() < 0.2 * rates[:, 0].mean()
    z = (rates[:, 0] - rates[:, 0].mean()) / rates[:, 1]
    low, high = chi2.ppf([1e-4, 1 - 1e-4], 19) / 20
    assert low < np.mean(z**2) < high


def test_sums_are_those_of_the_weights_and_are_additive():
    case = rare_case(MEMORY, 6, other_filters=[ORACLE])
    plan = study.prepare(case)
    sums = plan.layout.unpack(study.simulate(plan, 104, 60))
    parts = plan.layout.unpack(study.simulate(plan, 104, 37) + study.simulate(plan, 141, 23))
    for name, values in sums.items():
        assert_rounded(values, parts[name], size=column_sizes(values, 60), operations=60)
    room, chosen, weights = np.zeros(8 * 14), np.zeros((8, 8), np.int64), np.zeros((8, 8))
    for i in range(8):
        weighted_sums.fill_shifted(plan.world, plan.mixture, 104 + 8 * i, room, chosen[i], weights[i])
    chosen, weights = chosen.ravel()[:60], weights.ravel()[:60]
    plain = chosen == 0
    assert_rounded(sums["drawn"], [plain.sum(), weights.sum(), weights @ weights], operations=60)
    wrong = np.array(
        [
            plan.layout.unpack(study.simulate(plan, 104 + i, 1))["events"][0, -1, weighted_sums.WRONG, 2]
            for i in range(60)
        ]
    )
    of_wrong = [weights @ wrong, weights**2 @ wrong, wrong.sum(), weights**4 @ wrong]
    assert_rounded(sums["events"][0, -1, weighted_sums.WRONG], of_wrong, operations=60)
    assert not sums["events"][1].any()  # the oracle folds nothing
    assert sums["folds"][0, -1, layout.RIGHT_SUM] == (plain & (wrong == 0)).sum()
    assert (sums["estimates"] == plain.sum()).all()
    plain_plan = study.prepare(replace(case, spec=case.spec.model_copy(update={"rare": None})))
    first = 104 + int(np.flatnonzero(plain)[0])  # a plain realisation has the noise that it would have
    shared = plan.layout.unpack(study.simulate(plan, first, 1))
    expected = plain_plan.layout.unpack(study.simulate(plain_plan, first, 1))
    assert np.array_equal(shared["error"], expected["error"])


MISSING = make_case("RLS 5", [MEMORY], 8, detection_probability=0.9).spec.radar.model_dump(exclude_none=True)


def run_rare(n, *others, **keys):
    return radarsim.run(config_document(MEMORY, *others, rare={"filter": "memory"}, realisations=n, **keys))


def test_tables_have_the_rate_with_its_interval():
    result = run_rare(6000, NEAREST | {"manoeuvre_variance": 1e-3})
    table = result.tables["rare"]
    assert list(table.columns[6:13]) == [
        "n",
        "event_rate",
        "event_rate_lo",
        "event_rate_hi",
        "events",
        "n_eff",
        "variance_factor",
    ]
    row, sums = table.iloc[0], result.cases[0].sums
    weight, square, number, _ = sums["events"][0, -1, weighted_sums.WRONG]
    assert row["event_rate"] == weight / 6000
    assert row["events"] == number
    assert_rounded(row["n_eff"], weight**2 / square, operations=3)
    assert row["event_rate_lo"] < row["event_rate"] < row["event_rate_hi"]
    assert row["variance_factor"] > 5
    assert list(table["sought"]) == [True, False, False]
    assert list(table["event"]) == ["wrong fold", "wrong fold", "wrong fold that found no room"]
    folds = result.tables["folds"]
    last = folds[(folds["filter"] == "memory") & (folds["k"] == 8)].iloc[0]
    assert_rounded(last["right"], 1 - row["event_rate"])
    assert_rounded(last["right_hi"], 1 - row["event_rate_lo"])
    weight = sums["events"][0, -1, weighted_sums.BEYOND, 0]
    assert last["beyond_half_interval_share"] == weight / 6000
    assert result.curves["n"].max() <= row["n_plain"]
    assert "(importance sampling; " in " ".join(result.answer)
    assert not any("rare event" in line for line in result.warnings)


def test_wrong_folds_of_full_lists_have_a_note():
    """With room for few hypotheses many wrong folds are of a right one that found no room, and no shift leads there."""
    short, long = (
        radarsim.run(
            "ambiguous_rare",
            realisations=1000,
            overrides=["sweep.radar.repetition_rate_hz=[700]", f"filters.1.hypotheses={max_hypotheses}"],
        )
        for max_hypotheses in (100, 1000)
    )
    for result, is_noted in ((short, True), (long, False)):
        total, _, full = result.tables["rare"].to_dict("records")
        assert full["event"] == "wrong fold that found no room"
        assert full["events"] <= total["events"]
        squares = [row["event_rate"] ** 2 / max(row["n_eff"], 1) for row in (full, total)]
        assert (squares[0] > 0.1 * squares[1]) == is_noted
        assert (total["note"] == str(rare_events.UNGUIDED)) == is_noted
        assert any("may be too narrow" in line for line in result.warnings) or not is_noted


def test_calibration_and_curves_are_marked_by_their_own_realisations():
    """Effective events of the wrong folds say nothing of tables that are of the plain realisations."""
    result = run_rare(24)
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
def test_wrong_values_are_refused_with_their_key(keys, words):
    with pytest.raises(ConfigError) as error:
        load(config_document(MEMORY, *([] if "radar" in keys else [ORACLE]), **keys))
    assert any(words in line for line in error.value.lines), error.value.lines


def test_a_filter_that_is_never_wrong_is_refused():
    with pytest.raises(ConfigError, match="rare: memory has no wrong fold within 8 σ"):
        study.prepare(rare_case(MEMORY, 6, prior=KNOWN, repetition_rate_hz=6000.0))


def test_a_filter_that_is_hardly_ever_right_is_refused():
    with pytest.raises(ConfigError, match="rare: memory has over 300000 sequences of folds near the right one"):
        study.prepare(rare_case(MEMORY, 6, repetition_rate_hz=1.0, prior={"sigma_velocity_mps": 100.0}))
