"""What the terminal shows: numbers as sentences have them, and where claims without results are to be had."""

import math
import re

import numpy as np
import pandas as pd
import pytest

import radarsim
from radarsim.cli import console, print_answers, print_results
from radarsim.cli import progress as cli_progress
from radarsim.config import find_files
from radarsim.papers.claims_table import CLASS_COLUMNS
from radarsim.papers.print_claims import print_claims
from radarsim.papers.verdict_rule import IMMATERIAL, REFUTED
from radarsim.report import interval_notes, wording
from radarsim.report.wording import significant_digits
from radarsim.system.threads import ThreadLimit
from tests.program import Terminal, command


@pytest.mark.parametrize(
    ("value", "form", "text"),
    [
        (1695.0, "#.4g", "1695"),
        (0.12, "#.4g", "0.1200"),
        (1.0, "#.4g", "1.000"),
        (-2.151, ".2f", "−2.15"),
        (-0.001, ".2f", "0.00"),
        (-1694.0, "#.4g", "−1694"),
        (0.0, "#.4g", "0.000"),
    ],
)
def test_numbers_of_tables_are_those_of_sentences(value, form, text):
    assert significant_digits(value, form) == text


def test_a_number_that_is_not_known_has_no_unit():
    assert wording.format_if_known(np.nan, ".2f", " %") == ""
    assert wording.format_if_known(3.0, ".2f", " %") == "3.00 %"


def test_claims_without_results_say_where_to_find_them(tmp_path):
    *claims, counted, pointer = command("claims", "--out", tmp_path / "none").stdout.splitlines()
    judges = {line.partition(" judges ")[2]: line for line in claims if " judges " in line}
    assert "radarsim run range_doppler --out" in judges["P1.1–P1.36"]
    assert not {f"P1.{number}" for number in range(1, 26)} - {line.split()[0] for line in claims}
    assert "36 not run" in command("claims", "range_doppler", "--out", tmp_path / "none").stdout
    assert re.fullmatch(r"\d+ not run; \d+ extensions not counted \(in brackets\)", counted.strip())
    assert "make reproduce-figures" in pointer
    assert "docs/claims.md" in pointer


def parts(*extensions):
    """Parts of a refuted claim, of which these are not counted."""
    common = {"claim": "P9.1", "paper": "P", "place": "there"} | dict.fromkeys(CLASS_COLUMNS, "confirmed")
    common |= {"statement": "It is so", "original": "", "config": "c", "quantity": "size", "case": "", "unit": "m"}
    common |= {"measured": 9.0, "lo": 9.0, "hi": 9.0, "exact": 9.0, "expected": "≤ 5", "miss": 8.0, "depends_on": ""}
    common |= dict.fromkeys(("needed", "of", "holds", "worst_miss"), math.nan)
    return [{**common, "verdict": "refuted", "extension": one} for one in extensions]


def test_a_part_that_is_not_counted_says_so(capsys):
    """Beside the paper's own parts, once; of a claim that is an extension as a whole its first line says it."""
    print_claims(parts(False, True), {"P9.1"})
    lines = capsys.readouterr().out.split("size")[1:]
    assert ["extension, not counted" in line for line in lines] == [False, True]
    print_claims(parts(True, True), {"P9.1"})
    assert capsys.readouterr().out.count("extension, not counted") == 1


def test_what_decides_a_part_stands_first(capsys):
    """The exact value, then what is expected, then what was measured; without an exact one the measured."""
    sampled = parts(False)[0] | {"measured": 8.8, "lo": -0.3, "hi": 17.1, "judged_lo": -0.3, "judged_hi": 17.1}
    print_claims([sampled | {"exact": 2.213}], {"P9.1"})
    assert "size; 2.213 m (exact); expected ≤ 5; measured 8.8 [−0.3, 17.1] m\n" in capsys.readouterr().out
    print_claims([sampled | {"exact": math.nan}], {"P9.1"})
    assert "size; 8.8 [−0.3, 17.1] m; expected ≤ 5\n" in capsys.readouterr().out


