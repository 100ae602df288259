"""Reads sentences back: every value with an interval, and every exact one, must stand in the row that is named.

A ratio of two cases or filters is computed from σ of both. A value that is quoted as measured though its row has an
exact one is a fault, and so is a value that no row has of what the sentence names: case, filter, component, stage, time
and scan. An interval that is wider than its row's must be said to hold for all values compared. Both languages write
numbers in their own way, so that the sentences of each are read by the same tables."""

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from radarsim.api import result_content
from radarsim.language.translate import quote_name, tr, translate_names
from radarsim.report import case_selection, key_labels, statistics
from radarsim.report.exact_marks import MARK
from radarsim.report.quantities import RADIAL
from radarsim.report.statistics import Estimate
from radarsim.studies.multimodel.tables import stage_gain, stage_names
from radarsim.studies.sonar.components import COMPONENTS_BY_NAME

NUMBER = r"[−+-]?(?:\d[\d,\u202f\u00a0]*(?:\.\d+)?|∞)(?:·10[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)?"
UNIT = r"(?:°|[ \u00a0](?:%|k?m/s²|k?m/s|k?m|s|к?м/с²|к?м/с|к?м|с|Hz\S*|Гц\S*|rad\S*|рад\S*|m²|м²))?"
MEASURED = re.compile(rf"(?P<value>{NUMBER}){UNIT} \[(?P<low>{NUMBER}), (?P<high>{NUMBER})\]")
EXACT = re.compile(rf"(?P<value>{NUMBER}){UNIT}{MARK}")
FOR_ALL = re.compile(r"95[ \u00a0]% (?:for (?:all|both)|сразу для)(?: (?:всех )?(\d+))?")
RUSSIAN_COMMA = re.compile(r"(?<=\d),(?=\d)")
SUPERSCRIPTS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
TIME = re.compile(rf"(?<!= )(?<![\d.,])({NUMBER})[ \u00a0][sс](?![\w/)]| \[)")  # not (20 s), from when errors count
SCAN = re.compile(r"(?:scan|обзор\w*) (\d+)(?!\d|[.,]\d|[ \u00a0][%\[])")  # not of the worst scan 98.3 %
LAST = re.compile(r"the last scan|последн\w+ обзор")
PHASE = re.compile(rf"(?<!= )(?<![\d.,])({NUMBER})[ \u00a0][sс](?!\w)")  # the first: how long a phase of events is
FALSE_ALARMS = re.compile(rf"P_(?:FA|ЛТ) ≈ ({NUMBER})")
ABOUT = 0.11  # of the logarithm of a false alarm rate that is said to be about another one
EVENTS = {  # words of the first alarm of a phase, in every language
    "alarm by the end": "alarm",
    "тревога до конца": "alarm",
    "False alarm within": "false alarm",
    "Ложная тревога в течение": "false alarm",
}
RATIOS = {  # words of a ratio of σ, by what has it: the first one named to the second
    "case": re.compile("relative to that at|отнесённое к СКО при"),
    "filter": re.compile("times that with|больше, чем у фильтра"),
}
LABELS = ["case", "filter", "component", "k"]  # of a row of curves
SIGMA_ENDS = ("sigma", "sigma_lo", "sigma_hi")
PAIRED_SIGMA = "paired σ"
OF_THE_LAST = re.compile(r"^(?: \w+)?(?: \w+)? \([^)]*\)")  # in brackets behind a number: what that is of


def _in_percent(x):
    return 100 * x


CHANGES = (  # how sentences write a column: itself, in per cent, of a gain loss and factor, of a ratio the excess
    lambda x: x,
    _in_percent,
    lambda x: -x,
    lambda x: 1 - x / 100,
    lambda x: 100 * (x - 1),
)


def _changes(text):
    """How a number is written; one in degrees is of an angle in radians."""
    return (*CHANGES, np.degrees) if "°" in text else CHANGES


WORDS = {  # of components in English, which does not inflect them
    **{component.name: component.words for component in (*RADIAL, *COMPONENTS_BY_NAME.values())},
    **{"y": "height", "vy": "rate of climb"},
}
SWEPT = re.compile(r"\([^()]* = [^()]*\)")  # the swept values of a case, such as its range
NO_COMPONENT = re.compile(r"range alone")  # a baseline


WITHOUT_COLUMN = re.compile(r"over the bound|отнесённое к границе")  # σ over the posterior bound, which no table has


class Reading(NamedTuple):
    """What a sentence's numbers are: found in a row, contradicted by it, or in no row."""

    read: list[str]
    faults: list[str]


class Table(NamedTuple):
    """A measured column: values with their ends (n,), exact values, NaN where unknown, and the labels of its rows."""

    name: str
    value: np.ndarray
    low: np.ndarray
    high: np.ndarray
    exact: np.ndarray
    labels: pd.DataFrame
    is_joint: bool = False  # whether the ends hold for all values that the sentence says they do


