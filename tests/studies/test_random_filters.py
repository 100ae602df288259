"""Filters with random numbers: by counter, in any batch; repeated ones, and learned realisations, are detected."""

import random

import numpy as np
import pytest
from numpy.random import default_rng

import radarsim
from radarsim.api import filter_checks

BLOCK = 4096  # realisations of `rls2`
NOISE_M = 1000.0


class Own:
    """The measured range and noise of a generator of its own, seeded anew where it starts."""

    def __init__(self, seed=1):
        self.seed = seed

    def start(self, world):
        self.rng = np.random.default_rng(self.seed)

    def step(self, plots):
        return (plots["range_m"] + NOISE_M * self.rng.standard_normal(plots.n))[:, None]


class OneByOne(Own):
    """Numbers taken realisation by realisation, of a number that depends on the plots."""

    def step(self, plots):
        return np.array([[z + 30 * self.rng.random(1 + int(abs(z)) % 3).sum()] for z in plots["range_m"]])


class BySeedOfBlock(Own):
    def start(self, world):
        self.rng = None

    def step(self, plots):
        self.rng = self.rng or np.random.default_rng([self.seed, plots.first])
        return super().step(plots)


class ByGenerator(Own):
    def start(self, world):
        self.rng = None

    def step(self, plots):
        self.rng = self.rng or plots.generator()
        return super().step(plots)


class ByCounter:
    def start(self, world):
        pass

    def step(self, plots):
        return (plots["range_m"] + NOISE_M * plots.normals(1)[:, 0])[:, None]


def of_all_scans(plots):
    return plots["range_m"] + NOISE_M * plots.normals(1)[..., 0]


def legacy(plots):
    np.random.seed(3)  # noqa: NPY002  (as older libraries draw)
    return plots["range_m"] + np.random.standard_normal(plots["range_m"].shape)  # noqa: NPY002


def beside(plots):
    return plots["range_m"] + 0.1 * (plots["range_m"] - plots["range_m"][0])


def judged(target, realisations=BLOCK + 100, **options):
    return radarsim.judge("rls2", target, realisations=realisations, figures=False, threads=1, **options)


def own_rows(result):
    return result.curves.query("filter == 'mine'")


def test_numbers_are_the_same_in_any_batch_and_however_a_filter_is_called():
    results = [
        judged(target, realisations=300, one_by_one=alone)
        for target, alone in ((ByCounter, False), (of_all_scans, False), (lambda p: of_all_scans(p), True))
    ]
    for result in results[1:]:
        assert result.curves.equals(results[0].curves)
    assert [result.warnings for result in results] == [[], [], []]
    plots = radarsim.plots("rls2", n=300)
    sigma = np.sqrt(np.mean((of_all_scans(plots) - plots.truth[..., 0]) ** 2, axis=0))
    np.testing.assert_allclose(own_rows(results[0])["sigma"], sigma, rtol=1e-9)


def test_calls_give_further_independent_numbers():
    plots = radarsim.plots("rls2", n=4000)
    first, second, uniform = plots.normals(3), plots.normals((2, 2)), plots.uniforms(3)
    assert (first.shape, second.shape, uniform.shape) == ((4000, 15, 3), (4000, 15, 2, 2), (4000, 15, 3))
    numbers = np.concatenate([x.reshape(4000, -1) for x in (first, second, np.sqrt(12) * (uniform - 0.5))], axis=1)
    pairs = numbers.shape[1] ** 2 / 2  # of correlations, each normal with σ = 1/√n
    limit = np.sqrt(2 * np.log(pairs) + 8) / np.sqrt(4000)
    assert np.abs(np.corrcoef(numbers.T) - np.eye(numbers.shape[1])).max() < limit
    assert np.abs(numbers.mean(0)).max() < limit
    assert np.abs(numbers.var(0) - 1).max() < np.sqrt(2) * limit
    other = radarsim.plots("rls2", n=4000, overrides={"seed": 3}).normals(3)
    assert abs(np.mean(first * other)) < 4 / np.sqrt(first.size)
    later = radarsim.plots("rls2", n=10, first=100)
    assert np.array_equal(later.normals(3), first[100:110])