def test_values_of_parts_begin_in_one_column(capsys):
    worded = [
        one | {"verdict": verdict} for one, verdict in zip(parts(False, False), (IMMATERIAL, REFUTED), strict=True)
    ]
    print_claims(worded, {"P9.1"})
    _, *lines = capsys.readouterr().out.splitlines()
    assert len({line.index("size") for line in lines if "size" in line}) == 1


def test_a_list_of_claims_is_a_line_each(capsys):
    long = "one two three four five six seven eight nine ten eleven twelve thirteen"
    print_claims([*parts(False, False), *[one | {"claim": "P9.2", "statement": long} for one in parts(False)]])
    first, second, counted, hint = capsys.readouterr().out.splitlines()
    assert first == "P9.1   confirmed  It is so"
    assert second == f"P9.2   confirmed  {long.removesuffix('thirteen')}…"
    assert counted == "2 confirmed"
    assert "radarsim claims P9.1" in hint
    assert "--parts" in hint


def test_every_claim_is_one_line_of_a_terminal(monkeypatch):
    """Whatever its class: one that depends, and one that is not counted."""
    monkeypatch.setenv("COLUMNS", "60")
    screen = Terminal()
    monkeypatch.setattr("sys.stdout", screen)
    long = "a claim of very many words that no line of such a terminal could ever hold"
    of = [("P9.1", "depends on", False), ("P9.2", "the print contradicts itself", False), ("P9.3", "refuted", True)]
    rows = [one | {"claim": claim, "class": kind, "statement": long} for claim, kind, ours in of for one in parts(ours)]
    print_claims(rows)
    claims, told = screen.getvalue().splitlines()[:3], screen.getvalue().splitlines()[3:]
    assert [line.split()[0] for line in claims] == ["P9.1", "P9.2", "P9.3"]
    assert [line[6:36].strip() for line in claims] == ["depends", "the print contradicts itself", "(refuted)"]
    assert all(line[37:].startswith("a claim of") and line.endswith("…") and len(line) <= 60 for line in claims)
    assert "(in brackets)" in " ".join(told)


@pytest.mark.parametrize(
    "line",
    [
        "Range after 140 s: r alone 189.8 m [188.1, 191.5], r+Vr 155.1 m [153.5, 156.7], gain 18.27 % [17.60, 18.94].",
        "claims   12 confirmed: P1.1, P1.2, P1.3, P1.4, P1.5, P1.6, P1.7, P1.8, P1.9, P1.10, P1.11, P1.12, P1.13",
        "  E  refuted      how the filter starts: unweighted; how long the manoeuvre lasts",
    ],
)
def test_sentences_are_broken_between_words_and_never_within_a_number(line):
    broken = console.wrap_line(line, 40)
    assert " ".join(part.strip() for part in broken).split() == line.split()
    assert all(len(part) <= 40 for part in broken)
    assert not any(part.rstrip().endswith(("140", "189.8", "18.27")) for part in broken)  # a unit stays with its number
    column = {"R": 0, "c": 9, " ": 18}[line[0]]
    assert all(len(part) - len(part.lstrip()) == column for part in broken[1:])


def test_a_table_says_which_columns_it_leaves_out(monkeypatch):
    monkeypatch.setenv("COLUMNS", "40")
    screen = Terminal()
    monkeypatch.setattr("sys.stdout", screen)
    columns = ("case", "sigma", "95 %", "exact")
    console.print_table(
        "", columns, [("rls2", "189.8 m", "188.1 m … 191.5 m", "189.7 m")], spare=("at", "exact", "95 %")
    )
    assert "left out at 40 columns: exact" in screen.getvalue()
    assert "188.1 m … 191.5 m" in screen.getvalue()


