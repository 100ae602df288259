"""A filter from outside beside the config's: what its numbers are, and what is refused or said of it."""

import numpy as np
import pytest

import radarsim
from radarsim.app import judge as judging
from radarsim.app.configs import CaseWork, load
from tests.studies.range_doppler import naive


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
            starts = [
                naive.start(np.array(one), 2, 2, np.sqrt(np.diag(self.R)), self.dt)
                for one in zip(*self.plots, strict=True)
            ]
            self.x, self.P = np.array([x for x, _ in starts]), starts[0][1]
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
    plots = radarsim.plots("rls2", n=300)
    plan = CaseWork(judging.judged(load("rls2"), twin, "mine", realisations=300)[0].cases[0]).plans[-1]
    return twin(judging.outside.plots_of(plan, plots))


def of(table, **values):
    for name, value in values.items():
        table = table[table[name] == value]
    return table.reset_index(drop=True)


def test_a_twin_has_the_runs_numbers(judged):
    mine, theirs = (of(judged.curves, filter=name) for name in ("mine", "r+Vr"))
    for column in ("sigma", "sigma_lo", "sigma_hi", "spread", "n"):
        np.testing.assert_allclose(mine[column], theirs[column], rtol=1e-9)
    np.testing.assert_allclose(mine["bias"], theirs["bias"], atol=1e-9 * theirs["sigma"].max())


def test_a_twin_gains_nothing_and_its_intervals_hold_it(judged):
    gains = of(judged.gains, filter="mine", baseline="r+Vr")
    assert len(gains) == 44
    assert (gains["gain_lo"] < 0).all()
    assert (gains["gain_hi"] > 0).all()
    assert (gains["gain_percent"].abs() < 1e-9).all()
    assert "cannot be told from r+Vr" in judged.answer[0]


def test_gains_are_against_every_filter_and_paired(judged, plain):
    """Against r a twin gains what r+Vr does, with its interval, which common noise makes narrow."""
    mine, theirs = (of(judged.gains, filter=name, baseline="r") for name in ("mine", "r+Vr"))
    both = mine.merge(theirs, on=["component", "k"])
    assert len(both) == len(theirs)
    for end in ("gain_percent", "gain_lo", "gain_hi"):
        np.testing.assert_allclose(both[f"{end}_x"], both[f"{end}_y"], atol=2e-6)


def test_the_studys_own_tables_are_those_of_a_plain_run(judged, plain):
    for name, table in plain.tables.items():
        own = judged.tables[name]
        own = own[own["filter"] != "mine"] if "filter" in own else own
        assert own[list(table)].equals(table), name


def test_nees_is_that_of_the_run(judged):
    mine = judged.tables["nees"].merge(of(judged.tables["consistency"], filter="r+Vr"), on="k")
    assert len(mine) == 14
    np.testing.assert_allclose(mine["nees_x"], mine["nees_y"], rtol=1e-9)
