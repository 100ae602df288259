"""What captions say of lines that end lowest or highest, read back from their words in any language.

The sentences are found by the catalogue's own translations of their templates and judged by the tables: what drew the
figures and told of them is not asked again.
"""

import re
from typing import NamedTuple

import numpy as np

from radarsim.app.result import names_in
from radarsim.language import called, tr
from radarsim.report import panels, seen
from radarsim.report.drawing import Line
from radarsim.report.wording import spoken
from tests.tolerances import rounding

RAISED = "⁰¹²³⁴⁵⁶⁷⁸⁹⁻"
POWER = re.compile(rf"(−?)(?:(\d+(?:[.,]\d+)?)·)?10([{RAISED}]+)")
PLAIN = re.compile(r"−?\d+(?:[.,]\d+)?")
CLOSE = 0.005  # of a number told to three figures

LEVEL = "At the end all are within each other's intervals."
ENDS = (
    "At the end lowest: {lowest} ({low}); highest: {highest} ({high}).",
    "At the end highest: {highest} ({high}); lowest: {lowest} ({low}).",
    "Of all panels lowest {low} ({lowest}), highest {high} ({highest}).",
)
EVERY = {1: "At the end lowest in every panel: {names}.", -1: "At the end highest in every panel: {names}."}
SOME = {1: "At the end lowest: {told}.", -1: "At the end highest: {told}."}
MOST = ("At most {most} ({name}), at the end.", "At most {most} ({name}, at {t_s:g} s); {last} at the end.")
EXTREMES = (
    "{quantity}: highest {high} ({name}), lowest {low} ({other}).",
    "{quantity}: from {low} to {high} ({name}).",
)
NEVER = "Zero throughout, so not drawn: {names}."
SHOWN = "Shown: {count} of {all}; only in the tables: {names}."


class Row(NamedTuple):
    """A line as its table has it: case, filter, times and values (n,), the interval of the last."""

    case: str
    filter: str
    t: np.ndarray
    y: np.ndarray
    lo: float
    hi: float

    @property
    def last(self):
        return self.y[-1]


def table_of(figure, study):
    """Table, column and its ends, component of a figure of σ, gains or rates against time; None for all others."""
    kind, _, component = figure.partition("_")
    if kind == "sigma":
        return "curves", ("sigma", "sigma_lo", "sigma_hi"), component
    if kind == "gain":
        return "gains", ("gain_percent", "gain_lo", "gain_hi"), component
    if study == "ambiguous_doppler" and figure in ("right", "lost"):
        column = {"right": "right", "lost": "beyond"}[figure]
        return "folds", (column, f"{column}_lo", f"{column}_hi"), None
    return None


def found(template, caption):
    """The places of the first sentence of a template in a caption, by name; None where there is none."""
    parts = re.split(r"\{(\w+)(?::[^}]*)?\}", tr(template))
    places = {"t_s": "[^, ]+", "low": "[^()]+?", "high": "[^()]+?"}  # names may hold brackets
    words = "".join(
        f"(?P<{part}>{places.get(part, '.+?')})" if n % 2 else re.escape(part) for n, part in enumerate(parts)
    )
    match = re.search(words + r"(?=\s|$)", caption)
    return match and match.groupdict()


def value(words, sign=1):
    """A number of words, that may be a power of ten: 278 of "about 278 m"; of a range by sign its first or last."""
    words = words.rpartition("(")[2].replace(",", ".").split("–")[0 if sign > 0 else -1]
    if power := POWER.search(words):
        sign, mantissa, exponent = power.groups()
        exponent = exponent.translate(str.maketrans(RAISED, "0123456789-"))
        return float(f"{'-' if sign else ''}{mantissa or 1}e{exponent}")
    return float(PLAIN.search(words)[0].replace("−", "-"))


def close(told, true):
    return abs(told - true) <= CLOSE * abs(true) + rounding(operations=4)  # of a gain of nothing


def drawn(result, figure, caption):
    """The cases of a figure: those that the config wants, less those that its caption names as left out.

    None where too many are left out for a caption to name them all.
    """
    component = (table_of(figure, result.experiment.study) or (None,) * 3)[2]
    cases = [one for one in result.cases if one.name in {case.name for case in result.experiment.shown_in(figure)}]
    cases = [one for one in cases if component is None or component in dict(one.axes.components)]
    if tr("Equal within the intervals in all {count} cases; the first is shown.", count=len(cases)) in caption:
        return cases[:1]
    if (left := found(SHOWN, caption + " ")) is None:
        return cases
    names = [called(name, names_in(result.cases)) for name in panels.names_of(cases)]
    quoted = re.findall("[“«](.+?)[”»]", left["names"])
    bare = re.split(tr("{first} and {last}", first=", |", last=""), re.sub("[“«].+?[”»]", "", left["names"]))
    gone = [name for name in names if name in (*quoted, *bare)]
    assert int(left["all"]) == len(cases), (figure, caption)
    if len(gone) != len(cases) - int(left["count"]):
        return None
    return [case for case, name in zip(cases, names, strict=True) if name not in gone]


