"""The gain of Doppler with each filter at its best D_M, and at one for both, against recursions written out here."""

import re

import numpy as np
import pytest
from scipy import linalg

import radarsim
from radarsim.api import new_configs
from radarsim.report.statistics import Estimate, root_mean_square, simultaneous_sizes
from radarsim.studies.best_gain_answer import FilterChoices, gain_sentences
from radarsim.studies.range_doppler import variance_answer
from radarsim.studies.range_doppler.variance_answer import D_M

SIGMA, DT = np.array([15.0, 0.8]), 2.5
RADAR = {"name": "mine", "wavelength_m": 0.032, "sigma_range_m": 15, "sigma_velocity_mps": 0.8, "scan_period_s": DT}
FILTERS = [
    {"name": "r", "observes": ["range"], "manoeuvre_variance": 1e-3},
    {"name": "r+Vr", "observes": ["range", "velocity"], "manoeuvre_variance": 1e-3},
]
BOAT = {"kind": "turn", "range_m": 8e3, "speed_mps": 12, "aspect_deg": 180, "start_s": 60}
BOAT |= {"acceleration_g": 0.2, "duration_s": 18}
TRIED = [1e-3, 1e-2, 1e-1, 1.0]
F = np.array([[1, DT, DT**2 / 2], [0, 1, DT], [0, 0, 1]])
JERK = np.array([DT**3 / 6, DT**2 / 2, DT])


def config(target, **keys):
    radar = RADAR | keys.pop("radar", {})
    return {"study": "range_doppler", "radar": radar, "filters": FILTERS, "target": target, "realisations": 60, **keys}


def gain_sentence(result):
    (sentence,) = [line for line in result.answer if "with each at its best D_M" in line]
    return sentence


def numbers(sentence):
    """The gains of a sentence, per cent, in its order."""
    return [float(text.replace("−", "-")) for text in re.findall(r"(−?[\d.]+)(?= %| to [−\d.]+ %)", sentence)]


def worst_sigma(observed, variance, x, since):
    """The greatest σ of the range from an index on: the filter's gains run over the truth and over the noise."""
    H, R = np.eye(3)[:observed], np.diag(SIGMA[:observed] ** 2)
    start = {1: 3, 2: 2}[observed]
    design = np.concatenate([H @ np.linalg.matrix_power(np.linalg.inv(F), start - 1 - k) for k in range(start)])
    weight = np.kron(np.eye(start), np.linalg.inv(R))
    believed = np.linalg.inv(design.T @ weight @ design)
    estimate = believed @ design.T @ weight
    bias = estimate @ np.concatenate([x[k, :observed] for k in range(start)]) - x[start - 1]
    noise, sigmas = believed, []
    for k in range(start - 1, len(x)):
        if k >= start:
            predicted = F @ believed @ F.T + variance * np.outer(JERK, JERK)
            K = predicted @ H.T @ np.linalg.inv(H @ predicted @ H.T + R)
            A = np.eye(3) - K @ H
            believed = A @ predicted
            bias = A @ (F @ (bias + x[k - 1]) - x[k])
            noise = A @ F @ noise @ F.T @ A.T + K @ R @ K.T
        sigmas.append(np.sqrt(noise[0, 0] + bias[0] ** 2))
    return max(sigmas[since - start + 1 :])


def boat_truth(scans):
    """Range, its rate and the rate of that, of the boat's turn in the plane, integrated in small steps."""
    position, heading, speed, steps, rows = np.array([8e3, 0.0]), np.pi, 12.0, 250, []
    rate = 0.2 * 9.80665 / speed
    for k in range(scans):
        velocity = speed * np.array([np.cos(heading), np.sin(heading)])
        turning = 60 <= k * DT < 78
        across = speed * rate * np.array([-np.sin(heading), np.cos(heading)]) * turning
        r = np.linalg.norm(position)
        v = position @ velocity / r
        rows.append((r, v, (velocity @ velocity + position @ across - v**2) / r))
        for i in range(steps):
            dt, now = DT / steps, (k + (i + 0.5) / steps) * DT
            turn = rate * dt if 60 <= now < 78 else 0.0
            middle = heading + turn / 2
            position = position + speed * dt * np.array([np.cos(middle), np.sin(middle)])
            heading += turn
    return np.array(rows)


