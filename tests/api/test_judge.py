"""A filter from outside beside the config's: what its numbers are, and what is refused or said of it."""

import json
import re
import tracemalloc
from dataclasses import replace

import numba
import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

import radarsim
from radarsim.api import case_results, judge
from radarsim.api.case_work import CaseWork
from radarsim.api.configs import load
from radarsim.api.estimate_time import time_warnings
from radarsim.api.result_content import case_figures
from radarsim.cli.command_group import main
from radarsim.engine.collect import collect
from radarsim.errors import ConfigError
from radarsim.language.current import use_language
from radarsim.language.translate import tr
from radarsim.report import interval_notes
from radarsim.report import tables as common
from radarsim.report.drawing.model import Line
from radarsim.report.user_filters import tables as user_filters_tables
from radarsim.report.user_filters.tables import ROUNDING
from radarsim.studies import registry
from radarsim.studies.multimodel import study as flight
from radarsim.studies.user_filters import sums
from tests.studies.range_doppler import naive
from tests.tolerances import assert_rounded, recursion_rounding, rounding, sigma_error


class Twin:
    """The filter r+Vr of rls2, of many realisations at once, by the textbook."""

    def start(self, world):
        self.dt, self.plots = world.t_s[1] - world.t_s[0], []
        self.variance = world.keys["filters"][1]["manoeuvre_variance"]
        self.R = np.diag([world.sigma["range_m"] ** 2, world.sigma["velocity_mps"] ** 2])
        self.H = naive.observation(2)

    def step(self, plots):
        z = np.stack([plots["range_m"], plots["velocity_mps"]], axis=-1)
        self.plots.append(z)
        none = np.full((len(z), 3, 3), np.nan)
        if len(self.plots) == 1:
            return np.hstack([z, none[:, :1, 0]]), none
        if len(self.plots) == 2:
            arguments = 2, 2, np.sqrt(np.diag(self.R)), self.dt
            units = [naive.start(unit, *arguments) for unit in np.eye(4).reshape(4, 2, 2)]  # it is linear in the plots
            self.x, self.P = np.hstack(self.plots) @ np.array([x for x, _ in units]), units[0][1]
        else:
            B = naive.transition(self.dt)
            P = B @ self.P @ B.T + naive.manoeuvre(self.variance, self.dt)
            K = P @ self.H.T @ np.linalg.inv(self.H @ P @ self.H.T + self.R)
            x = self.x @ B.T
            self.x, self.P = x + (z - x @ self.H.T) @ K.T, P - K @ self.H @ P
        return self.x, np.broadcast_to(self.P, none.shape)


def twin(plots):
    """The same as a function of all plots, without covariances."""
    filter_ = Twin()
    filter_.start(plots.world)
    columns = (
        dict(zip(plots.columns, scan, strict=True)) for scan in zip(*(c.T for c in plots.columns.values()), strict=True)
    )
    return np.stack([filter_.step(one)[0] for one in columns], axis=1)


@pytest.fixture(scope="module")
def plain():
    return radarsim.run("rls2", realisations=3000)


@pytest.fixture(scope="module")
def judged():
    return radarsim.judge("rls2", Twin, realisations=3000)


@pytest.fixture(scope="module")
def estimates():
    return twins(300)


def twins(n):
    plan = CaseWork(judge.add_user_filter(load("rls2"), twin, "mine", realisations=n)[0].cases[0]).plans[-1]
    return twin(sums.plots_of(plan, radarsim.plots("rls2", n=n)))


# A twin's errors are differences of ranges of up to 104 km, ten operations a scan, in σ of a plot.
TWIN = rounding(104e3 / 250, 10 * 15)


def of(table, **values):
    for name, value in values.items():
        table = table[table[name] == value]
    return table.reset_index(drop=True)


def test_a_twin_has_the_runs_numbers(judged):
    mine, theirs = (of(judged.curves, filter=name) for name in ("mine", "r+Vr"))
    for column in ("sigma", "sigma_lo", "sigma_hi", "spread", "n"):
        np.testing.assert_allclose(mine[column], theirs[column], rtol=TWIN)
    assert ((mine["bias"] - theirs["bias"]).abs() < TWIN * theirs["sigma"]).all()


def test_a_twin_gains_nothing_and_its_intervals_hold_it(judged):
    gains = of(judged.gains, filter="mine", baseline="r+Vr")
    assert len(gains) == 44
    assert (gains["gain_lo"] < 0).all()
    assert (gains["gain_hi"] > 0).all()
    assert (gains["gain_percent"].abs() < 100 * TWIN).all()
    assert "“mine” is equal to r+Vr" in judged.answer[0]


def test_gains_are_against_every_filter_and_paired(judged, plain):
    """Against r a twin gains what r+Vr does, with its interval, which common noise makes narrow."""
    mine, theirs = (of(judged.gains, filter=name, baseline="r") for name in ("mine", "r+Vr"))
    both = mine.merge(theirs, on=["component", "k"])
    assert len(both) == len(theirs)
    for end in ("gain_percent", "gain_lo", "gain_hi"):  # intervals are widened by the rounding of a gain of nothing
        allowed = 2 * 100 * TWIN + (end != "gain_percent") * ROUNDING
        np.testing.assert_allclose(both[f"{end}_x"], both[f"{end}_y"], rtol=0, atol=allowed)


def test_the_studys_own_tables_are_those_of_a_plain_run(judged, plain):
    for name, table in plain.tables.items():
        own = judged.tables[name]
        own = own[own["filter"] != "mine"] if "filter" in own else own
        assert own[list(table)].equals(table), name


def test_nees_is_that_of_the_run(judged):
    mine = judged.tables["nees"].merge(of(judged.tables["consistency"], filter="r+Vr"), on="k")
    assert len(mine) == 14
    np.testing.assert_allclose(mine["nees_x"], mine["nees_y"], rtol=2 * TWIN + recursion_rounding())
    for end in ("nees_bound_lo", "nees_bound_hi"):  # for the same realisations, scan and components
        np.testing.assert_allclose(mine[f"{end}_x"], mine[f"{end}_y"], rtol=1e-12)
    (panel,) = case_figures(judged.cases, judged.tables, judged.experiment)["consistency"].panels
    own, theirs = (
        {mark.label: mark.y for mark in panel.marks if isinstance(mark, Line)}[name] for name in ("mine", "r+Vr")
    )
    np.testing.assert_allclose(own, theirs[-14:], rtol=2 * TWIN + recursion_rounding())


