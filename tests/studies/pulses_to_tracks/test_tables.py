"""Tables, figures and sentences of a small run."""

import re

import numpy as np
import pytest

import radarsim
from radarsim.api.configs import load
from radarsim.report import wording
from radarsim.report.drawing.model import Line
from radarsim.report.statistics import MIN_EVENTS
from radarsim.studies import registry
from radarsim.studies.pulses_to_tracks import study, tables
from radarsim.studies.pulses_to_tracks.tables import SIGMA_ALL_NOTE
from tests.answers import answer_texts
from tests.studies.pulses_to_tracks import naive
from tests.studies.pulses_to_tracks.conftest import CURED, make_case
from tests.tolerances import assert_rounded, rounding, sigma_error


@pytest.fixture(scope="module")
def result():
    return radarsim.run("pulses", realisations=1500)


@pytest.fixture(scope="module")
def swept():
    overrides = ["sweep.burst.snr_db=[-4, 1, 14]", "scans=4"]
    return radarsim.run("pulses_snr", realisations=600, overrides=overrides)


def test_curves_have_the_idealisation_exact(result):
    curves = result.curves
    assert set(curves[curves["exact_sigma"].notna()]["filter"]) == {"r", "ideal"}
    assert len(curves) == 7 * 15 * 3


def test_locks(result):
    locks = result.tables["locks"]
    assert set(locks["filter"]) == set(result.curves["filter"]) - {"r"}
    assert (locks["lock_rate_3sigma"] <= locks["lock_rate"]).all()
    assert ((locks["lock_lo"] <= locks["lock_rate"]) & (locks["lock_rate"] <= locks["lock_hi"])).all()
    ideal = locks[locks["filter"] == "ideal"]
    assert (ideal["lock_rate"] == 1).all()
    assert (locks[locks["filter"] == "cured"]["used_share"] == 1).all()
    assert 0.99 < locks[locks["filter"] == "cured, gated"]["used_share"].mean() < 1


def test_estimates_against_the_bound(result):
    table = result.tables["estimates"]
    ideal = table[table["filter"] == "ideal"]
    np.testing.assert_allclose(ideal["sigma_all"], ideal["crb"], rtol=sigma_error(1500))
    assert (table["sigma"] <= table["sigma_all"] * (1 + rounding(operations=1500))).all()
    assert set(table["component"]) == {"Vr"}
    np.testing.assert_allclose(table["energy_db"], 17.28, atol=0.011)


def test_sigma_of_all_bursts_is_marked_where_a_few_losses_decide(swept):
    """At −4 dB 94 of 600 bursts of the spectrum are lost and make its σ_all; at 14 dB none is."""
    for result, expected in zip(swept.cases, (SIGMA_ALL_NOTE, None, ""), strict=True):
        if expected is None:  # marked already, as losses may be missing
            continue
        estimates = tables.tables([result])["estimates"]
        spectrum_rows = estimates[estimates["filter"] == "spectrum"]
        square, fourth = result.sums["measured"][result.axes.filters.index("spectrum"), :, 0, 1].T
        few = 600 / (600 * fourth / square**2 - 1) < 200
        assert few.tolist() == [expected == SIGMA_ALL_NOTE] * 4
        assert spectrum_rows["note"].tolist() == [expected] * 4


def test_losses_count_all_realisations(result):
    table = result.tables["losses"]
    assert (table.groupby(["filter", "component", "k"])["n"].sum() == 1500).all()
    assert table["since_loss"].between(0, 6).all()


def test_idealisations(result):
    table = result.tables["idealisations"]
    assert set(table["idealisation"]) == {"ideal"}
    spectrum_rows = table[(table["filter"] == "spectrum") & (table["component"] == "Vr")]
    assert (spectrum_rows["over_ideal_lo"] < 1.06).all()
    curves = result.curves.set_index(["filter", "component", "k"])
    row = spectrum_rows[spectrum_rows["k"] == 7].iloc[0]
    ratio = curves.loc[("spectrum", "Vr", 7), "sigma"] / curves.loc[("ideal", "Vr", 7), "exact_sigma"]
    assert_rounded(row["over_ideal"], ratio, operations=4)
    paired = curves.loc[("spectrum", "Vr", 7), "sigma"] / curves.loc[("ideal", "Vr", 7), "sigma"]
    assert_rounded(row["paired_over_ideal"], paired, operations=8)


def test_the_idealisation_is_paired_in_the_same_bursts(result):
    """What is locked errs as the bound does in the same burst: the ratio is known many times better, and so worded."""
    table = result.tables["idealisations"].query("component == 'r' and filter == 'spectrum'").iloc[-1]
    widths = [table[f"{name}_hi"] - table[f"{name}_lo"] for name in ("paired_over_ideal", "over_ideal")]
    assert widths[0] < 0.5 * widths[1]
    ratio = wording.estimate((table[f"paired_over_ideal{end}"] for end in ("", "_lo", "_hi")), form=".4g")
    assert any(ratio in sentence for sentence in result.answer)