def test_gain_in_a_turn_is_that_between_the_two_best():
    x = boat_truth(61)
    sigma = {n: {v: worst_sigma(n, v, x, 24) for v in TRIED} for n in (1, 2)}
    result = radarsim.run(config(BOAT, scans=61, sweep={"manoeuvre_variance": TRIED}))
    sentence = gain_sentence(result)
    at_best = 100 * (1 - min(sigma[2].values()) / min(sigma[1].values()))
    alike = [100 * (1 - sigma[2][v] / sigma[1][v]) for v in TRIED]
    assert sentence.startswith("mine, gain of r+Vr over r in RMS error of the range at worst: ")
    low, high, *of_both = numbers(sentence)  # of r 10⁻¹ and 1 do equally well
    assert 60.75 < low <= at_best + 0.06
    assert at_best - 0.06 <= high < 60.95
    assert of_both == pytest.approx([min(alike), max(alike)], abs=0.06)
    assert result.answer.index(sentence) == 1  # beside the D_M that it is about


def steady_sigma(observed, variance):
    """σ of the range in the long run, with gains for a manoeuvre that the target does not make."""
    H, R = np.eye(3)[:observed], np.diag(SIGMA[:observed] ** 2)
    P = linalg.solve_discrete_are(F.T, H.T, variance * np.outer(JERK, JERK), R)
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
    A = np.eye(3) - K @ H
    return np.sqrt(linalg.solve_discrete_lyapunov(A @ F, K @ R @ K.T)[0, 0])


def test_gain_in_the_long_run_is_that_between_the_best_that_settle():
    tried = [1e-3, 1e-2, 1e-1, 1.0]
    target = {"kind": "polynomial", "coefficients": [8e3, -12]}
    result = radarsim.run(
        config(target, scans=61, sweep={"manoeuvre_variance": tried}, radar={"sigma_velocity_mps": 3})
    )
    rows = result.tables["steady"]
    rows = rows[(rows["component"] == "r") & rows["best"]].set_index("filter")
    best = rows["manoeuvre_variance"]
    SIGMA[1] = 3.0
    try:
        at_best = 100 * (1 - steady_sigma(2, best["r+Vr"]) / steady_sigma(1, best["r"]))
        alike = [100 * (1 - steady_sigma(2, v) / steady_sigma(1, v)) for v in tried]
    finally:
        SIGMA[1] = 0.8
    sentence = gain_sentence(result)
    assert "RMS error of the range once settled" in sentence
    assert numbers(sentence) == pytest.approx([at_best, min(alike), max(alike)], abs=0.06)


@pytest.mark.parametrize(
    ("over", "words"), [("worst", "at worst"), ("last", "at the last scan"), ("mean", "on average")]
)
def test_gain_between_filters_that_were_optimised(over, words):
    result = radarsim.run(
        config(BOAT, scans=61), overrides=[f"manoeuvre_variance={{minimise: sigma_r, over: {over}, from_k: 25}}"]
    )
    sentence = gain_sentence(result)
    assert f"RMS error of the range {words}" in sentence
    best = numbers(sentence)[0]
    (case,) = result.cases
    exact = case.axes.exact_sigma[:, 24:, 0]
    merit = {"worst": exact.max(axis=1), "last": exact[:, -1], "mean": exact.mean(axis=1)}[over]
    assert best == pytest.approx(100 * (1 - merit[1] / merit[0]), abs=0.06)
    assert sentence.count("(") == 2  # the D_M of either for both


@pytest.mark.slow
def test_with_missed_plots_a_straight_target_has_its_sentence_too():
    target = {"kind": "polynomial", "coefficients": [8e3, -12]}
    keys = {"scans": 15, "radar": {"detection_probability": 0.85}, "sweep": {"manoeuvre_variance": [1e-3, 1e-1]}}
    answers = [radarsim.run(config(target, seed=seed, **keys)).answer for seed in (1, 2)]
    assert gain_sentence(type("Result", (), {"answer": answers[0]})) in answers[1]  # whatever the seed