# ---- what is refused -------------------------------------------------------------------------------------------------
def tried(given, name="mine", **more):
    """What the checks say of estimates."""
    return judge.add_user_filter(load("rls2"), given, name, **more)[1]


def refusal(given, **more):
    with pytest.raises(ConfigError) as error:
        tried(given, **more)
    return "\n".join(error.value.lines)


def test_right_estimates_are_taken_without_a_word(estimates):
    assert tried(estimates) == []
    assert tried(estimates[..., :1]) == []
    assert tried(estimates[..., 0]) == []
    assert tried(twin, realisations=100) == []
    assert tried(Twin, realisations=100) == []


def test_other_shapes_are_refused_with_the_right_one(estimates):
    assert "(n, K, d) = (256, 15, 1 … 3), got (256, 14, 3)" in refusal(estimates[:, 1:])
    turned = refusal(lambda plots: twin(plots).transpose(1, 0, 2), realisations=100)
    assert "transpose(1, 0, 2)" in turned
    assert "covariances must have shape (256, 15, 3, 3)" in refusal((estimates, np.zeros((300, 15, 3))))
    assert "an array (n, K, d), a function, an iterator or a file" in refusal(["estimates"])
    assert "real numbers, got complex128" in refusal(lambda plots: twin(plots) + 0j, realisations=100)
    assert "fewer than 301" in refusal(estimates, realisations=301)


def test_estimates_in_another_order_are_found_by_their_errors(estimates):
    """Components and scans by the order with small errors; realisations by errors unlike those of the filters."""
    assert "components in the order Vr, r, ar" in refusal(estimates[..., [1, 0, 2]])
    assert "components in the order ar, Vr, r" in refusal(estimates[..., [2, 1, 0]])
    assert "scans from the last to the first" in refusal(estimates[:, ::-1])
    shuffled = np.random.default_rng(1).permutation(len(estimates))
    for other in (estimates[shuffled], np.roll(estimates, 1, axis=0), estimates[::-1]):
        assert "have nothing in common" in refusal(other)


def test_estimates_of_another_seed_are_refused(estimates):
    with pytest.raises(ConfigError, match="another seed than 5"):
        radarsim.judge("rls2", estimates, seed=5)


def test_half_of_the_realisations_shifted_are_still_those_of_the_plots(estimates):
    """The test is of a wrong order, not of a bad filter: one that follows the plots but poorly is judged."""
    noisy = estimates + np.random.default_rng(2).normal(0, 400, estimates.shape) * [1, 0.1, 0.01]
    assert tried(noisy) == []


@pytest.mark.parametrize("components", [1, 2, 3])
def test_estimates_of_another_scan_are_found_by_the_truth_of_that_scan(estimates, components):
    moved = np.full_like(estimates, np.nan)
    moved[:, 1:] = estimates[:, :-1]
    (late,) = tried(moved[..., :components])
    assert "fit the truth of 1 scan earlier" in late
    moved = np.full_like(estimates, np.nan)
    moved[:, :-2] = estimates[:, 2:]
    (early,) = tried(moved[..., :components])
    assert "fit the truth of 2 scans later" in early


@pytest.mark.parametrize("components", [1, 2, 3])
def test_estimates_from_before_the_plot_owe_nothing_to_it(estimates, components):
    predicted = np.full_like(estimates, np.nan)
    predicted[:, 1:] = estimates[:, :-1] @ naive.transition(10.0).T
    (line,) = tried(predicted[..., :components])
    assert "owe nothing to the plot of their scan" in line
    assert tried(estimates[..., :components]) == []


@pytest.mark.parametrize("components", [(0,), (1,), (0, 1)])
@pytest.mark.parametrize(("alpha", "beta"), [(0.2, 0.02), (0.5, 0.17), (0.7, 0.4), (1.0, 0.5)])
def test_a_filter_that_lags_behind_is_not_called_late(components, alpha, beta):
    """Alpha-beta filters over a target that accelerates: their speed is nearly that of one or two scans before."""
    plots = radarsim.plots("rls2", n=300, overrides=["scans=60"])
    z, dt = plots["range_m"], 10.0
    x, v = z[:, 1], (z[:, 1] - z[:, 0]) / dt
    rows = [np.full((300, 2), np.nan), np.stack([x, v], axis=-1)]
    for k in range(2, 60):
        residual = z[:, k] - (x + v * dt)
        x, v = x + v * dt + alpha * residual, v + beta / dt * residual
        rows.append(np.stack([x, v], axis=-1))
    estimates, truth = np.stack(rows, axis=1)[..., components], plots.truth[..., components]
    measured = np.stack([plots["range_m"], plots["velocity_mps"]], axis=-1)
    assert time_warnings("mine", estimates, truth, measured) == []
    late = np.concatenate([np.full_like(estimates[:, :1], np.nan), estimates[:, :-1]], axis=1)
    assert len(time_warnings("mine", late, truth, measured)) == 1


def test_estimates_for_half_a_scan_later_are_recognised():
    rng = np.random.default_rng(8)
    truth = np.stack([1e5 - 250 * 10.0 * np.arange(20), np.full(20, -250.0)], axis=-1)[None] + np.zeros((200, 1, 1))
    noise = rng.normal(0, 1, (200, 20, 2)) * [50, 5]
    early = truth + noise + np.stack([5 * truth[..., 1], 0 * truth[..., 1]], axis=-1)
    (line,) = time_warnings("mine", early[..., :1], truth[..., :1], noise)
    assert "fit the truth of half a scan later" in line


def test_predictions_of_random_targets_are_recognised():
    """What realisations differ in by their truth is no error of a plot."""
    rng = np.random.default_rng(8)
    speed, noise = rng.normal(0, 300, (400, 1)), rng.normal(0, 50, (400, 12))
    truth = (1e5 + 10 * speed * np.arange(12))[..., None]
    plots = truth + noise[..., None]
    estimates = truth + 0.4 * noise[..., None]
    assert time_warnings("mine", estimates, truth, plots) == []
    predictions = np.concatenate([estimates[:, :1], estimates[:, :-1] + 10 * speed[..., None]], axis=1)
    (line,) = time_warnings("mine", predictions, truth, plots)
    assert "owe nothing to the plot of their scan" in line


