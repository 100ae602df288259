"""Comparisons of stored results: which cases answer to one another, and what the intervals of differences are worth."""

import re
from dataclasses import replace

import numpy as np
import pytest

from radarsim.api.compare import asked_of_comparison
from radarsim.errors import ConfigError
from radarsim.language.current import use_language
from radarsim.report import csv_text, statistics, tables
from radarsim.report.comparison import figures, pairs, sentences, summary, table
from radarsim.report.comparison.pairs import Side
from radarsim.report.drawing.model import Line
from radarsim.report.quantities import SIGMA, Quantity
from tests.tolerances import assert_rounded, share_error

TIMES = 3000  # each is an experiment of its own
COUNT = 400
RATIOS = {"base": 1.0, "one": 0.8, "other": 0.7}


@pytest.fixture(scope="module")
def errors():
    """Errors (TIMES, COUNT) of three filters on common noise: each a part of its own, and one that all share."""
    rng = np.random.default_rng(7)
    shared = rng.standard_normal((TIMES, COUNT))
    shares = {"base": 0.9, "one": 0.8, "other": 0.7}
    parts = {f: rng.standard_normal((TIMES, COUNT)) for f in shares}
    return {f: RATIOS[f] * (np.sqrt(s) * shared + np.sqrt(1 - s) * parts[f]) for f, s in shares.items()}


def side(label, errors, filters, noise="n", count=COUNT):
    """A side with these filters, the first the baseline; each time is an experiment."""
    t = np.arange(TIMES, dtype=float)
    curves, gains = [], []
    squares = {f: errors[f] ** 2 for f in filters}
    sums = {f: (one.sum(1), (one**2).sum(1)) for f, one in squares.items()}
    for f in filters:
        sigma = statistics.root_mean_square(*sums[f], COUNT)
        labels = {"case": label, "filter": f, "component": "r", "unit": "m", "t_s": t}
        curves.append(labels | tables.interval_columns("sigma", sigma) | {"exact_sigma": np.full(TIMES, RATIOS[f])})
        if f != filters[0]:
            cross = (squares[f] * squares[filters[0]]).sum(1)
            paired = statistics.gain(*sums[f], *sums[filters[0]], cross, COUNT)
            gain = tables.interval_columns("gain_percent", paired, "gain")
            gains.append(labels | gain | {"baseline": filters[0], "exact_percent": np.nan})
    made = {"curves": frame(curves)} | ({"gains": frame(gains)} if gains else {})
    return Side(label, label, label, noise, count, made)


def frame(parts):
    """One table of columns whose lengths the times give."""
    columns = {name: np.concatenate([np.broadcast_to(np.asarray(p[name]), TIMES) for p in parts]) for name in parts[0]}
    return tables.frame(columns)


def held(rows):
    """The share of intervals of the change in σ, in per cent, that hold the true one; and their mean width."""
    true = 100 * (rows["exact"] / rows["against_exact"] - 1)
    inside = (rows["percent_lo"] <= true) & (true <= rows["percent_hi"])
    return inside.mean(), (rows["percent_hi"] - rows["percent_lo"]).mean()


def test_intervals_cover_and_a_common_baseline_makes_them_narrower(errors):
    own, other = side("a", errors, ["base", "one"]), side("b", errors, ["base", "other"])
    renamed = {key: rows.assign(filter=rows["filter"].replace("other", "one")) for key, rows in other.tables.items()}
    linked = table.comparison_table([pairs.Pair(own, Side("b", "b", "b", "n", COUNT, renamed))])
    linked = linked[(linked["filter"] == "one") & (linked["quantity"] == "sigma")]
    linked = linked.assign(against_exact=RATIOS["other"])
    assert set(linked["pairing"]) == {table.LINKED}
    share, width = held(linked)
    assert share > 0.95 - share_error(0.95, TIMES)
    loose = table.comparison_table([pairs.Pair(own, Side("b", "b", "b", "n", COUNT + 1, renamed))])
    loose = loose[(loose["filter"] == "one") & (loose["quantity"] == "sigma")].assign(against_exact=RATIOS["other"])
    assert set(loose["pairing"]) == {table.UNLINKED}
    assert held(loose)[0] > share
    assert held(loose)[1] > 1.3 * width