def lines(result, of, cases):
    """The lines of a figure by its table: those of the cases that are drawn."""
    name, columns, component = of
    table = result.tables[name]
    table = table[table["case"].isin([one.name for one in cases])]
    if component:
        table = table[table["component"] == component]
    made = []
    for (case, name), own in table.groupby(["case", "filter"], sort=False):
        y, lo, hi = (own[column].to_numpy(float) for column in columns)
        if "unit" in own and own["unit"].iloc[0].startswith("rad"):
            y, lo, hi = (np.degrees(one) for one in (y, lo, hi))
        known = np.flatnonzero(np.isfinite(y))
        if known.size:
            made.append(Row(case, name, own["t_s"].to_numpy(float)[known], y[known], lo[known[-1]], hi[known[-1]]))
    return made


def judged(result, figure, caption):
    """Faults of a caption of σ, gains or rates against time, and how many of its sentences were judged."""
    of, study, caption = table_of(figure, result.experiment.study), result.experiment.study, spoken(caption)
    cases = drawn(result, figure, caption)
    every = lines(result, of, result.cases if cases is None else cases)
    devices = {one.name: called(panels.plain_label(one), names_in(result.cases)) for one in result.cases}
    faults, told = [], 0

    def says(words, true, names=None, who=(), sign=1):
        if not close(value(words, sign), true):
            faults.append(f"{figure}: {words!r} is {true:.4g}")
        named = [row for row in who if called(row.filter) in names or devices[row.case] in names]
        if names is not None and not named:
            faults.append(f"{figure}: {names!r} is {' or '.join(row.filter for row in who)}")

    def at(rows, sign):
        end = min(sign * row.last for row in rows)
        same = rounding(operations=6)  # two gains of equal σ
        return sign * end, [row for row in rows if np.isclose(sign * row.last, end, rtol=same, atol=0)]

    for template in ENDS if cases is not None else ():
        if claim := found(template, caption):
            told += 1
            (low, lowest), (high, highest) = at(every, 1), at(every, -1)
            says(claim["low"], low, claim["lowest"], lowest)
            says(claim["high"], high, claim["highest"], highest, -1)
    if tr(LEVEL) in caption:
        told += 1
        by_panel = panels_of(study, cases or result.cases, every)
        if any(max(row.lo for row in rows) > min(row.hi for row in rows) for rows in by_panel):
            faults.append(f"{figure}: not within each other's intervals")
    for sign, template in EVERY.items():
        if claim := found(template, caption):
            told += 1
            for rows in panels_of(study, cases or result.cases, every):
                _, first = at(rows, sign)
                if not any(called(row.filter) in claim["names"] for row in first):
                    faults.append(f"{figure}: {claim['names']} is {first[0].filter} in {first[0].case}")
    for sign, template in SOME.items():
        if claim := found(template, caption):
            for rows in panels_of(study, cases or result.cases, every):
                _, first = at(rows, sign)
                named = any(called(row.filter) in claim["told"] for row in first)
                if not named and tr("others in {count}").partition(" ")[0] not in claim["told"]:
                    faults.append(f"{figure}: {claim['told']} is {first[0].filter} in {first[0].case}")
    for template in MOST:
        if claim := found(template, caption):
            told += 1
            top = max(every, key=lambda row: row.y.max())
            says(claim["most"], top.y.max(), claim["name"], [row for row in every if row.y.max() == top.y.max()])
            if "t_s" in claim:
                says(claim["t_s"], top.t[top.y.argmax()])
                says(claim["last"], top.last)
            elif top.y.argmax() != len(top.y) - 1:
                faults.append(f"{figure}: not at the end, but at {top.t[top.y.argmax()]:g} s")
            break
    for template in EXTREMES if not told else ():
        if claim := found(template, caption):
            told += 1
            says(claim["high"], max(row.y.max() for row in every))
            says(claim["low"], min(row.y.min() for row in every))
            break
    return faults, told


def panels_of(study, cases, rows):
    """Lines by the panel that they share."""
    alone = study in ("sonar", "multimodel", "discriminator")
    groups = [[one] for one in cases] if alone else panels.by_panel(cases).values()
    by_panel = [[row for row in rows if row.case in {one.name for one in members}] for members in groups]
    return [rows for rows in by_panel if rows]