def test_names_are_those_of_no_other_filter(estimates):
    assert "there is a filter 'r+Vr' already" in refusal(estimates, name="r+Vr")
    assert refusal(estimates, name="../mine") == "name: must be no path, got '../mine'"
    assert refusal(estimates, name="=1").startswith("name: must not begin with = + - or @")
    assert refusal(estimates, name=" ").startswith("name: must be printable text")


def test_values_in_another_unit_or_of_the_other_sign_are_found(estimates):
    assert "estimates of r must be in m, with the sign of the truth: multiplied by 1000 " in refusal(
        estimates[..., 0] / 1e3
    )
    assert "of Vr must be in m/s, with the sign of the truth: multiplied by -1 " in refusal(estimates * [1, -1, 1])
    for factor in (3.6, 3600 / 1852, 1 / 0.3048):
        expected = f"of Vr must be in m/s, with the sign of the truth: multiplied by {1 / factor:.4g} "
        assert expected in refusal(estimates * [1, factor, 1])


def test_masked_values_are_no_estimates(estimates):
    masked = np.ma.array(estimates, mask=np.zeros_like(estimates, bool))
    masked[:, :4] = np.ma.masked
    found, wanted = (radarsim.judge("rls2", x) for x in (masked, np.ma.filled(masked, np.nan)))
    assert same(found, wanted)
    assert of(found.curves, filter="mine")["k"].min() == 5


class Odd:
    """A filter of which a test changes a part."""

    def start(self, world):
        self.k = 0

    def step(self, plots):
        self.k += 1
        return np.stack([plots["range_m"], plots["velocity_mps"]][: 1 + (self.k > 3)], axis=1)


def test_filters_of_the_config_that_are_equal_are_all_named(tmp_path):
    filters = ", ".join(f"{{name: {name}, observes: [range], manoeuvre_variance: 1e-3}}" for name in ("one", "two"))
    (tmp_path / "twins.yaml").write_text(f"include: [rls2]\nfilters: [{filters}]\n")
    result = radarsim.judge(tmp_path / "twins.yaml", lambda plots: plots["range_m"], realisations=200)
    assert result.answer[0].startswith("“mine” is worse than “one” (equal to “two”), the config's best in r at 140 s")
    assert not any("against two" in sentence for sentence in result.answer)


@numba.njit
def compiled(z, v):
    return z


def test_a_compiled_function_is_refused_with_the_function_to_write():
    cure = r"def my_filter\(plots\): return compiled\(plots\['range_m'\], plots\['velocity_mps'\]\)"
    assert re.search(cure, refusal(compiled))
    assert "is a compiled function" in refusal(np.abs)
    assert len(radarsim.judge("rls2", lambda plots: compiled(plots["range_m"], 0), realisations=20).answer)


def test_what_a_filter_may_not_give_is_said_with_its_place():
    assert refusal(Odd) == "mine: estimates must have one shape, got (256, 1) at 0 s and (256, 2) at 30 s"
    for given, got in ((None, "NoneType"), (np.zeros((3, 1)), "shape (3, 1)")):
        odd = type("Given", (Odd,), {"step": lambda self, plots, given=given: given})
        assert refusal(odd) == f"mine: step must give estimates (n, d) of n = 256 realisations, got {got}"
    halves = refusal(lambda plots: plots["range_m"][plots.first % 2 :], one_by_one=True)
    assert halves == "mine: estimates must have one shape, got (15,) at realisation 0 and (14,) at realisation 1"
    named = type(
        "Named",
        (Odd,),
        {"start": lambda self, world: None, "__init__": lambda self: setattr(self, "components", ["Vr"])},
    )
    assert refusal(named) == "mine: components must be an attribute of the class itself, not of its objects"
    assert "components: must differ, got r, r" in refusal(
        lambda plots: np.zeros((plots.n, 15, 2)), components=("r", "r")
    )
    for odd_class in (type("Half", (), {"step": Odd.step}), type("Neither", (), {})):
        assert "must have start(world) and step(plots)" in refusal(odd_class)
    assert refusal([[1.0, 2.0], [3.0]]).endswith("or a file, got [[1.0, 2.0], [3.0]]")
    for none in (np.full((1, 1), "a"), np.ones((1, 1)) * 1j):
        given = refusal(lambda plots, none=none: (plots["range_m"], np.broadcast_to(none, (plots.n, 15, 1, 1))))
        assert given.startswith("mine: covariances must be real numbers, got ")


def test_a_filter_changes_nothing_outside_itself():
    """Neither times and keys of the next block, nor what NumPy does with not-a-number."""

    class Careless(Twin):
        def start(self, world):
            super().start(world)
            np.seterr(all="raise")
            world.t_s[:] = 0
            world.keys.clear()

    found = radarsim.judge("rls2", Careless, realisations=5000, threads=0)
    assert same(found, radarsim.judge("rls2", Twin, realisations=5000, threads=0))
    assert np.geterr()["invalid"] == "warn"


def test_named_components_are_taken_in_their_order(estimates):
    swapped = radarsim.judge("rls2", estimates[..., [1, 0]], components=("Vr", "r"), realisations=200)
    mine = radarsim.judge("rls2", estimates, realisations=200)
    shared = mine.curves["component"].isin(["r", "Vr"])
    assert of(swapped.curves, filter="mine").equals(of(mine.curves[shared], filter="mine"))
    assert "must be of r, Vr, ar, got x" in refusal(estimates[..., :1], components=("x",))
    velocity = radarsim.judge("rls2", estimates[..., 1], components="Vr", realisations=200)
    assert of(velocity.curves, filter="mine").equals(of(mine.curves, filter="mine", component="Vr"))


# ---- what is said ----------------------------------------------------------------------------------------------------
def test_single_precision_is_said():
    (line,) = tried(lambda plots: twin(plots).astype(np.float32), realisations=100)
    assert "estimates are float32, rounded by up to" in line