def columns_of(tables) -> Iterator[Table]:
    """Each measured column of the tables with its ends and its exact column."""
    for name, table in tables.items():
        columns = [str(column) for column in table.columns]
        for value, low, high in zip(columns, columns[1:], columns[2:], strict=False):
            if low.endswith("lo") and high.endswith("hi"):
                known = [c for c in columns if c in (f"exact_{value}", f"exact_{value.removeprefix('gain_')}", "exact")]
                numbers = [pd.to_numeric(table[c], "coerce").to_numpy(float) for c in (value, low, high, *known[:1])]
                exact = numbers[3] if known else np.full(len(table), np.nan)
                yield Table(f"{name}.{value}", *numbers[:3], exact, table)


def derived_columns(tables, results=()) -> Iterator[Table]:
    """σ over what a filter believes, biases, σ by a paired gain over an exact σ, and paired gains of stages."""
    curves, gains = tables["curves"], tables["gains"]
    if "exact_sigma" not in curves:  # of a study that has bounds in its place
        curves = curves.assign(exact_sigma=np.nan)
    ratios = [curves[name].to_numpy(float) for name in SIGMA_ENDS]
    with np.errstate(divide="ignore", invalid="ignore"):
        believed = curves["believed_sigma"].to_numpy(float)
        exact = curves["exact_sigma"].to_numpy(float) / believed
        yield Table("σ over believed", *(part / believed for part in ratios), exact, curves)
    if "conversion" in tables:
        names = ("bias_m", "bias_m_lo", "bias_m_hi", "formula_m")
        biases = [tables["conversion"][name].to_numpy(float) for name in names]
        yield Table("bias of a conversion", *biases, tables["conversion"])
    if "bias_se" in curves:
        bias, half = curves["bias"].to_numpy(float), 1.96 * curves["bias_se"].to_numpy(float)
        yield Table("bias", bias, bias - half, bias + half, curves["exact_bias"].to_numpy(float), curves)
    keys = ["case", "baseline", "component", "k"]
    exact = curves.rename(columns={"filter": "baseline"})[[*keys, "exact_sigma"]]
    paired = gains.merge(exact, on=keys, how="left")
    base = paired["exact_sigma"].to_numpy(float)
    parts = [base * (1 - paired[name].to_numpy(float) / 100) for name in ("gain_percent", "gain_hi", "gain_lo")]
    yield Table(PAIRED_SIGMA, *parts, np.full(len(paired), np.nan), paired)
    for result in results if "stages" in tables else ():
        if len(result.axes.filters) > 1:
            yield _paired_stages(result)


def _paired_stages(result) -> Table:
    """The gain of every filter over every other one in every stage of a case."""
    filters, components = result.axes.filters, [name for name, _ in result.axes.components]
    numbers = [
        (f, other, s, c)
        for s in range(len(stage_names(result)))
        for c in range(len(components))
        for f in range(len(filters))
        for other in range(len(filters))
        if f != other
    ]
    gains = np.array([stage_gain(result, *each) for each in numbers], float).T
    labels = [
        {"case": result.name, "filter": filters[f], "stage": stage_names(result)[s], "component": components[c]}
        for f, _, s, c in numbers
    ]
    return Table("paired gain of a stage", *gains, np.full(len(numbers), np.nan), pd.DataFrame(labels))


def ratio_columns(sentence: str, tables, derived: Sequence[Table], names: Mapping) -> Iterator[Table]:
    """σ of the first case or filter that a sentence compares over that of the second, neither depending on the other's
    noise; measured only where one of them has no exact σ, with ends for as many values at once as the sentence says."""
    together = FOR_ALL.search(sentence)
    looks = int(together[1] or 2) if together else 1
    for label in (label for label, words in RATIOS.items() if words.search(sentence)):
        first, base, *_ = [*_mentions(sentence, names[label]), "", ""]
        sigmas, keys = _sigmas(tables, derived), [name for name in LABELS if name != label]
        pairs = sigmas[sigmas[label] == first].merge(sigmas[sigmas[label] == base], on=keys, suffixes=("", "_base"))
        exact, exact_base = pairs["exact_sigma"], pairs["exact_sigma_base"]
        is_exact = exact.notna() & exact_base.notna()
        with np.errstate(divide="ignore", invalid="ignore"):
            logs = [
                Estimate(*np.log([known.where(~is_exact).fillna(pairs[name + suffix]) for name in SIGMA_ENDS]))
                for known, suffix in ((exact, ""), (exact_base, "_base"))
            ]
            ratio = statistics.simultaneous_sizes(Estimate(*np.exp(statistics.difference(*logs))), looks)
            known_ratio = (exact / exact_base).to_numpy(float)
        yield Table("ratio of σ", *ratio, known_ratio, pairs[[*keys, "t_s"]], is_joint=True)