def test_independent_intervals_cover_95_per_cent(errors):
    rng = np.random.default_rng(8)
    apart = {f: RATIOS[f] * rng.standard_normal((TIMES, COUNT)) for f in RATIOS}
    rows = table.comparison_table([pairs.Pair(side("a", errors, ["one"]), side("b", apart, ["other"], noise="m"))])
    rows = rows[rows["quantity"] == "sigma"]
    assert set(rows["pairing"]) == {table.INDEPENDENT}
    assert set(rows["against_filter"]) == {"other"}
    assert abs(held(rows)[0] - 0.95) < share_error(0.95, TIMES)


def test_the_same_numbers_differ_by_nothing(errors):
    rows = table.comparison_table([pairs.Pair(side("a", errors, ["base", "one"]), side("b", errors, ["base", "one"]))])
    assert set(rows["pairing"]) == {table.SAME}
    for column in ("difference", "difference_lo", "difference_hi"):
        assert (rows[column] == 0).all()


def test_the_baseline_against_another_filter_is_paired_like_a_gain(errors):
    both = side("a", errors, ["base", "one"])
    lone = {key: rows[rows["filter"] == "base"].assign(filter="one") for key, rows in both.tables.items()}
    # The baseline of `b` has the name of the filter that it answers to.
    base = Side("b", "b", "b", "n", COUNT, lone | {"gains": both.tables["gains"].assign(baseline="one").head(1)})
    rows = table.comparison_table([pairs.Pair(both, base)])
    rows = rows[(rows["quantity"] == "sigma") & (rows["filter"] == "one")]
    gains = both.tables["gains"]
    assert set(rows["pairing"]) == {table.LINKED}
    # Equal to the first order in 1/n; a gain's interval lacks the skewness of the single ones.
    for end, of in (("percent_lo", "gain_hi"), ("percent_hi", "gain_lo")):
        apart = rows[end].to_numpy() + gains[of].to_numpy()
        assert abs(apart).mean() < 0.02 * (gains["gain_hi"] - gains["gain_lo"]).mean()


def test_cases_answer_to_one_another_by_their_swept_values():
    def of(run, *cases):
        return [Side(run, case, case, None, 1, {}) for case in cases]

    first, second = of("a", "a q=1", "a q=2"), of("b", "b q=2", "b q=3")
    found, alone = pairs.pairs([first, second])
    assert [(pair.side.case, pair.reference.case) for pair in found] == [("b q=2", "a q=2")]
    assert alone == ["b q=3: no such case in a"]
    found, alone = pairs.pairs([of("mine", "mine"), first])
    assert [pair.reference.case for pair in found] == ["mine", "mine"]
    assert not alone


def test_figures_have_all_sides_on_common_axes(errors):
    pair = pairs.Pair(side("b", errors, ["base", "one"], noise="m"), side("a", errors, ["base", "one"]))
    made = table.comparison_table([pair])
    drawn = figures.figures([pair.reference, pair.side], made)
    values, apart = drawn["sigma_r"].panels
    assert [mark.name for mark in values.marks] == ["a, base", "a, one", "b, base", "b, one"]
    assert len([mark for mark in apart.marks if isinstance(mark, Line)]) == 2
    looks = {(m.style.colour, m.style.dash) for m in values.marks}
    assert len(looks) == 4
    assert sentences.percent_text(2886.76) == "29.9 times"


def test_a_quantity_that_both_studies_measure_has_figures_of_its_own(errors):
    """Its axis has its words and its unit; a share that is measured by one side alone has none."""
    area = Quantity("area", "mean square error", "areas", "area", per="component", unit="m2")
    share = Quantity("inside", "share inside", "areas", "inside", kind="share")
    sides = []
    for name, measured in (("a", (SIGMA, area, share)), ("b", (SIGMA, area))):
        one = side(name, errors, ["base", "one"], noise=name)
        columns = {new: one.tables["curves"][f"sigma{new[4:]}"] ** 2 for new in ("area", "area_lo", "area_hi")}
        areas = one.tables["curves"][["case", "filter", "component", "t_s"]].assign(inside=0.5, **columns)
        sides.append(replace(one, tables={**one.tables, "areas": areas}, measured=measured))
    drawn = figures.figures(sides, table.comparison_table([pairs.Pair(sides[1], sides[0])]))
    assert set(drawn) == {"sigma_r", "area_r"}
    values, apart = drawn["area_r"].panels
    assert (values.y.label, apart.y.label) == ("mean square error $r$, m²", "change relative to a, %")
    assert [mark.name for mark in values.marks] == ["a, base", "a, one", "b, base", "b, one"]