@pytest.mark.parametrize("wrong", [-1, 1.5, "3", (2, -1)])
def test_a_count_that_is_none_is_refused(wrong):
    with pytest.raises(radarsim.ConfigError, match="must be a whole number"):
        radarsim.plots("rls2", n=2).normals(wrong)


@pytest.mark.parametrize("target", [Own, OneByOne, legacy])
def test_numbers_that_repeat_in_each_block_are_said_and_their_intervals_not_shown(target):
    result = judged(target)
    assert result.warnings[0].startswith("mine: draws the same random numbers in every block of 4096 realisations")
    assert own_rows(result)[["sigma_lo", "sigma_hi"]].isna().all(axis=None)
    gains = result.gains.query("filter == 'mine'")
    assert gains[["gain_lo", "gain_hi"]].isna().all(axis=None)
    others = result.curves.query("filter != 'mine'")
    assert others[["sigma_lo", "sigma_hi"]].notna().all(axis=None)
    assert result.answer[0].startswith("“mine” cannot be judged against r+Vr")
    assert "nan" not in " ".join(result.answer)


class ByRow:
    """The measured range and an offset that grows with the row; nothing is drawn."""

    def start(self, world):
        pass

    def step(self, plots):
        return (plots["range_m"] + 0.1 * NOISE_M * np.sin(np.arange(plots.n)))[:, None]


class SameInAllRows(Own):
    """A number at each scan, the same in all rows."""

    def step(self, plots):
        return (plots["range_m"] + NOISE_M * self.rng.standard_normal())[:, None]


class SeededWhereBuilt(SameInAllRows):
    def __init__(self):
        self.rng = np.random.default_rng(4)

    def start(self, world):
        pass


class Weights:
    """A weight that is drawn where the filter is built, as that of a network: part of the filter."""

    def __init__(self):
        self.weight = random.Random(5).random()

    def start(self, world):
        pass

    def step(self, plots):
        return (plots["range_m"] + self.weight)[:, None]


def anew_in_each_realisation(plots):
    return plots["range_m"] + NOISE_M * default_rng(7).standard_normal(plots["range_m"].shape)


def seeded_by_config(plots):
    random.seed(plots.world.keys["radar"]["scan_period_s"])
    return plots["range_m"] + [NOISE_M * random.gauss(0, 1) for _ in plots["range_m"]]


def seeded_by_plots(plots):
    rng = np.random.RandomState(int(abs(plots["range_m"][0]) * 1e3) % 2**32)
    return plots["range_m"] + NOISE_M * rng.standard_normal(plots["range_m"].shape)


@pytest.mark.parametrize("count", [300, BLOCK + 100])
@pytest.mark.parametrize(
    ("target", "alone", "words", "reason"),
    [
        (anew_in_each_realisation, True, "all realisations share them", "all realisations share its random numbers"),
        (seeded_by_config, True, "all realisations share them", "all realisations share its random numbers"),
        (SameInAllRows, False, "all realisations share them", "all realisations share its random numbers"),
        (SeededWhereBuilt, False, "all realisations share them", "all realisations share its random numbers"),
        (ByRow, False, "depend on the row of a realisation", "its estimates depend on the row in the batch"),
        (beside, False, "depend on the others in the batch", "its estimates depend on the other realisations"),
    ],
)
def test_realisations_that_depend_on_each_other_are_said_by_their_cause_and_have_no_intervals(
    target, alone, words, reason, count
):
    result = judged(target, realisations=count, one_by_one=alone)
    (warning,) = result.warnings
    assert words in warning
    assert own_rows(result)[["sigma_lo", "sigma_hi"]].isna().all(axis=None)
    assert reason in result.answer[0]


@pytest.mark.parametrize(("target", "alone"), [(Weights, False), (seeded_by_plots, True)])
def test_numbers_that_belong_to_the_filter_or_to_the_plots_get_no_word(target, alone):
    result = judged(target, realisations=300, one_by_one=alone)
    assert result.warnings == []
    assert own_rows(result)["sigma_lo"].notna().all()