def test_looking_ahead_is_said():
    def smoothed(plots):
        x = twin(plots)
        x[:, :-1, 0] = (x[:, :-1, 0] + x[:, 1:, 0]) / 2
        return x

    (line,) = tried(smoothed, realisations=100)
    assert "uses later plots: its estimates up to scan 7" in line


def test_other_estimates_of_the_same_plots_are_said():
    noise = np.random.default_rng(3)
    (line,) = tried(lambda plots: twin(plots) + noise.normal(0, 30, (plots.n, 15, 3)), realisations=100)
    assert "other estimates for the same plots when called again" in line


def test_realisations_that_depend_on_each_other_are_said():
    def whitened(plots):
        x = twin(plots)
        return x + 0.1 * (x - x.mean(axis=0))

    def beside(i):
        return lambda plots: plots["range_m"] + 0.1 * (plots["range_m"] - plots["range_m"][i])

    for one in (whitened, beside(0), beside(-1)):
        (line,) = tried(one, realisations=100)
        assert "depend on the others in the batch" in line


def test_a_filter_that_changes_the_plots_is_said_and_changes_nothing(judged):
    def careless(plots):
        x = twin(plots)
        for column in plots.columns.values():
            column[:] = 0
        return x

    result = radarsim.judge("rls2", careless, realisations=3000)
    assert result.warnings[0] == "mine: changes the plots it is given; it gets copies"
    assert of(result.curves, filter="mine").equals(of(judged.curves, filter="mine"))


# ---- failures --------------------------------------------------------------------------------------------------------
def test_failures_are_counted_and_sigma_is_of_the_others(estimates):
    """Of 300 realisations 3 end in not-a-number, 2 in infinity, 4 diverge, 1 has no estimate."""
    x = estimates.copy()
    x[:3, 9:] = np.nan
    x[3:5, 14, 2] = np.inf
    x[5:9, 12] += 1e6
    x[9] = np.nan
    result = radarsim.judge("rls2", x)
    counted = dict(result.tables["failures"][["reason", "failed"]].itertuples(index=False))
    assert counted == {"any": 10, "not_a_number": 5, "no_estimate": 1, "diverged": 4}
    assert result.answer[0].startswith("“mine” fails in 3.33 % [")
    how = result.answer[0].split("), and in the others ")[1]
    assert how.startswith(
        "“mine” is equal to r+Vr, the config's best in r at 140 s, identical in all 290 realisations: a difference in "
    )
    mine = of(result.curves, filter="mine")
    assert set(mine["n"]) == {290}
    last = mine[(mine["component"] == "r") & (mine["k"] == 15)].iloc[0]
    truth = radarsim.plots("rls2", n=300).truth[10:, 14, 0]
    assert_rounded(last["sigma"], np.sqrt(np.mean((estimates[10:, 14, 0] - truth) ** 2)), operations=290)
    nil = of(result.gains, filter="mine", baseline="r+Vr")
    assert (nil["gain_percent"].abs() < 100 * TWIN).all()


def test_of_equal_filters_the_first_is_the_best_and_one_realisation_tells_nothing():
    keys = [{"name": name, "observes": ["range"], "manoeuvre_variance": 1e-3} for name in "cab"]
    said = radarsim.judge("rls2", held, realisations=1, overrides={"filters": keys}).answer[0]
    assert re.match(
        r"“mine” cannot be distinguished from c \(equal to a and b\), the config's best in r at 140 s: "
        r"gain \S+ % \[−∞, 100\]",
        said,
    )


def test_a_filter_that_starts_late_does_not_fail(estimates):
    x = estimates.copy()
    x[:, :5] = np.nan
    result = radarsim.judge("rls2", x)
    assert result.tables["failures"]["failed"].sum() == 0
    assert of(result.curves, filter="mine")["k"].min() == 6


def test_a_filter_that_always_fails_is_not_compared(estimates):
    result = radarsim.judge("rls2", np.where(np.arange(15)[:, None] > 7, np.nan, estimates))
    assert result.answer[0].startswith("“mine” fails in 100 % [")
    assert not len(of(result.curves, filter="mine"))


@pytest.mark.slow
def test_a_covariance_that_is_none_does_not_enter_nees(estimates):
    P = np.broadcast_to(np.diag([250.0**2, 15.0**2, 1.0]), (300, 15, 3, 3)).copy()
    P[:30, 14, 0, 0] = -1
    P[30:40, 14, 0, 1] = 1e3  # not symmetric
    result = radarsim.judge("rls2", (estimates, P))
    assert of(result.tables["nees"], k=15)["n"].tolist() == [260]
    assert of(result.tables["nees"], k=14)["n"].tolist() == [300]
    assert of(result.tables["failures"], reason="not_positive_definite")["failed"].tolist() == [40]
    assert of(result.tables["failures"], reason="any")["failed"].tolist() == [0]
    assert any(line.startswith("In 40 of 300 realisations “mine” gives a covariance") for line in result.answer)
    none = radarsim.judge("rls2", (estimates, -P)).answer
    assert any(line.startswith("In 300 of 300 realisations “mine” gives a covariance") for line in none)


def test_below_the_floor_it_is_said_why(estimates):
    truth = radarsim.plots("rls2", n=300).truth
    answer = radarsim.judge("rls2", (estimates + 3 * truth) / 4).answer
    found = next(line for line in answer if line.startswith("There the "))
    assert re.search(r"“mine” is 7\d\.?\d* % \[[^]]*\] below it;", found)
    perfect = radarsim.judge("rls2", truth).answer[0]
    assert perfect.startswith(
        "“mine” is better than r+Vr, the config's best in r at 140 s: gain 100 % [100, 100]; its RMS error is 0 "
    )
    assert found.endswith("Only a biased estimator, or one with extra information, can lie below it.")


# ---- other sources ---------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def mine(estimates):
    return radarsim.judge("rls2", estimates)


def same(result, mine):
    """Whether the filter has the same numbers, and the config's too."""
    return all(result.tables[name].equals(mine.tables[name]) for name in ("curves", "gains", "failures"))


def test_chunks_of_any_length_are_the_whole(estimates, mine):
    for size in (1, 77, 300, 1000):
        chunks = (estimates[i : i + size] for i in range(0, 300, size))
        assert same(radarsim.judge("rls2", chunks, realisations=300), mine), size