def test_the_cure_is_the_cheapest_of_the_sequences(result):
    passes = result.tables["passes"].set_index("filter")["passes"]
    assert passes["ideal"] == 0
    assert passes["cured"] < passes["sequence"]


def test_sentences(result):
    study, experiment = registry.study("pulses_to_tracks"), load("pulses")
    assert study.question(experiment).startswith("How well does the radar RLS 4 track from its pulse bursts")
    sentences = answer_texts(study, result.cases, result.tables)
    assert sentences[-1] == (
        "RLS 4: 16 pulses in 0.8 ms, 17.3 dB in all. An ideal burst always locks and reaches the Cramér–Rao bound, "
        "σ_V = 1 m/s."
    )
    ratios = result.tables["idealisations"].query("component == 'r'").groupby("filter").tail(1)
    ratios = ratios.set_index("filter")["paired_over_ideal"]
    best, near, worst, far = re.fullmatch(
        r"RLS 4, RMS range error at the last scan relative to that with ideal bursts \(95 % for all \d filters "
        r"together\): least with “(.+)”, ([\d.]+) \[.*\]; greatest with “(.+)”, ([\d.]+) \[.*\]\.",
        sentences[0],
    ).group(1, 2, 3, 4)
    assert (best, worst) == (ratios.idxmin(), ratios.idxmax())
    assert [float(near), float(far)] == pytest.approx([ratios.min(), ratios.max()], rel=1e-2)
    for name in ratios.index:
        assert any(line.startswith("RLS 4") and f"“{name}”" in line for line in sentences[1:-1])
    locks = result.tables["locks"].assign(lock_rate=1.0, lock_lo=0.99, lock_hi=1.0)
    first, *_ = [
        line
        for line in answer_texts(study, result.cases, {**result.tables, "locks": locks})
        if line.startswith("RLS 4: with ")
    ]
    count = locks["n"][locks["filter"] == "spectrum"].sum()
    assert all(f"“{name}”" in first for name in ratios.index)
    assert f" none of {count:,} bursts failed to lock (at each scan 9" in first
    assert f" % or more lock, 95 % for all {locks['k'].max()} scans together)" in first


def test_each_ratio_stands_once(result, swept):
    """With one interval: a ratio that the first sentence gives is not repeated for its filter."""
    heads = {result: [f"RLS 4, “{name}”: " for name in re.findall(r"t with “(.+?)”", result.answer[0])]}
    worst = re.findall(r"“([^”]+)” [^(]*\(([^)]*)\)", swept.answer[0].partition("): ")[2])
    heads[swept] = [f"RLS 4, {case}, “{name}”: " for name, case in worst]
    for run, named in heads.items():
        assert len(named) > 1
        lines = [line for line in run.answer for head in named if line.startswith(head)]
        assert any("lock" in line for line in lines)
        assert not any(" times" in line or " above " in line for line in lines)


@pytest.mark.parametrize(
    ("ends", "words"),
    [
        ((1.0, 0.994, 1.007), "is as with ideal bursts, 1.000 [0.994, 1.007] times"),
        ((1.014, 1.003, 1.026), "is 1.4 % [0.3, 2.6] above that with ideal bursts"),
        ((0.997, 0.995, 0.999), "is 0.997 [0.995, 0.999] times that of ideal bursts"),
        ((1.29, 0.89, 1.88), "is 1.29 [0.89, 1.88] times that of ideal bursts"),
        ((3.08, 1.29, 7.31), "is 3.08 [1.29, 7.31] times that of ideal bursts"),
    ],
)
def test_words_on_a_ratio_agree_with_its_interval(result, ends, words):
    """As with ideal bursts only where the interval holds one; above only where it lies above."""
    rows = result.tables["idealisations"]
    rows = rows.assign(
        **dict(zip(("paired_over_ideal", "paired_over_ideal_lo", "paired_over_ideal_hi"), ends, strict=True))
    )
    texts = answer_texts(registry.study("pulses_to_tracks"), result.cases, {**result.tables, "idealisations": rows})
    assert any(
        line.startswith("RLS 4, “cured”: ") and f"the RMS range error at the last scan {words}" in line
        for line in texts
    )


def test_answer_has_the_cost_of_a_failed_burst(result, swept):
    """σ where the burst of the last scan failed, beside the exact one of ideal bursts; or that too few failed."""
    losses = swept.tables["losses"].query("component == 'r' and since_loss == 0 and n >= @MIN_EVENTS")
    costly = losses[(losses["k"] == 4) & losses["case"].str.endswith("=-4")]
    curves = swept.curves.query("component == 'r' and k == 4 and filter == 'ideal'").set_index("case")
    assert len(costly) > 1
    for _, row in costly.iterrows():
        head, exact = f"RLS 4, q = −4 dB, “{row['filter']}”: ", curves.loc[row["case"], "exact_sigma"]
        cost = f"where the burst of the last scan failed ({row['n']} realisations) the RMS range error there is "
        (line,) = [line for line in swept.answer if line.startswith(head) and cost in line]
        sigma, rest = line.partition(cost)[2].split(" m [", 1)
        assert float(sigma) == pytest.approx(row["sigma"], rel=5e-3)
        assert rest.endswith(f"], with ideal bursts (“ideal”) {exact:.4g} m.")
    few = f"RLS 4: too few bursts failed at the last scan to say what one costs (under {MIN_EVENTS} of 1500)."
    assert few in result.answer


