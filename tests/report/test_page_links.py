"""What belongs to what in a report: figures to tables, claims to figures."""

import pytest

from radarsim.language import current
from radarsim.papers import report_section
from radarsim.report import page_links, page_sentences, wording

MADE = ("curves", "gains", "locks", "detections", "consistency")


def test_a_figure_has_the_tables_that_its_study_declares_or_those_of_its_name():
    declared = {"lock": ("locks",), "detection": ("detections",), "accuracy": ("curves",), "cost": ("stages",)}
    found = {
        name: page_links.tables_behind_figure(name, declared, MADE)
        for name in ("sigma_r", "gain_Vr", "sweep_dt", "dynamic_r", "locks", "lock_noise", "detection", "cost", "map")
    }
    assert found == {
        **{"sigma_r": ("curves",), "gain_Vr": ("gains",), "sweep_dt": ("curves",), "dynamic_r": ("curves",)},
        **{"locks": ("locks",), "lock_noise": ("locks",), "detection": ("detections",), "cost": (), "map": ()},
    }


def test_a_claim_leads_to_the_figure_of_its_component():
    drawn = {
        "gain_r": ("gains",),
        "gain_Vr": ("gains",),
        "sigma_r": ("curves",),
        "missed": ("curves",),
        "locks": ("locks",),
    }
    assert report_section.linked_figures([("gains", "Vr")], drawn) == ["gain_Vr"]
    assert report_section.linked_figures([("curves", "r"), ("gains", "r")], drawn) == ["sigma_r", "gain_r"]
    assert report_section.linked_figures([("curves", "ar")], drawn) == ["sigma_r", "missed"]  # its own is not drawn
    assert report_section.linked_figures([("locks", ""), ("none", "")], drawn) == ["locks"]
    assert report_section.linked_figures([], drawn) == []


def test_of_an_answer_so_much_stands_above_its_figure_that_both_are_seen():
    short, long = "a" * 90, "; ".join(["b" * 150] * 3)
    assert page_sentences.count_visible_sentences([short, short, short]) == 2
    assert page_sentences.count_visible_sentences([long]) == 1


@pytest.mark.parametrize("code", current.language_codes())
def test_no_interval_of_an_answer_is_cut(code):
    """A decimal comma leaves intervals and rows of numbers a semicolon of their own."""
    with current.use_language(code):
        value, in_row = wording.estimate((98.74, 97.5, 100.0), "%"), wording.list_numbers(["0.5", "1.5"])
        one = f"{value} ({in_row}; {wording.interval('1', '2')})"
        row = wording.list_numbers(map(wording.number, (700.5, 800.5)))
        parts = page_sentences.split_long_sentence(f"of A: {'; '.join([one, row] * 9)}.")
    assert len(parts) > 1
    assert all(page_sentences.is_short(part) for part in parts)
    clauses = [part.removeprefix("of A: ").removesuffix(".") for part in parts]
    assert "; ".join(clauses) == "; ".join([one, row] * 9)