def test_chunks_over_several_blocks_and_looks(plain):
    """With a precision realisations are looked at 2000 and 4000, 4096 a block: those of a block are asked for again."""
    whole = twin_of(0, 9000)
    plots = (whole[first : first + 500] for first in range(0, 9000, 500))
    result = radarsim.judge("rls2", plots, realisations=9000, precision=5)
    assert result.cases[0].count == 9000
    assert set(of(result.curves, filter="mine", component="ar")["n"]) == {9000}


def twin_of(first, count):
    plan = CaseWork(judge.add_user_filter(load("rls2"), twin, "mine", realisations=100)[0].cases[0]).plans[-1]
    return twin(sums.plots_of(plan, plan.draw(first, count)))


@pytest.mark.slow
def test_threads_change_no_number():
    one, two = (radarsim.judge("rls2", Twin, realisations=9000, threads=threads).tables for threads in (1, 2))
    assert all(one[name].equals(two[name]) for name in one)


def test_a_filter_stands_beside_that_of_the_config(tmp_path, monkeypatch):
    """One of Python in the config, and one that is judged: each is compared with all before it."""
    monkeypatch.chdir(tmp_path)
    own = "class Raw:\n    def start(self, world): pass\n    def step(self, plots): return plots['range_m'][:, None]\n"
    (tmp_path / "own.py").write_text(own)
    keys = [{"name": "r", "observes": ["range"], "manoeuvre_variance": 1e-3}, {"name": "raw", "python": "own.py:Raw"}]
    result = radarsim.judge("rls2", held, realisations=300, overrides={"filters": keys})
    assert set(of(result.gains, filter="mine")["baseline"]) == {"r", "raw"}
    assert (of(result.gains, filter="mine", baseline="raw")["gain_percent"] == 0).all()
    assert result.question == "Are “raw” and “mine” better than the filters of the config?"


def test_an_iterator_that_gives_less_or_something_else_is_refused(estimates):
    def said(*chunks):
        with pytest.raises(ConfigError) as error:
            radarsim.judge("rls2", iter(chunks), realisations=301, figures=False)
        return str(error.value)

    assert said(estimates) == "mine: must give 301 realisations, ended after 300; realisations=300 takes these"
    assert said(estimates, estimates[..., :2]) == "mine: chunks must hold the same components, got 3 and then 2"
    assert said(3).endswith("must have shape (n, K, d) = (0, 15, 1 … 3), got ()")
    assert said((estimates, np.ones((299, 15, 3, 3)))).endswith("(300, 15, 3, 3), got (299, 15, 3, 3)")


def test_chunks_with_and_without_covariances_keep_those_that_are_there(estimates):
    P = np.broadcast_to(np.diag([250.0, 15.0, 1.0]) ** 2, (100, 15, 3, 3))
    chunks = (estimates[:100], P), estimates[100:200], [estimates[200:], P]  # a list of two arrays is a pair too
    assert set(radarsim.judge("rls2", iter(chunks), realisations=300).tables["nees"]["n"]) == {200}


@pytest.mark.slow
def test_a_function_of_one_realisation(mine):
    def one(plots):
        columns = {name: column[None] for name, column in plots.columns.items()}
        return twin(replace(plots, columns=columns))[0]

    result = radarsim.judge("rls2", one, one_by_one=True, realisations=300)
    for name, column in (("curves", "sigma"), ("gains", "gain_hi")):  # products of matrices of another size
        np.testing.assert_allclose(result.tables[name][column], mine.tables[name][column], rtol=TWIN, atol=ROUNDING)


def test_plots_lie_in_memory_as_c_code_takes_them():
    seen = []
    for alone in (False, True):
        look = lambda plots: seen.append(plots) or plots["range_m"]  # noqa: E731
        radarsim.judge("rls2", look, one_by_one=alone, realisations=10)
    assert all(one[name].flags.c_contiguous for one in seen for name in one.columns)
    assert {one["range_m"].ndim for one in seen} == {1, 2}


def test_a_filter_may_give_its_own_state_and_go_on_to_change_it():
    class Mean:
        def start(self, world):
            self.x, self.k = None, 0

        def step(self, plots):
            self.k += 1
            self.x = np.zeros((plots.n, 1)) if self.x is None else self.x
            self.x += (plots["range_m"][:, None] - self.x) / self.k
            return self.x

    def mean(plots):
        return np.cumsum(plots["range_m"], axis=1) / np.arange(1, 16)

    stepped, whole = (radarsim.judge("rls2", one, realisations=300).curves["sigma"] for one in (Mean, mean))
    # Sums of 15 ranges, by steps of three operations.
    np.testing.assert_allclose(stepped, whole, rtol=rounding(104e3 / whole.min(), 4 * 15))


def test_versions_of_a_filter_are_compared_on_the_same_noise(mine):
    better = radarsim.judge("rls2", Twin, realisations=300)
    table = radarsim.compare({"one": mine, "two": better}).table
    assert set(table.query("quantity == 'sigma' and filter == 'mine'")["pairing"]) == {"same numbers"}


def test_files_hold_what_arrays_do(estimates, mine, tmp_path):
    order = np.random.default_rng(4).permutation(300)
    np.savez(tmp_path / "plain.npz", estimates=estimates)
    np.savez(tmp_path / "numbered.npz", estimates=estimates[order], realisations=order, seed=2017)
    i, k = (one.ravel() for one in np.indices((300, 15)))
    state = dict(zip(("r_m", "Vr_mps", "ar"), estimates.reshape(-1, 3).T, strict=True))
    table = pd.DataFrame({"realisation": i, "t_s": 10.0 * k, **state}).sample(frac=1, random_state=1)
    table.to_csv(tmp_path / "table.csv", index=False)
    for name in ("plain.npz", "numbered.npz", "table.csv"):
        assert same(radarsim.judge("rls2", tmp_path / name), mine), name