def test_answer_on_several_cases_names_the_case_furthest_from_the_idealisation(swept):
    last = swept.tables["idealisations"].query("component == 'r'").groupby(["case", "filter"]).tail(1)
    assert swept.answer[0].startswith("Largest RMS range error at the last scan relative to ideal bursts (")
    for name, filter_rows in last.groupby("filter"):
        worst = filter_rows.loc[filter_rows["paired_over_ideal"].idxmax()]
        where = worst["case"].rpartition("=")[2].replace("-", "−")
        match = re.search(rf"[:;] “{name}” ([\d.]+) \[[^]]*\] \(q = {where} dB\)", swept.answer[0])
        assert float(match[1]) == pytest.approx(worst["paired_over_ideal"], rel=6e-3)


def test_figures(result, swept):
    assert {"sigma_r", "gain_Vr", "locks", "measured"} <= set(result.figures)
    assert "threshold" in swept.figures
    assert "losses" not in swept.figures


def test_filter_has_the_same_look_in_all_figures(result):
    figures = registry.study("pulses_to_tracks").figures(result.cases, result.tables, load("pulses"))
    looks = {}
    for name in ("sigma_r", "locks"):
        for mark in (mark for panel in figures[name].panels for mark in panel.marks if isinstance(mark, Line)):
            looks.setdefault(mark.label, {})[name] = mark.style
    missed = result.tables["locks"].assign(lost=lambda rows: (1 - rows["lock_rate"]) * rows["n"])
    missed = missed.groupby("filter")["lost"].sum().round()
    often = set(missed[missed >= MIN_EVENTS].index)
    assert often
    assert {name for name, looks_by_figure in looks.items() if set(looks_by_figure) == {"sigma_r", "locks"}} == often
    assert all(len(set(looks_by_figure.values())) == 1 for looks_by_figure in looks.values())


def test_threshold_figure_shows_the_rise(swept):
    locks = swept.tables["locks"]
    rate = locks.groupby(["case", "filter"])["lock_rate"].min()
    low, high = (f"pulses_snr burst.snr_db={value}" for value in (-4, 14))
    assert rate[low, "spectrum"] < 0.95 < 0.99 < rate[high, "spectrum"]


def test_sigma_is_marked_where_unseen_losses_may_decide(result):
    """1500 tracks may lack the lost burst that decides σ: sequences are marked, what is known to lock is not.

    From the third scan on: a velocity of another fold becomes a wrong range only with the next scan.
    """
    curves = result.tables["curves"].fillna({"note": ""})
    marked = curves[curves["k"] > 2].groupby("filter")["note"].agg(lambda notes: (notes != "").mean())
    assert (marked[["r", "ideal", "spectrum"]] == 0).all()
    assert (marked[["sequence", "cured", "cured, gated", "cured, mixture"]] == 1).all()
    for name in ("gains", "idealisations", "estimates"):
        notes = result.tables[name].fillna({"note": ""}).groupby("filter")["note"]
        assert notes.agg(lambda own: (own != "").any())[["cured", "cured, mixture"]].all()


def test_squares_that_a_lost_burst_adds():
    """The answers of a textbook filter to an error of one burst, or of all from one on, squared and summed."""
    fixed = CURED | {"name": "fixed", "forecast": {"sigma_velocity_mps": 10.0, "sigma_acceleration_mps2": 5.0}}
    case = make_case([CURED, fixed], scans=6)
    plan = study.prepare(case)
    bound, prior = plan.axes.bound[0, :, 0], (30.0, 5.0)

    def ends(errors):
        track = naive.Track(50.0, 0.0, [0.0, 0.0], prior)
        for k in range(6):
            if k:
                track.predict(10.0, 1e-3 if k >= 2 else 0.0, 0.0)
                track.take([0], -track.x[:1], [2500.0])
            track.take([1], errors[k] - track.x[1:2], [bound[k] ** 2])
        return track.x

    for f, until in ((0, 6), (1, 1)):
        answers = [ends([1.0 if j <= k < j + until else 0.0 for k in range(6)]) for j in range(6)]
        expected = np.square(answers).sum(axis=0) * 300.0**2 / 12
        # Covariances of a track after six scans, whose gains are differences: κ of some thousand at most.
        np.testing.assert_allclose(plan.axes.lost_squares[f, -1], expected, rtol=rounding(1e3, 60))