def _sigmas(tables, derived: Sequence[Table]) -> pd.DataFrame:
    """σ as measured, and by a paired gain, each with the exact one."""
    curves = tables["curves"]
    paired = [
        table.labels[[*LABELS, "t_s"]].assign(**dict(zip(SIGMA_ENDS, table[1:4], strict=True)))
        for table in derived
        if table.name == PAIRED_SIGMA
    ]
    sigmas = pd.concat([curves[[*LABELS, "t_s", *SIGMA_ENDS]], *paired])
    return sigmas.merge(curves[[*LABELS, "exact_sigma"]], on=LABELS)


def names_of(results: Sequence, language: str = "en") -> dict[str, dict[str, str]]:
    """What the language in use calls cases, filters, stages and components: by column of tables, the label by name."""
    cases, of_configs = dict[str, str](), result_content.config_names(results)
    for result, name in zip(results, case_selection.distinct_case_names(results), strict=True):
        described = key_labels.without_markup(key_labels.swept_description(result))
        for text in filter(None, (name, key_labels.plain_case_label(result), described, result.name)):
            translated = translate_names(text, of_configs)
            cases[translated] = result.name if cases.get(translated, result.name) == result.name else ""
    has_stages = all(result.study == "multimodel" for result in results)
    by_column = {
        "case": {text: case for text, case in cases.items() if case} if len(results) > 1 else {},
        "filter": {
            translate_names(quote_name(name), of_configs): name for result in results for name in _filters(result)
        },
        "stage": {tr(name): name for result in results for name in stage_names(result)} if has_stages else {},
        "component": {words: name for name, words in WORDS.items()} if language == "en" else {},
        "event": EVENTS,
    }
    if language != "en":
        by_column = {
            column: {_as_english(name): label for name, label in names.items()} for column, names in by_column.items()
        }
    return by_column


def _filters(result) -> list[str]:
    """Filters, a user's ones too, and detectors, which tables call filters."""
    members = [*(result.user_filters or ()), *getattr(result.spec, "detectors", ())]
    return [*result.axes.filters, *(member.name for member in members)]


def number(text: str) -> tuple[float, float]:
    """A number of a sentence, and half a unit of its last digit."""
    text = text.replace("−", "-").replace("\u202f", "").replace("\u00a0", "").replace(",", "").replace("∞", "inf")
    mantissa, _, power = text.partition("·10")
    scale = 10.0 ** int(power.translate(SUPERSCRIPTS)) if power else 1.0
    decimals = len(mantissa.partition(".")[2])
    trailing = len(mantissa) - len(mantissa.rstrip("0")) if not decimals and mantissa != "0" else 0
    return float(mantissa) * scale, 0.501 * scale * 10.0 ** (trailing - decimals)


def near(column: np.ndarray, text: str) -> np.ndarray:
    """Which values (n,) round to a number of a sentence; of its last digit by one, where ends are rounded outward."""
    value, half = number(text)
    with np.errstate(invalid="ignore"):
        return (np.abs(column - value) <= 2 * half) | (column == value)


def read_sentence(
    sentence: str, tables: Mapping, language: str = "en", derived: Sequence[Table] = (), names: Mapping | None = None
) -> Reading:
    """Each number with an interval, and each exact one, by the row that it stands in.

    derived: further columns that sentences may take their numbers from, as σ by a paired ratio. names: without them
    any row may hold a number."""
    if language != "en":
        sentence = _as_english(sentence)
    sentence, read, faults = WITHOUT_COLUMN.split(sentence)[0], [], []
    ratios = [*ratio_columns(sentence, tables, derived, names)] if names else []
    columns = ratios or [*columns_of(tables), *derived]
    matches = sorted([*MEASURED.finditer(sentence), *EXACT.finditer(sentence)], key=lambda match: match.start())
    for i, match in enumerate(matches):
        before = sentence[matches[i - 1].end() if i else 0 : match.start()]
        before = OF_THE_LAST.sub("", before) if i else before
        after = sentence[match.end() : matches[i + 1].start() if i + 1 < len(matches) else len(sentence)]
        place = _Place(before.rpartition("; ")[2], after.partition("; ")[0], sentence)
        text = match[0]
        if match.re is EXACT:
            is_known = any(
                (near(change(column.exact), match["value"]) & place.rows(column, names)).any()
                for column in columns
                for change in _changes(text)
            )
            (read if is_known else faults).append(text if is_known else f"{text}: in no exact column")
            continue
        rows = [
            row
            for column in columns
            for row in _rows(
                column, match, bool(FOR_ALL.search(sentence)) and not column.is_joint, place.rows(column, names)
            )
        ]
        if not rows:
            faults.append(f"{text}: in no row")
        elif all(not np.isnan(exact) for _, exact in rows):
            faults.append(f"{text}: measured, though {rows[0][0]} is known exactly, {rows[0][1]:.6g}")
        else:
            read.append(text)
    return Reading(read, faults)