def test_tables_read_back_as_they_were_written():
    made = tables.frame({"filter": ["nan", "1", "a,b", ""], "sigma": [0.1, np.nan, 1e-300, np.inf], "n": [1, 2, 3, 4]})
    read = csv_text.from_csv(csv_text.to_csv(made))
    assert read["filter"].tolist() == ["nan", "1", "a,b", ""]
    assert read["n"].tolist() == [1, 2, 3, 4]
    np.testing.assert_array_equal(read["sigma"], made["sigma"])


def test_an_interval_without_an_upper_end_has_none_in_a_difference_either():
    open_end = statistics.Estimate(2.0, 1.0, np.inf)
    apart = statistics.difference(statistics.Estimate(5.0, 4.0, 6.0), open_end)
    assert (apart.value, apart.lo) == (3.0, -np.inf)
    assert_rounded(apart.hi, 3 + np.sqrt(2), operations=4)


def summary_of(errors, names, filters=("base", "one"), component=None):
    sides = [side(name, errors, list(filters), noise=name) for name in names]
    made = table.comparison_table([pairs.Pair(other, sides[0]) for other in sides[1:]])
    return summary.summaries(made, [SIGMA], component)[0]


def test_a_summary_is_one_sentence_and_one_table_without_the_case_compared_with_itself(errors):
    single = summary_of(errors, "ab")
    assert re.fullmatch(r"b versus a, σ of r at \d+ s: “base” 0 % \(exact\) and “one” 0 % \(exact\)\.", single.sentence)
    assert single.table.columns[:4] == ("filter", "of", "b", "a")
    several = summary_of(errors, "abc")
    assert re.fullmatch(
        r"Relative to a, σ of r at \d+ s: undecided in 4 of 4 pairs of case and filter\.", several.sentence
    )
    assert several.table.columns == ("case", "base", "one")
    assert [row[0] for row in several.table.rows] == ["b", "c"]
    itself = [side("a", errors, ["base", "one"], noise="a"), side("b", errors, ["base", "one"], noise="b")]
    made = table.comparison_table(
        [pairs.Pair(replace(itself[0], label="mirror"), itself[0]), pairs.Pair(*itself[::-1])]
    )
    assert {row[0] for row in summary.summaries(made, [SIGMA])[0].table.rows} == {"base", "one"}
    assert "mirror" not in summary.summaries(made, [SIGMA])[0].sentence


def test_a_summary_is_about_the_component_asked_for(errors):
    assert "σ of r at" in summary_of(errors, "ab", component="r").sentence
    with pytest.raises(ConfigError, match="must be one of r, got 'q'"):
        summary_of(errors, "ab", component="q")


def test_a_summary_is_about_the_time_asked_for(errors):
    sides = [side(name, errors, ["base", "one"], noise=name) for name in "ab"]
    made = table.comparison_table([pairs.Pair(sides[1], sides[0])])
    first_s, second_s, *_, last_s = sorted(set(made["t_s"]))
    assert f"σ of r at {second_s:g} s" in summary.summaries(made, [SIGMA], at_s=second_s)[0].sentence
    with pytest.raises(ConfigError, match=f"must be a common time, from {first_s:g} to {last_s:g} s, the nearest"):
        summary.summaries(made, [SIGMA], at_s=last_s + 7)


@pytest.mark.parametrize(
    ("wanted", "message"),
    [
        ("sgma r", "must be one of sigma, got 'sgma'; did you mean sigma?"),
        ("worst sigma r", "a comparison is of common times"),
        ("sigma r at noon", "must be a quantity such as"),
    ],
)
def test_what_a_comparison_cannot_be_asked_is_refused(wanted, message):
    with pytest.raises(ConfigError, match=re.escape(message)):
        asked_of_comparison(wanted, [SIGMA])


def test_a_comparison_is_asked_with_the_phrase_of_the_other_commands():
    assert asked_of_comparison("sigma of y at 60 s", [SIGMA]) == (SIGMA, "y", 60.0)
    assert asked_of_comparison("sigma y at the end", [SIGMA]) == (SIGMA, "y", None)


def test_gains_differ_by_points():
    row = {"percent": np.nan, "difference": 53.7, "unit": "%", "difference_lo": 51.6, "difference_hi": 55.8}
    assert sentences.change_texts(row)[0] == "+53.7 points [+51.6, +55.8]"
    with use_language("ru"):
        assert sentences.change_texts(row)[0] == "+53,7 пункта [+51,6; +55,8]"
