"""The page's headline, its lines, and the forest plot, by hand."""

from radarsim.papers.claim_rows import classes_in_words, count_classes, measured_words, verdict_sentence, worst_part
from radarsim.papers.claims_page import _class_lines, claims_page
from radarsim.papers.claims_table import NOT_RUN
from radarsim.papers.forest_plot import BEYOND, MAX_DRAWN_MARGINS, _drawn_distance, forest_plot
from radarsim.papers.verdict_rule import CONFIRMED, DEPENDS, REFUTED, UNDECIDED
from radarsim.report.drawing.model import Line, Note
from radarsim.report.drawing.style import MARKERS


def row(claim="P9.1", kind=REFUTED, **more):
    numbers = {"measured": 3.0, "lo": 2.5, "hi": 3.5, "judged_lo": 2.0, "judged_hi": 4.0}
    numbers |= {"expected_lo": 5.0, "expected_hi": "", "margin": 1.0}
    words = {
        "paper": "Someone",
        "statement": "s",
        "place": "p",
        "original": "",
        "interpretation": "",
        "variants_of": "",
        "reason": "",
    }
    classes = {"class": kind, "overall": kind, "as_shipped": kind, "verdict": kind, "extension": False, "needed": ""}
    beside = {
        "exact": "",
        "miss": 2.0,
        "of": "",
        "holds": "",
        "depends_on": "",
        "quantity": "x",
        "expected": "5",
        "unit": "m",
        "old_verdict": "",
    }
    return {"claim": claim, **words, **classes, **numbers, **beside, **more}


def test_headline_counts_classes_and_leaves_extensions_out():
    rows = [row(), *(row(f"P9.{n}", CONFIRMED) for n in (2, 3, 4)), row("P9.5", CONFIRMED, extension="true")]
    rows += [row("P9.6", DEPENDS), row("P9.8", DEPENDS)]
    assert count_classes(rows) == ({CONFIRMED: 3, REFUTED: 1, DEPENDS: 2}, 1)
    said = "3 confirmed, 1 refuted, 2 depend on what the paper leaves open; 1 extension not counted"
    assert classes_in_words(rows) == said
    lines = _class_lines(rows)
    assert lines[0].startswith("In all 6 claims, and 1 extensions")
    assert lines[2:] == [
        "* **3 confirmed**, true as stated: P9.2–P9.4",
        "* **1 refuted**, false by more than the margin of their words: P9.1",
        "* **2 depend on what the paper leaves open**: P9.6, P9.8",
    ]


def test_a_claim_says_how_far_it_stands():
    flips = {"overall": "", "holds": 1, "of": 2, "depends_on": "flight, start", "as_shipped": REFUTED}
    said = verdict_sentence([row(kind=DEPENDS, **flips)])
    words = "refuted as shipped; true only with other choices of flight, start"
    assert said == f"{words} (true under 1 of 2 interpretations)"
    assert verdict_sentence([row(kind=DEPENDS, **flips | {"as_shipped": DEPENDS})]).startswith("depends on flight")
    few = row(kind=CONFIRMED, overall="", holds=3, of=3, as_shipped=UNDECIDED, needed=8123)
    words = "not yet decided as shipped; confirmed over all interpretations"
    assert verdict_sentence([few]) == f"{words} (8200 realisations would decide; true under all 3 interpretations)"
    assert verdict_sentence([row()]) == "**refuted**"  # by how much stands with its parts


def test_forest_stands_in_margins():
    assert _drawn_distance(3.0, row()) == 2.0
    assert _drawn_distance(6.5, row()) == -1.5
    assert _drawn_distance(-100.0, row()) == MAX_DRAWN_MARGINS
    between = row(expected_hi=7.0)
    assert _drawn_distance(6.5, between) == -0.5
    (panel,) = forest_plot([row(), row("P9.2", CONFIRMED, measured=6.0, lo=5.5, hi=6.5, exact=6.25)]).panels
    lines = [mark for mark in panel.marks if isinstance(mark, Line)]
    confirmed, other_interval, exact, refuted, its_interval = lines
    assert [(one.label, one.x.tolist(), one.y.tolist()) for one in (refuted, confirmed)] == [
        (REFUTED, [2.0], [0.0]),
        (CONFIRMED, [-1.0], [1.0]),
    ]
    assert [one.x[:2].tolist() for one in (its_interval, other_interval)] == [[1.0, 3.0], [-1.5, -0.5]]
    assert (exact.x.tolist(), exact.exact.tolist()) == ([-1.25], [1.0])
    assert [words for _, words in panel.y.ticks] == ["s  1", "s  2"]
    assert [mark.text for mark in panel.marks if isinstance(mark, Note)] == ["3 [2, 4] m", "6.25 m (exact)"]
    assert forest_plot([row(kind=NOT_RUN)]) is None
    (few,) = forest_plot([row(judged_lo="", judged_hi="")]).panels  # few realisations have no interval
    assert few.marks[1].x[:2].tolist() == [2.0, 2.0]
    assert measured_words(row(judged_lo="", judged_hi="")) == "3 m"


def test_what_lies_beyond_the_rim_has_an_arrow():
    rows = [row(), row("P9.2", measured=-50.0), row("P9.3", CONFIRMED, measured=90.0)]
    (panel,) = forest_plot(rows).panels
    arrows = {
        mark.style.marker: (mark.x.tolist(), mark.y.tolist())
        for mark in panel.marks
        if isinstance(mark, Line) and mark.x.size and abs(mark.x[0]) == BEYOND
    }
    left, right = MARKERS.index("<"), MARKERS.index(">")
    assert arrows == {right: ([BEYOND], [1.0]), left: ([-BEYOND], [2.0])}


def test_words_that_markdown_would_read_are_escaped():
    of = row(statement="a | b < c", expected="< 0", config="rls2", original="а")
    words = "<summary>a \\| b &lt; c</summary>«а» (p)<br>Result: x: 3 [2, 4] m; expected &lt; 0 m.</details>"
    text = claims_page([of], {"Someone": "range_doppler"})
    assert f"| P9.1 | <details>{words} | **refuted** | `rls2` |" in text


def test_of_variants_of_a_number_the_nearest_is_drawn():
    far = row(variants_of="T", measured=-50.0, lo=-51.0, hi=-49.0)
    near = row(variants_of="T", measured=4.9, lo=4.8, hi=5.0)
    assert worst_part([far, near]) is near
    assert worst_part([row(extension=True), near]) is near