def test_files_of_other_realisations_are_refused(estimates, tmp_path):
    def said(name, **arrays):
        np.savez(tmp_path / name, **arrays)
        return refusal(tmp_path / name)

    assert "where 0 should be there is 10" in said("late.npz", estimates=estimates, realisations=np.arange(10, 310))
    assert "where 1 should be there is 0" in said("twice.npz", estimates=estimates, realisations=np.arange(300) // 2)
    assert "plots with seed 3; the run has seed 2017" in said("seed.npz", estimates=estimates, seed=3)
    assert "must hold an array `estimates`" in said("none.npz", x=estimates)
    assert "must be 300 numbers" in said("fewer.npz", estimates=estimates, realisations=np.arange(299))
    assert "must end in .npz, .csv or .parquet" in refusal(tmp_path / "estimates.mat")
    assert "cannot be read" in refusal(tmp_path / "nowhere.npz")
    whole = (tmp_path / "late.npz").read_bytes()
    for name, content in (
        ("broken.npz", whole[:3000]),
        ("text.npz", b"x"),
        ("damaged.npz", whole[:900] + b"x" + whole[901:]),
    ):
        (tmp_path / name).write_bytes(content)
        assert "cannot be read" in refusal(tmp_path / name)
    (tmp_path / "words.csv").write_text("realisation,k,r\n0,1,far\n")
    assert refusal(tmp_path / "words.csv").endswith("row 1, r: must be a number, got 'far'")
    (tmp_path / "blank.csv").write_text("realisation, k, r\n0, 1, 5\n0,, 5\n")
    assert refusal(tmp_path / "blank.csv").endswith("row 2, k: has no value")
    for name in ("empty.npz", "empty.csv"):
        (tmp_path / name).write_bytes(b"")
        assert "cannot be read" in refusal(tmp_path / name)
    (tmp_path / "heading.csv").write_text("realisation,k,r\n")
    assert refusal(tmp_path / "heading.csv").endswith("has no rows")
    few = said("covariances.npz", estimates=estimates, covariances=np.zeros((299, 15, 3, 3)))
    assert few == "mine: covariances must be of 300 realisations, as the estimates, got 299"
    for seed in ([1, 2], 2017.5, "one", np.nan):
        assert "; the run has seed 2017" in said("seeds.npz", estimates=estimates, seed=seed)
    assert "must be 300 numbers" in said("words.npz", estimates=estimates, realisation=np.arange(300).astype(str))
    assert "estimates must be an array (n, K, d), got float64 ()" in said("number.npz", estimates=3.0)
    assert "as the estimates, got 3.0" in said("variance.npz", estimates=estimates, covariances=3.0)
    (tmp_path / "plain.npy").write_bytes(b"")
    np.save(tmp_path / "plain.npy", estimates)
    assert "cannot be read" in refusal((tmp_path / "plain.npy").rename(tmp_path / "single.npz"))
    rows = pd.DataFrame({"realisation": [0, 0, 1], "k": [1, 2, 1], "r": 1.0})
    rows.to_csv(tmp_path / "short.csv", index=False)
    assert "realisation 0: must have a row for each of the 15 scans" in refusal(tmp_path / "short.csv")
    rows.assign(k=[0, 1, 1]).to_csv(tmp_path / "zero.csv", index=False)
    assert refusal(tmp_path / "zero.csv").endswith("k: must be one of the 15 scans of the plots, 1 … 15, got 0")
    rows.rename(columns={"k": "t_s"}).to_csv(tmp_path / "times.csv", index=False)
    assert refusal(tmp_path / "times.csv").endswith("t_s: must be one of the 15 scans of the plots, 0 … 140, got 1")
    rows.drop(columns="realisation").to_csv(tmp_path / "unnumbered.csv", index=False)
    assert "must have the columns realisation, k or t_s, and of r, Vr, ar" in refusal(tmp_path / "unnumbered.csv")


def test_the_command_judges_a_file(estimates, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    np.savez("mine.npz", estimates=estimates)
    done = CliRunner().invoke(main, ["judge", "rls2", "mine.npz", "--name", "mine", "--no-figures"])
    assert done.exit_code == 0, done.output
    assert done.output.startswith("“mine” is equal to r+Vr")
    record = json.loads((tmp_path / "results/rls2_mine/run.json").read_text())
    assert record["command"] == "radarsim judge rls2 mine.npz --name mine"
    assert len(record["judged"]["mine"]) == 64
    assert "“mine” is equal to" in (tmp_path / "results/rls2_mine/report.html").read_text()
    again = CliRunner().invoke(main, ["judge", "rls2", "mine.npz", "-n", "301"])
    assert again.exit_code == 2
    assert not (tmp_path / "results/.blocks").exists()


# ---- other studies ---------------------------------------------------------------------------------------------------
def held(plots):
    """The first column, held where a plot is missed: an estimate of the range."""
    z = np.array(next(iter(plots.columns.values())))
    for k in range(1, z.shape[1]):
        z[:, k] = np.where(np.isnan(z[:, k]), z[:, k - 1], z[:, k])
    return z


@pytest.mark.slow_cases("sonar_manoeuvre-overrides2", "sonar_smoothing-overrides1")
@pytest.mark.parametrize(
    ("config", "overrides"),
    [
        ("rls2", {"radar.detection_probability": 0.8}),
        ("sonar_smoothing", {}),
        ("sonar_manoeuvre", {"sweep": {"target.acceleration_mps2": [1]}, "scans": 60, "uses.at_s": [295]}),
        ("ambiguous_rls2", {}),
    ],
)
def test_every_study_with_plots_pairs_each_realisation(config, overrides):
    """The filter's σ is that of its errors against the truth of the plots; the study's tables are those of a run."""
    result = radarsim.judge(config, held, realisations=64, overrides=overrides)
    (case,) = result.cases
    plots = radarsim.plots(config, n=64, overrides=overrides)
    x, scans = held(plots), case.axes.k - 1
    off = x[:, scans] - plots.truth_of(case.axes.components)[:, scans, 0]
    mine = of(result.curves, filter="mine", component=case.axes.components[0][0])
    np.testing.assert_allclose(
        mine["sigma"], np.sqrt(np.nanmean(off**2, axis=0))[mine["k"] - case.axes.k[0]], rtol=rounding(operations=64)
    )
    assert set(of(result.gains, filter="mine")["baseline"]) == set(case.axes.filters)
    plain = radarsim.run(config, realisations=64, overrides=overrides)
    for name in plain.tables.keys() - {"claims"}:  # these say what they lack of a shipped config by its name
        own, table = result.tables[name], plain.tables[name]
        own = own[own["filter"] != "mine"] if "filter" in own else own
        assert own[list(table)].equals(table), name


def test_studies_without_paired_plots_are_refused_with_the_reason():
    for config, why in (("discriminator", "draws no plots"), ("sonar_clutter", "trackers find tracks of their own")):
        with pytest.raises(ConfigError, match=why):
            radarsim.judge(config, held, realisations=64)
    with pytest.raises(ConfigError, match=r"belong to one case, and there are 4: choose of sensor\.detection_prob"):
        radarsim.judge("sonar_missed", np.zeros((64, 20, 2)))


# ---- a planted loss --------------------------------------------------------------------------------------------------
LOSS = 0.02  # of σ, by independent noise of √(1.02² − 1) σ beside the twin's errors
NOISE = np.sqrt((1 + LOSS) ** 2 - 1)
SPREAD = np.sqrt(1 - 1 / (1 + LOSS) ** 2)  # of ln σ/σ_base, times √n: √(1 − ρ²), ρ the correlation of the two errors


class Worse:
    """The config's r+Vr, of which only errors are needed, with 2 % of loss in every component at every scan."""

    def __init__(self, n, seed):
        plan = plan_of(seed)
        drawn = plan.draw(0, n)
        truth = drawn.truth_of(plan.axes.components)
        error = sums.inner_errors(plan, 0, n)[1]
        noise = np.random.default_rng(seed).normal(size=error.shape)
        self.estimates = truth + error + NOISE * np.nan_to_num(plan.inner.axes.exact_sigma[1]) * noise


def plan_of(seed):
    experiment, _ = judge.add_user_filter(load("rls2", [f"seed={seed}"]), twin, "mine", realisations=10)
    return CaseWork(experiment.cases[0]).plans[-1]


def gains_of(n, seed):
    result = radarsim.judge("rls2", Worse(n, seed).estimates, seed=seed)
    return result, of(result.gains, filter="mine", baseline="r+Vr")


def test_a_planted_loss_is_known_as_well_as_theory_says():
    """The half-width of the gain is 1.96·1.02·√(1 − ρ²)/√n; unpaired it were five times that.

    e² − e_base² is a product of normal numbers, of kurtosis 9."""
    n = 2000
    result, gains = gains_of(n, 1)
    theirs = 1.96 * 100 * (1 + LOSS) * SPREAD / np.sqrt(n)
    mine = (gains["gain_hi"] - gains["gain_lo"]) / 2
    np.testing.assert_allclose(mine, theirs, rtol=sigma_error(n, kurtosis=9, z=4))
    assert "“mine” is worse than r+Vr" in result.answer[0]


@pytest.mark.slow_cases("500")
@pytest.mark.parametrize("every", [1, 500])
def test_rare_differences_are_said_to_decide_where_they_are_rare(every):
    """A filter that differs from one of the config by 1 % of σ in all realisations, or by 1 σ in four of 2000."""
    x = twins(2000)
    sigma = np.nanstd(x - radarsim.plots("rls2", n=2000).truth, axis=(0, 1))
    x[::every] += np.random.default_rng(1).normal(size=x[::every].shape) * sigma * (0.01 if every == 1 else 1)
    result = radarsim.judge("rls2", x)
    if every == 1:
        assert "note" not in result.gains
        assert result.warnings == []
    else:
        assert (
            of(result.gains, filter="mine", baseline="r+Vr")["note"].eq(str(interval_notes.ALIKE_FILTERS)).mean() > 0.7
        )
        assert "too narrow (“mine”): few of the rare realisations that decide them occurred" in result.warnings[0]


@pytest.mark.slow
def test_a_planted_loss_is_called_worse_with_the_realisations_of_theory():
    """Where half of the interval is the loss, half of the seeds call it; with four times as many 97.5 %."""
    n = round((1.96 * SPREAD / np.log(1 + LOSS)) ** 2)
    seeds = range(1, 61)
    for count, power in ((n, 0.5), (4 * n, 0.975)):
        called = [(g := of(gains_of(count, seed)[1], component="r", k=15))["gain_hi"].iloc[0] < 0 for seed in seeds]
        assert abs(np.mean(called) - power) < 3 * np.sqrt(power * (1 - power) / len(seeds)) + 1 / len(seeds), (count, g)


@pytest.mark.slow
def test_gains_cover_the_true_one():
    """Over 200 seeds, of all components and scans: 93 … 97 %."""
    inside = []
    for seed in range(1, 201):
        _, gains = gains_of(500, seed)
        inside.append(((gains["gain_lo"] < -100 * LOSS) & (gains["gain_hi"] > -100 * LOSS)).mean())
    assert 0.93 < np.mean(inside) < 0.97


@pytest.mark.slow
def test_nees_of_a_right_covariance_covers_one():
    """Of Gaussian estimates with the covariance that they have, three components: 93 … 97 % of 200 seeds."""
    inside = []
    for seed in range(1, 201):
        plan = plan_of(seed)
        truth = plan.draw(0, 400).truth
        P = np.array([[250.0**2, 900, 0], [900, 15.0**2, 1], [0, 1, 0.3]])
        noise = np.random.default_rng(seed).normal(size=truth.shape) @ np.linalg.cholesky(P).T
        experiment = load("rls2", [f"seed={seed}"])
        member = judge.make_user_filter(
            (truth + noise, np.broadcast_to(P, (*truth.shape, 3))), "mine", (), False, experiment
        )
        case = replace(experiment.cases[0], user_filters=(member,), realisations=400)
        work = CaseWork(case)
        found = case_results.case_result(case, work, collect(work, 400, threads=0))
        rows = common.join_columns([user_filters_tables.nees_columns(found)])
        inside.append(((rows["nees_lo"] < 1) & (rows["nees_hi"] > 1)).mean())
    assert 0.93 < np.mean(inside) < 0.97


@pytest.mark.slow
def test_memory_is_flat_in_the_number_of_realisations():
    """Twenty blocks more add nothing to the peak of two."""
    peaks = []
    for n in (2 * 4096, 22 * 4096):
        tracemalloc.start()
        radarsim.judge("rls2", Twin, realisations=n, threads=1)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.2 * peaks[0]


@pytest.mark.slow
def test_errors_are_taken_at_the_scans_that_a_study_reports():
    """multimodel reports from the fourth scan on; σ is that of the noise put on the truth at these scans."""
    plots = radarsim.plots("multimodel_1hz", n=16)
    result = radarsim.run("multimodel_1hz", realisations=16)
    axes = result.cases[0].axes
    noise = np.random.default_rng(5).normal(size=(16, len(plots.t_s), 9)) * np.arange(1, 1 + len(plots.t_s))[:, None]
    judged = radarsim.judge("multimodel_1hz", plots.truth_of(axes.components) + noise, realisations=16)
    mine = of(judged.curves, filter="mine", component="y")
    wanted = np.sqrt((noise[:, axes.k - 1, 3] ** 2).mean(axis=0))  # of differences of numbers as large as the truth
    assert_rounded(mine["sigma"], wanted, size=np.abs(plots.truth).max(), operations=2)
    assert axes.k[0] > 1


def test_figures_call_components_as_the_study_does():
    result = radarsim.judge("sonar_smoothing", held, realisations=64, overrides={"frame": "cartesian"})
    drawn = case_figures(result.cases, result.tables, result.experiment)
    assert drawn["sigma_x"].title == "RMS error of the distance north"
    assert drawn["gain_x"].title == "Gain in the RMS error of the distance north"
    assert list(drawn)[:2] == ["gain_x", "sigma_x"]  # before the study's own: the answer is about the judged filter


def test_no_estimate_is_a_failure_where_a_filter_of_the_config_has_one():
    few = {"radar.detection_probability": 0.2, "scans": 4}
    never = radarsim.judge("rls2", lambda plots: np.full((plots.n, 4, 3), np.nan), realisations=200, overrides=few)
    columns = radarsim.plots("rls2", n=200, overrides=few).columns
    seen = np.isfinite(columns["range_m"]).any(axis=1)
    failed = of(never.tables["failures"], reason="no_estimate")["failed"].item()
    assert failed == seen.sum() < 200


def test_plots_of_a_file_come_back_as_estimates(tmp_path, monkeypatch):
    """Out by `simulate`, back by `judge`, in each format: the numbers of a function that is given the plots."""
    monkeypatch.chdir(tmp_path)
    for kind in ("npz", "csv"):
        done = CliRunner().invoke(main, ["simulate", "rls2", "--realisations", "0:200", "-o", f"plots.{kind}"])
        assert done.exit_code == 0, done.output
    with np.load("plots.npz") as plots:
        np.savez("back.npz", estimates=plots["range_m"], realisation=plots["realisation"], seed=plots["seed"])
    rows = pd.read_csv("plots.csv")
    rows.assign(r_m=rows["range_m"])[["realisation", "t_s", "r_m"]].to_csv("back.csv", index=False)
    wanted = radarsim.judge("rls2", lambda plots: plots["range_m"], realisations=200)
    for name in ("back.npz", "back.csv"):
        assert same(radarsim.judge("rls2", name), wanted), name
    with pytest.raises(ConfigError, match="plots with seed 2017; the run has seed 7"):
        radarsim.judge("rls2", "back.npz", seed=7)


@pytest.mark.slow
def test_the_first_figure_is_of_the_filter_whatever_the_config_names(tmp_path):
    result = radarsim.judge("sonar_smoothing", range_alone, components=["r"], realisations=64)
    written = result.write(tmp_path, figures="svg")
    headings = re.findall(r"(?m)^## (.+)$", (written.folder / "figures/captions.md").read_text(encoding="utf-8"))
    assert headings == ["gain_r", "sigma_r", "plots", "smoothing_gains", "claims"]


def range_alone(plots):
    return plots["range_m"][..., None]


def test_a_sweep_shows_the_filter_too():
    result = radarsim.judge(
        "rls2", range_alone, components=["r"], overrides={"sweep.radar.sigma_range_m": [100, 200]}, realisations=64
    )
    drawn = case_figures(result.cases, result.tables, result.experiment)
    names = [mark.label for mark in drawn["sweep_sigma_range_m"].panels[0].marks]
    assert names == ["r", "r+Vr", "mine"]


def test_axes_of_a_flight_have_their_words():
    words = {one.name: one.words for one in registry.study("multimodel").user_filter_components()}
    assert (words["x"], words["y"], words["vy"]) == ("distance north", "height", "rate of climb")
    assert set(words) == {name for name, _ in flight.COMPONENTS}
    with use_language("ru"):
        assert tr("RMS error of the {quantity}", quantity=words["vy"]) == "СКО ошибки вертикальной скорости"


@pytest.mark.parametrize(
    ("config", "overrides"),
    [("rls2", ()), ("sonar_correlated", ("sweep.sensor.error_correlation=[0.3]",))],  # whose state has no acceleration
)
def test_a_function_takes_plots_as_judge_gives_them(config, overrides):
    seen = []
    raw = lambda plots: seen.append(plots) or plots["range_m"]  # noqa: E731
    radarsim.judge(config, raw, realisations=300, overrides=overrides)
    plots = radarsim.plots(config, n=256, overrides=overrides)
    assert (plots.first, plots.n, plots.seed) == (seen[0].first, seen[0].n, load(config).seed)
    for name in plots.columns:
        np.testing.assert_array_equal(plots[name], seen[0][name])
    world, known = seen[0].world, plots.world
    assert (known.columns, known.sigma, known.components, known.keys, known.case) == (
        world.columns, world.sigma, world.components, world.keys, world.case)  # fmt: skip
    np.testing.assert_array_equal(known.t_s, world.t_s)
    with pytest.raises(KeyError, match="range: plots have range_m, "):
        plots["range"]


def test_a_class_whose_objects_are_functions_is_judged():
    class Smoother:
        def __call__(self, plots):
            return plots["range_m"]

    tables = [
        radarsim.judge("rls2", target, realisations=256, figures=False, threads=1).curves
        for target in (Smoother, Smoother())
    ]
    pd.testing.assert_frame_equal(*tables)


def test_a_filter_without_any_estimate_fails_without_words_of_numpy():
    result = radarsim.judge(
        "rls2", lambda plots: np.full((plots.n, 15, 1), np.nan), realisations=256, figures=False, threads=1
    )
    assert "“mine” fails in 100 %" in result.answer[0]