def test_a_narrow_table_leaves_out_what_is_there(monkeypatch):
    """A spare column that the table has not, such as exact values that no row has, is no fault."""
    monkeypatch.setenv("COLUMNS", "40")
    screen = Terminal()
    monkeypatch.setattr("sys.stdout", screen)
    row = {"filter": "f", "case": "a", "component": "x", "t_s": 1.0, "unit": "m", "exact_sigma": math.nan, "note": ""}
    row |= {
        "sigma": 1.5,
        "sigma_lo": 1.0,
        "sigma_hi": 2.0,
        "gain_note": str(interval_notes.HEAVY_TAILS),
        "n_eff": 900.0,
    }
    last = pd.DataFrame([row | {"gain_percent": 3.25, "gain_lo": 1.0, "gain_hi": 5.0}])
    print_results.print_last_scan_rows("a", last, {"a": "a"})
    assert "3.25 %" in screen.getvalue()
    assert "left out at 40 columns: 95 %" in screen.getvalue()


def test_a_bar_moves_within_a_second_though_nothing_is_reported(monkeypatch):
    screen = Terminal()
    monkeypatch.setattr("sys.stderr", screen)
    with cli_progress.Progress("rls2", quiet=False) as progress:
        progress.timer.join(5)
        assert progress.bar is not None
        assert progress.bar.tasks[0].total is None
        progress.update(50, 200, 0)
        assert (progress.bar.tasks[0].total, progress.bar.tasks[0].completed) == (200, 50)
    assert cli_progress.SILENT_S < 1


def test_without_threads_a_bar_begins_with_the_first_report(monkeypatch):
    screen = Terminal()
    monkeypatch.setattr("sys.stderr", screen)
    monkeypatch.setattr("threading.Thread.start", None)
    monkeypatch.setattr(cli_progress, "SILENT_S", 0)
    with ThreadLimit(0), cli_progress.Progress("rls2", quiet=False) as progress:
        progress.update(50, 200, 0)
        assert (progress.bar.tasks[0].total, progress.bar.tasks[0].completed) == (200, 50)
        assert "25.0 %" in screen.getvalue()
    with ThreadLimit(0), cli_progress.CountedProgress("tracking", "rows") as counter:
        counter.update(50)
        assert "tracking: 50 rows" in screen.getvalue()


@pytest.mark.parametrize(("later", "left"), [(100, {"about 0:00:06 left"}), (10, set())])
def test_no_time_left_is_shown_while_the_rate_changes(monkeypatch, later, left):
    """100 a second, and after four seconds as many, or a tenth of it; 10 s of 1600."""
    screen, now = Terminal(), [0.0]
    monkeypatch.setattr("sys.stderr", screen)
    monkeypatch.setattr("time.monotonic", lambda: now[0])
    monkeypatch.setattr(cli_progress, "SILENT_S", 0)
    with ThreadLimit(0), cli_progress.CountedProgress("fitting", "likelihoods") as counter:
        for k in range(1, 11):
            now[0] = float(k)
            screen.seek(0)
            screen.truncate()
            counter.update(100 * min(k, 4) + later * max(k - 4, 0), 1600)
        assert "fitting: " in screen.getvalue()
    assert set(re.findall(r"about \S+ left", screen.getvalue())) == left