def rates(result, figure, caption):
    """Faults of a caption of shares of locks, or of wrong folds over a sweep: as shares, or as what is lost of them."""
    spoke, of = spoken(caption), ("folds", "right") if figure == "right" else ("locks", "lock_rate")
    table = result.tables[of[0]]
    if figure.startswith("locks"):
        shown = [one.name for one in result.cases if not one.swept and one.name in figure] or [
            one.name for one in result.cases if not one.swept
        ][:1]
        groups = table[table["case"].isin(shown)].groupby("filter", sort=False)
        some = {name: own[of[1]].to_numpy(float) for name, own in groups}
        if result.experiment.study == "pulses_to_tracks":
            ideal = {f.name for f in result.cases[0].spec.filters if f.estimator == "fisher_bound"}
            lost = {name: ((1 - own[of[1]]) * own["n"]).sum() for name, own in groups}
            some = {name: y for name, y in some.items() if name not in ideal and lost[name] >= 20}
    else:
        family = {one.name for one in result.cases if "_".join(["lock", *ends_of(one)]) == figure or figure == "right"}
        last = table[table["case"].isin(family)].groupby(["case", "filter"], sort=False).tail(1)
        some = {name: own[of[1]].to_numpy(float) for name, own in last.groupby("filter", sort=False)}
    if tr(LEVEL) in spoke:
        last = groups.tail(1)
        alike = last["lock_lo"].max() <= last["lock_hi"].min()
        return [] if alike else [f"{figure}: not within each other's intervals"]
    never = {name for name, y in some.items() if np.all(y == 1)} if (unlost := found(NEVER, spoke)) else set()
    wrong = []
    for turn in (lambda y: 1 - y, lambda y: y):
        wrong.append([f"{figure}: {name} is never lost" for name in never if called(name) not in unlost["names"]])
        values = {name: turn(y) for name, y in some.items() if name not in never}
        if claim := next(filter(None, (found(one, spoke) for one in ENDS[:2])), None):
            ends = {name: y[-1] for name, y in values.items()}
            pairs = (("low", "lowest", min(ends.values())), ("high", "highest", max(ends.values())))
            who = {true: [name for name in ends if ends[name] == true] for _, _, true in pairs}
        elif claim := next(filter(None, (found(one, spoke) for one in EXTREMES)), None):
            low, high = min(y.min() for y in values.values()), max(y.max() for y in values.values())
            pairs = (("low", "other" if "other" in claim else "name", low), ("high", "name", high))
            who = {low: [n for n in values if low in values[n]], high: [n for n in values if high in values[n]]}
        else:
            return [f"{figure}: nothing was judged of: {spoke[:200]}"]
        for end, names, true in pairs:
            if not close(value(claim[end], 1 if end == "low" else -1), true) or not any(
                called(one) in claim[names] for one in who[true]
            ):
                wrong[-1].append(f"{figure}: {claim[end]!r} of {claim[names]!r} is {true:.4g} of {who[true]}")
    return [] if [] in wrong else wrong[0]


def ends_of(result):
    return [key.rpartition(".")[2] for key, _ in result.swept]


def sweep(result, figure, caption):
    """Faults of a caption of σ at the last scan over swept keys, quantity by quantity."""
    spoke, faults, told = spoken(caption), [], 0
    members = [one for one in result.cases if one.swept and figure.endswith("_".join(ends_of(one)))]
    own_stem = [one for one in members if figure == "_".join(["sweep", panels.stem(one), *ends_of(one)])]
    members = own_stem or [one for one in members if figure == "_".join(["sweep", *ends_of(one)])]
    table = result.tables["curves"]
    table = table[table["case"].isin([one.name for one in members])]
    last = table.groupby(["case", "filter", "component"], sort=False).tail(1)
    for component, own in last.groupby("component", sort=False):
        templates = {"$\\sigma$ of {symbol} at the end": True, "$\\sigma$ of {symbol}": False}  # of lines, of maps
        worded = {spoken(tr(one, symbol=panels.letter(component))): of_lines for one, of_lines in templates.items()}
        words = next((one for one in worded if f"{one}: " in spoke), None)
        if words is None:
            continue
        factor = 180 / np.pi if worded[words] and own["unit"].iloc[0].startswith("rad") else 1.0
        at = spoke.find(f"{words}: ")
        claim = at >= 0 and next(filter(None, (found(one, spoke[at:]) for one in EXTREMES)), None)
        if not claim or claim["quantity"] != words:
            continue
        told += 1
        for end, true in (("high", own["sigma"].max()), ("low", own["sigma"].min())):
            if not close(value(claim[end]), factor * true):
                faults.append(f"{figure}: {component} {end} {claim[end]!r} is {factor * true:.4g}")
    return faults, told


def checked(result):
    """Faults of all captions of σ, gains and rates of a result in the language spoken, and how many were judged."""
    from radarsim.app import result as output

    faults, told = [], 0
    for name, figure in output.case_figures(result.cases, result.tables, result.experiment).items():
        kind = name.partition("_")[0]
        if kind in ("locks", "lock") or (name == "right" and "rare" in result.tables):
            if len(figure.panels) == 1 and any(isinstance(mark, Line) for mark in figure.panels[0].marks):
                faults += rates(result, name, figure.caption)
                told += 1
            continue
        if kind != "sweep" and table_of(name, result.experiment.study) is None:
            continue
        wrong, own = (sweep if kind == "sweep" else judged)(result, name, figure.caption)
        faults += wrong
        told += own
        if not own:
            faults.append(f"{name}: nothing was judged of: {figure.caption[:200]}")
    return faults, told


assert ENDS[-1] == seen.OF_ALL  # the sentences are those that are told