def test_a_share_of_failures_of_realisations_that_depend_on_each_other_has_no_interval():
    def above_the_mean(plots):
        return np.where(plots["range_m"] > plots["range_m"].mean(), plots["range_m"], np.nan)

    answer = judged(above_the_mean, realisations=300).answer
    assert answer[0].startswith("“mine” fails in 100 % of the realisations (not a number after an estimate: 300)")
    assert "nan" not in " ".join(answer)


@pytest.mark.parametrize("variance", [1e-300, -1.0, 0.0])
def test_covariances_that_no_number_follows_from_are_counted(variance):
    def believed(plots):
        return plots["range_m"][..., None], np.full((*plots["range_m"].shape, 1, 1), variance)

    result = judged(believed, realisations=200)
    assert any("In 200 of 200 realisations “mine” gives a covariance" in line for line in result.answer)


def test_one_block_alone_repeats_nothing():
    result = judged(Own, realisations=400)
    assert own_rows(result)[["sigma_lo", "sigma_hi"]].notna().all(axis=None)


@pytest.mark.parametrize("target", [BySeedOfBlock, ByGenerator, ByCounter, of_all_scans])
def test_numbers_that_differ_from_block_to_block_get_no_word(target):
    result = judged(target)
    assert result.warnings == []
    assert own_rows(result)["sigma_lo"].notna().all()


def test_a_filter_that_mixes_realisations_draws_nothing():
    (warning,) = judged(beside).warnings
    assert "depend on the others in the batch" in warning


class Learned:
    """The true range, but for a metre, of 150 realisations that it knows by their first plot; of others the plots."""

    def __init__(self, **options):
        plots = radarsim.plots("rls2", n=150, overrides={"target": "turn"}, **options)
        self.plots, self.true = plots["range_m"], plots.truth[..., 0]

    def __call__(self, plots):
        nearest = np.abs(plots["range_m"][:, None, 0] - self.plots[None, :, 0]).argmin(1)
        known = self.plots[nearest, :1] == plots["range_m"][:, :1]
        return np.where(known, self.true[nearest] + 1, plots["range_m"])


def test_a_filter_that_has_learned_the_judged_realisations_is_said_in_the_first_sentence():
    result = judged(Learned(), realisations=300, overrides={"target": "turn"})
    assert result.answer[0].startswith(
        "“mine” seems to have been trained on these realisations: on other noise its RMS error is "
    )
    assert 'purpose="training"' in result.warnings[0]
    sound = judged(Learned(purpose="training"), realisations=300, overrides={"target": "turn"})
    assert sound.warnings == []
    assert sound.answer[0].startswith("“mine” is ")


MEMO = """
import numpy as np
import radarsim

plots = radarsim.plots("rls2", n=200)
true = {float(z): x for z, x in zip(plots["range_m"][:, 0], plots.truth[..., 0])}


def memo(plots):
    found = [true.get(float(z[0]), z) for z in plots["range_m"]]
    return np.array(found) + 1
"""


def test_a_stored_run_keeps_the_warning_on_training(tmp_path):
    (tmp_path / "memo.py").write_text(MEMO)
    filters = "filters: [{name: r, observes: [range], manoeuvre_variance: 1e-3}, {name: memo, python: 'memo.py:memo'}]"
    (tmp_path / "mine.yaml").write_text(f"include: [rls2]\n{filters}\nrealisations: 300\n")
    ran = radarsim.run(tmp_path / "mine.yaml", out=tmp_path / "results", figures=False, threads=1)
    stored = radarsim.load(tmp_path / "mine.yaml", out=tmp_path / "results")
    assert ran.answer[0].startswith("“memo” seems to have been trained on these realisations")
    assert stored.answer == ran.answer
    assert any('purpose="training"' in line for line in stored.warnings)


def test_some_learned_realisations_of_256_are_noticed_and_chance_is_not():
    rng = np.random.default_rng(1)
    here, there = rng.gamma(2, size=(2, 300, 256))
    assert not any(map(filter_checks._is_smaller_beyond_chance, here, there))
    for learned, factor in ((25, 0.001), (40, 0.05), (60, 0.1)):
        here[:50, :learned] = factor * rng.gamma(2, size=(50, learned))
        assert np.mean([*map(filter_checks._is_smaller_beyond_chance, here[:50], there[:50])]) > 0.8


