"""What holds of every study, and of each kind of rare event: blocks add up, and a case is itself wherever it goes."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

import radarsim
from radarsim.api import result_content
from radarsim.api.case_work import CaseWork
from radarsim.report.drawing.model import GREY, Line
from radarsim.studies import registry
from radarsim.studies.interface import Study
from tests.tolerances import assert_rounded, column_sizes, rounding
from tests.trust.cases import CASES, MORE, Small

MISSED = Small("rls2", ("radar.detection_probability=0.8",), 1, 1)
OF_SONAR = "sonar", "sonar_manoeuvre", "missed_plots"
PAIRED = "range_doppler", "missed range_doppler", "multimodel", "ambiguous_doppler", *OF_SONAR
EVERY = CASES | MORE | {"missed range_doppler": MISSED}
every = pytest.mark.parametrize("study", CASES | MORE)


@pytest.fixture(scope="module")
def works():
    """The work of each study's small case, prepared when first asked for."""
    made = {}

    def of(study):
        if study not in made:
            made[study] = CaseWork(EVERY[study].loaded().cases[0])
        return made[study]

    return of


@every
def test_blocks_add_up_whatever_their_bounds(works, study):
    """A realisation is itself in any block, group of lanes or part of one: over 37 in one and in three parts."""
    work = works(study)
    whole = work.plan.layout.unpack(work.simulate(3, 37))
    parts = [work.plan.layout.unpack(work.simulate(*part)) for part in ((3, 8), (11, 16), (27, 13))]
    for name, values in whole.items():
        assert_rounded(sum(part[name] for part in parts), values, size=column_sizes(values, 37), operations=37)
    assert np.isfinite(work.simulate(3, 37)).all()


@pytest.mark.parametrize("study", PAIRED)
def test_errors_of_realisations_are_those_of_the_sums(works, study):
    """What gains of other people's filters are paired with: to the rounding of the sums, and of a realisation alone."""
    of, plan = registry.study(works(study).case.study), works(study).plan
    error = of.errors(plan, 3, 37)
    alone = Study.errors(of, plan, 11, 9)
    for one in (error, alone):
        one.swapaxes(0, 1)[:, ~plan.axes.available] = np.nan
    sums = plan.layout.unpack(of.simulate(plan, 3, 37))
    for power in range(1, 5):
        whole = sums["error"][..., power - 1]
        assert_rounded(np.nansum(error**power, axis=1), whole, size=column_sizes(whole, 37), operations=37)
    assert np.array_equal(np.isfinite(error).sum(axis=1), sums.get("estimates", 37 * plan.axes.available))
    largest = np.nanmax(np.abs(error), axis=(0, 1, 2))
    assert_rounded(error[:, 8:17], alone, size=largest, operations=100)


@pytest.mark.slow_cases("rare_losses")
@every
def test_a_case_is_the_same_elsewhere_and_another_with_another_seed(works, study):
    work = works(study)
    copy = pickle.loads(pickle.dumps(work))
    assert copy.identity == work.identity
    assert copy.simulate(5, 20).tobytes() == work.simulate(5, 20).tobytes()
    other = CaseWork(replace(work.case, seed=work.case.seed + 1))
    assert other.identity != work.identity
    assert other.simulate(5, 20).tobytes() != work.simulate(5, 20).tobytes()


FEW = {"multimodel": 64, "pulses_to_tracks": 200, "discriminator": 100}  # realisations, where others take 300
DRAWN = {
    "sigma": ("curves", "sigma", "sigma_lo", "sigma_hi", "exact_sigma"),
    "gain": ("gains", "gain_percent", "gain_lo", "gain_hi", "exact_percent"),
}


def drawn_of(mark, part, columns):
    """Whether a line is rows of one case and filter; intervals of marked rows are left out, angles are in degrees."""
    rows = part[part["t_s"].isin(mark.x)]

    def same(values, column, scale):
        there = np.isfinite(values)
        return np.allclose(values[there], scale * rows[column][there], rtol=rounding(operations=3), atol=0)

    drawn = [
        (np.asarray(v, float), c)
        for v, c in zip((mark.y, mark.lo, mark.hi, mark.exact), columns, strict=True)
        if v is not None
    ]
    return len(rows) == len(mark.x) and any(
        all(same(values, column, scale) for values, column in drawn) for scale in (1.0, 180 / np.pi)
    )


@pytest.mark.parametrize("study", CASES)
def test_lines_of_sigma_and_gains_are_rows_of_their_table(study):
    """Whole: times, values, both ends and exact values of one case, filter and component; angles in degrees."""
    result = radarsim.run(CASES[study].loaded(FEW.get(study, 300)))
    drawn = result_content.case_figures(result.cases, result.tables, result.experiment)
    known = set(registry.study(result.cases[0].study).keys().figure_names)
    assert {name for name in drawn if not name.startswith("sweep_")} <= known
    looked = 0
    for name, figure in drawn.items():
        kind, _, component = name.partition("_")
        if kind not in DRAWN:
            continue
        table, *columns = DRAWN[kind]
        rows = result.tables[table]
        every = [part for _, part in rows[rows["component"] == component].groupby(["case", "filter"], sort=False)]
        for mark in (mark for panel in figure.panels for mark in panel.marks if isinstance(mark, Line)):
            if mark.style.colour == GREY:  # the floor
                floors = result.curves[result.curves["component"] == component].dropna(subset="floor")
                parts = [part for _, part in floors.groupby("filter")]
                assert any(drawn_of(mark, part, ["floor"] * 4) for part in parts), (name, mark.label)
                continue
            assert any(drawn_of(mark, part, columns) for part in every), (name, mark.label)
            looked += 1
    assert looked or study == "discriminator"  # which has no scans in common


@pytest.mark.parametrize("kind", [kind for kind in MORE if kind.startswith("rare")])
def test_a_rate_that_rests_on_few_events_is_told(kind):
    result = radarsim.run(MORE[kind].loaded(24))
    assert result.tables["rare"]["note"].str.contains("effective events").any()