def test_list_is_one_screen_and_takes_words(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def listed(*words, code=0):
        result = command("list", *words, code=code)
        return result.stdout if code == 0 else result.stderr

    shown = listed().splitlines()
    assert sum(len(console.wrap_line(line, 80)) for line in shown) <= 24
    assert [line.split("  ")[0] for line in shown[1:6]] == ["P1", "P2", "P3", "P4", "plane"]
    names = [name for line in shown[1:6] for name in line.partition("  ")[2].split(", ")]
    assert sorted(names) == list(find_files.available_stems("configs"))
    assert {"rls2", "ambiguous", "orders"} <= set(shown[1][4:].split(", "))
    assert shown[0].startswith(f"{len(names)} configs ")
    titles = [line for line in listed("P2").splitlines() if line.startswith(("Configs", "Scenarios", "Studies"))]
    assert [title.split()[0] for title in titles] == ["Studies", "Scenarios", "Configs"]
    assert "10 variants of multimodel: `radarsim list multimodel`" in listed("P2")
    assert "multimodel_1hz" in listed("multimodel")
    assert "sonar" not in listed("P2")
    assert "rls2" not in listed("sonar")
    assert "sonar_clutter" in listed("sonar")
    assert listed("filters").startswith("Filters")
    assert "Configs" not in listed("filters")
    assert "no entry has this name" in listed("nosuchword", code=2)


def test_every_marked_interval_is_marked_on_the_terminal(capsys):
    """σ and gain of the last scan each by a note of their own; what rests on enough bears none."""
    row = {"case": "a", "component": "x", "t_s": 1.0, "unit": "m", "exact_sigma": float("nan"), "n_eff": 900.0}
    row |= {"sigma": 1.5, "sigma_lo": 1.0, "sigma_hi": 2.0, "gain_percent": 3.0, "gain_lo": 1.0, "gain_hi": 5.0}
    said = [
        {"filter": "f", "note": str(interval_notes.HEAVY_TAILS), "gain_note": str(interval_notes.HEAVY_TAILS)},
        {"filter": "g", "note": "rarer ones may decide", "gain_note": str(interval_notes.ALIKE_FILTERS)},
        {"filter": "h", "note": "", "gain_note": str(interval_notes.HEAVY_TAILS)},  # the baseline has few
        {"filter": "i", "note": "", "gain_note": ""},
        {"filter": "j", "note": "", "gain_note": float("nan"), "gain_lo": float("nan"), "gain_hi": float("nan")},
    ]
    print_results.print_last_scan_rows("a", pd.DataFrame([row | own for own in said]), {"a": "a"})
    *lines, tails, other = capsys.readouterr().out.splitlines()[2:]
    assert [re.findall(r"[*†]", line) for line in lines] == [["*"] * 2, ["†"] * 2, ["*"], [], []]
    assert tails.split(maxsplit=2)[:2] == ["*", "heavy"]
    assert other.split()[0] == "†"


def test_a_table_has_no_empty_columns_and_says_once_what_all_rows_have(capsys):
    """Of one filter there is no gain; of one case and time these stand above."""
    row = {"case": "a b=1", "component": "x", "t_s": 1.0, "unit": "m", "exact_sigma": math.nan, "note": ""}
    row |= dict.fromkeys(("gain_percent", "gain_lo", "gain_hi"), math.nan)
    row |= {"sigma": 1.5, "sigma_lo": 1.0, "sigma_hi": 2.0, "gain_note": math.nan}
    print_results.print_last_scan_rows("a", pd.DataFrame([row | {"filter": name} for name in "fg"]), {"a b=1": "b = 1"})
    title, head, *lines = capsys.readouterr().out.splitlines()
    assert title.strip() == "a, b = 1, 1 s"
    assert head.split() == ["filter", "component", "sigma", "95", "%"]
    assert [line.split()[0] for line in lines] == ["f", "g"]


def test_rows_without_a_lock_are_counted_and_a_bound_is_not_called_exact(capsys):
    row = {"case": "a", "component": "f0", "unit": "Hz", "t_s": 0.3, "sigma_lo": 0.9, "sigma_hi": 1.1}
    row |= {"gain_percent": np.nan, "gain_lo": np.nan, "gain_hi": np.nan}
    last = [row | {"filter": "f", "sigma": 1.0, "bound": 0.95}, row | {"filter": "g", "sigma": np.nan, "bound": 1416.0}]
    print_results.print_last_scan_rows("a", pd.DataFrame(last), {"a": "a"})
    *table, no_lock = capsys.readouterr().out.splitlines()
    assert "bound" in table[1].split()
    assert "exact" not in table[1]
    assert "nan" not in "".join(table)
    assert no_lock.split() == ["no", "lock", "g", "(1", "row", "left", "out)"]


def test_keys_of_no_weight_are_named_below_the_table(capsys):
    print_answers.print_sensitivity(radarsim.sensitivity("rls2"))
    table, _, below = capsys.readouterr().out.partition("slight")
    assert "initial_scans" not in table
    assert "filters.0.initial_scans, filters.1.initial_scans" in below