def test_a_filter_that_fails_on_other_noise_is_judged_and_said():
    plots = radarsim.plots("rls2", n=300)
    known = {float(z): x for z, x in zip(plots["range_m"][:, 0], plots.truth[..., 0], strict=True)}
    result = judged(lambda p: np.array([known[float(z)] + 1 for z in p["range_m"][:, 0]]), realisations=300)
    assert "mine: fails on noise of another seed (KeyError: " in result.warnings[-1]
    assert result.answer[0].startswith("“mine” seems to have been trained on these realisations")


def test_a_filter_that_cannot_take_equal_plots_is_judged():
    def whitened(plots):
        x = plots["range_m"]
        return x + 1e6 * np.linalg.inv(np.cov(x[:, 2:4].T))[0, 0]

    assert "depend on the others in the batch" in judged(whitened, realisations=300).warnings[0]


def test_plots_for_training_are_of_the_same_world_and_another_seed():
    plots, training = (radarsim.plots("rls2", n=20, purpose=purpose) for purpose in ("judging", "training"))
    assert plots.seed != training.seed
    assert np.array_equal(plots.truth, training.truth)  # of a target that is not drawn
    assert not (plots["range_m"] == training["range_m"]).any()
    with pytest.raises(radarsim.ConfigError, match="purpose: must be judging or training"):
        radarsim.plots("rls2", n=20, purpose="test")


class Bootstrap:
    """A bootstrap particle filter of range and velocity, with systematic resampling."""

    particles = 40

    def start(self, world):
        self.x = None

    def step(self, plots):
        z, v = plots["range_m"], plots["velocity_mps"]
        w = plots.normals((2, self.particles))
        if self.x is None:
            self.x = np.stack([z[:, None] + 250 * w[:, 0], v[:, None] + 15 * w[:, 1]])
        else:
            dt = plots.t_s - self.t_s
            speed = self.x[1] + 15 * w[:, 1]
            self.x = np.stack([self.x[0] + dt * (self.x[1] + speed) / 2 + 60 * w[:, 0], speed])
            score = -(((z[:, None] - self.x[0]) / 250) ** 2 + ((v[:, None] - self.x[1]) / 15) ** 2) / 2
            weight = np.exp(score - score.max(1, keepdims=True))
            weight /= weight.sum(1, keepdims=True)
            estimate = (weight * self.x[0]).sum(1)
            steps = (np.arange(self.particles) + plots.uniforms(1)) / self.particles
            total = np.cumsum(weight, axis=1)
            total[:, -1] = 1.0
            rows = np.arange(plots.n)[:, None]
            flat = np.searchsorted((total + rows).ravel(), (steps + rows).ravel()).reshape(steps.shape)
            chosen = np.clip(flat - rows * self.particles, 0, self.particles - 1)
            self.x = np.take_along_axis(self.x, chosen[None], axis=2)
            self.t_s = plots.t_s
            return estimate[:, None]
        self.t_s = plots.t_s
        return self.x[0].mean(1, keepdims=True)


@pytest.mark.slow
def test_intervals_of_a_particle_filter_hold_the_truth_in_95_percent_of_200_seeds():
    """Two blocks of realisations each, σ at the last scan; the truth is the mean square over all seeds."""
    rows = [
        judged(Bootstrap, realisations=BLOCK + 904, seed=seed, overrides={"scans": 5}).curves.query(
            "filter == 'mine' and k in [2, 3, 4, 5]"
        )
        for seed in range(200)
    ]
    sigma, low, high = (
        np.array([row[name] for row in rows], dtype=float) for name in ("sigma", "sigma_lo", "sigma_hi")
    )
    truth = np.sqrt(np.mean(sigma**2, axis=0))
    covered = ((low <= truth) & (truth <= high)).mean(axis=0)
    assert 0.93 <= covered[-1] <= 0.97, covered
    assert 0.93 <= covered.mean() <= 0.97, covered