def test_values_that_tie_make_a_span():
    r = FilterChoices("r", {0.1: Estimate(10, 10, 10), 1.0: Estimate(10.05, 10.05, 10.05)}, (0.1, 1.0))
    v = FilterChoices("v", {0.1: Estimate(5, 5, 5), 1.0: Estimate(5.02, 5.02, 5.02)}, (0.1, 1.0))
    (sentence,) = gain_sentences("mine", "range", "worst", D_M, r, [v])
    assert "49.8 to 50.2 % with each at its best D_M; " in sentence.text
    alone = [choice._replace(best=(0.1,)) for choice in (r, v)]
    (sentence,) = gain_sentences("mine", "range", "worst", D_M, *alone[:1], alone[1:])
    assert ": 50.0 % with each at its best D_M" in sentence.text
    (sentence,) = gain_sentences("mine", "range", "worst", D_M, r._replace(best=()), [v])
    assert ": no D_M settles in time with r; 50.0 % (10⁻¹) to 50.0 % (1) with the same D_M for both" in sentence.text


def test_interval_of_the_gain_holds_whichever_was_picked():
    """Of six D_M that are all alike noise picks the least: the interval covers the gain of 50 % in 95 of 100 runs."""
    rng, count, runs, covered = np.random.default_rng(5), 200, 400, 0
    variances = [10.0**power for power in range(6)]

    def choices(name, sigma):
        e = rng.normal(0, sigma, (6, count))
        single = root_mean_square((e**2).sum(1), (e**4).sum(1), count)
        at_once = simultaneous_sizes(single, 12)
        sigmas = {v: Estimate(*(float(end[i]) for end in at_once)) for i, v in enumerate(variances)}
        return FilterChoices(name, sigmas, [min(sigmas, key=lambda v: sigmas[v].value)])

    for _ in range(runs):
        (sentence,) = gain_sentences("mine", "range", "worst", D_M, choices("r", 2.0), [choices("v", 1.0)])
        low, high = map(float, re.search(r"% \(([\d.]+) … ([\d.]+)\) with each", sentence.text).groups())
        covered += low <= 50 <= high
    assert covered >= 0.95 * runs


@pytest.mark.parametrize(
    "like", ["rls1", pytest.param("rls2", marks=pytest.mark.slow), pytest.param("rls5", marks=pytest.mark.slow)]
)
def test_the_sweep_of_a_new_config_can_be_switched_on(tmp_path, monkeypatch, like):
    monkeypatch.chdir(tmp_path)
    path = new_configs.write_new_config("mine", like)
    text = path.read_text()
    path.write_text(text.replace("# sweep: {manoeuvre_variance", "sweep: {manoeuvre_variance"))
    result = radarsim.run(path, realisations=20, overrides=["target=turn", "scans=9"], out=tmp_path, figures=False)
    assert len(result.cases) == 6
    assert "with each at its best D_M" in result.answer[1]


@pytest.mark.slow
def test_measured_errors_have_intervals_for_all_scans_variances_and_filters_at_once(monkeypatch):
    """As of a run that is too long to compute: the ends are those of the tables, widened for all 2·2·37 of them."""
    monkeypatch.setattr(
        variance_answer, "_computed_sigma", lambda result, f, v: np.full((len(v), result.spec.plots, 3), np.nan)
    )
    tried, missing = [1e-3, 1e-1], {"detection_probability": 0.85}
    result = radarsim.run(config(BOAT, scans=61, realisations=500, sweep={"manoeuvre_variance": tried}, radar=missing))
    curves = result.tables["curves"]
    rows = curves[(curves["component"] == "r") & (curves["k"] >= 25)]
    assert rows["exact_sigma"].isna().all()
    measured = Estimate(*(rows[name].to_numpy() for name in ("sigma", "sigma_lo", "sigma_hi")))
    widened = rows.assign(**simultaneous_sizes(measured, len(rows))._asdict())
    r, v = (
        widened[(widened["filter"] == name) & (widened["case"].str.endswith("0.1"))][["value", "lo", "hi"]].max()
        for name in ("r", "r+Vr")
    )
    ends = f"({100 * (1 - v['hi'] / r['lo']):.1f} … {100 * (1 - v['lo'] / r['hi']):.1f}) at 10⁻¹"
    assert ends.replace("-", "−") in gain_sentence(result)