def _as_english(sentence: str) -> str:
    """A sentence with decimal commas and intervals [1,5; 2,5] as English writes it."""
    sentence = RUSSIAN_COMMA.sub(".", sentence)
    return re.sub(rf"\[({NUMBER}); ({NUMBER})\]", r"[\1, \2]", sentence)


class _Place(NamedTuple):
    """Where a number stands: the text of its clause before it and after it, up to the next number; the sentence."""

    before: str
    after: str
    sentence: str

    def rows(self, column: Table, names: Mapping | None) -> np.ndarray:
        """Which rows (n,) of a column are of what is named: next to the number, else anywhere in the sentence."""
        chosen = np.full(len(column.labels), True)
        if names is None:
            return chosen
        for label, of_names in names.items():
            if label in column.labels:
                values = column.labels[label].to_numpy()
                of_component = (SWEPT.sub("", self.sentence),)
                parts = of_component if label == "component" else (self.before, self.after, self.sentence)
                named = next(filter(None, (_named(part, of_names) for part in parts)), set())
                if label == "component":
                    named &= set(values)
                if named and label == "filter" and "baseline" in column.labels:  # a gain is of both
                    chosen &= np.isin(values, list(named)) | np.isin(column.labels["baseline"], list(named))
                elif named:
                    chosen &= np.isin(values, list(named))
        if "false_alarm_probability" in column.labels and (rate := FALSE_ALARMS.search(self.sentence)):
            distance = np.log(column.labels["false_alarm_probability"].to_numpy(float)) - np.log(number(rate[1])[0])
            chosen &= np.abs(distance) <= ABOUT
        if "delay_s" in column.labels:
            return chosen & self._at_the_end(column.labels)
        if "t_s" in column.labels:
            times = self._numbers(TIME)
            if times:
                t_s = column.labels["t_s"].to_numpy(float)
                chosen &= np.any([np.abs(t_s - time) <= 1e-5 * max(time, 1) for time in times], axis=0)
        if "k" in column.labels:
            k = column.labels["k"].to_numpy(float)
            scans = self._numbers(SCAN)
            if scans:
                chosen &= np.isin(k, list(scans))
            elif LAST.search(f"{self.before} | {self.after}") and not self._numbers(TIME):
                chosen &= k == column.labels.groupby("case")["k"].transform("max").to_numpy(float)
        return chosen

    def _at_the_end(self, labels: pd.DataFrame) -> np.ndarray:
        """Which rows (n,) are of the last test within a phase of events, as long as the sentence says."""
        if not (phase := PHASE.search(self.sentence)):
            return np.full(len(labels), True)
        within = labels.assign(last_s=labels["delay_s"].where(labels["delay_s"] <= number(phase[1])[0]))
        last_s = within.groupby(["case", "filter", "component", "event"])["last_s"].transform("max")
        return (labels["delay_s"] == last_s).to_numpy()

    def _numbers(self, pattern: re.Pattern) -> set[float]:
        """The times or scans next to the number, else those in the sentence."""
        for part in (f"{self.before} | {self.after}", self.sentence):
            if found := {number(text)[0] for text in pattern.findall(part)}:
                return found
        return set()


def _named(text: str, names: Mapping[str, str]) -> set[str]:
    """The labels whose names stand in a text."""
    return set(_mentions(text, names))


def _mentions(text: str, names: Mapping[str, str]) -> list[str]:
    """The labels whose names stand in a text, in its order; of names within others the longest."""
    if not names:
        return []
    pattern = "|".join(re.escape(name) for name in sorted(names, key=len, reverse=True))
    text = NO_COMPONENT.sub("", text)
    return [names[match] for match in re.findall(rf"(?<![\w+])(?:{pattern})(?![\w+])", text)]


def _rows(column: Table, match: re.Match, may_be_wider: bool, chosen: np.ndarray) -> Iterator[tuple[str, float]]:
    """The name and the exact value of the chosen rows of a column that hold a value and the ends of its interval."""
    for change in _changes(match[0]):
        value, ends = change(column.value), np.sort([change(column.low), change(column.high)], axis=0)
        has_value = near(value, match["value"])
        if change is _in_percent and match["value"] in ("0", "100"):  # all or none, not nearly
            has_value &= value == float(match["value"])
        is_same = near(ends[0], match["low"]) & near(ends[1], match["high"])
        if may_be_wider:
            is_same |= (number(match["low"])[0] <= ends[0] + 1e-9) & (ends[1] - 1e-9 <= number(match["high"])[0])
        yield from ((column.name, exact) for exact in column.exact[chosen & has_value & is_same])
