"""What helps a filter that is worse than the baseline: a larger process noise, or another setting, is tried.

An error that the filter does not allow for, as a manoeuvre or a wrong fold, costs it more the smaller its process noise
is, and the more it measures."""

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from radarsim.config.experiment import Case
from radarsim.config.study_keys import is_process_noise, process_noise_key
from radarsim.engine.results import CaseResult
from radarsim.errors import ConfigError
from radarsim.language.numerals import numeral
from radarsim.language.translate import join_names, tr
from radarsim.report import compared_value, key_labels, tables
from radarsim.report.quantities import GAIN, SIGMA
from radarsim.report.sentences import Sentence
from radarsim.studies.counted_scans import manoeuvre_scan
from radarsim.studies.interface import Study

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pandas as pd

VARIANCE_FACTORS = (10.0, 100.0, 1e3, 1e4)  # tried, times a variance; times a standard deviation their roots
TRIAL_REALISATIONS = 400
MAX_TRIAL_REALISATIONS = 4096
MIN_LOSS, MIN_GAIN = 1.0, 1.0  # per cent: what is a loss; from which gain on settings help

Settings = tuple[tuple[str, Any], ...]  # values by dotted key


class Trial(NamedTuple):
    """The gain over the baseline in the first component, per cent: at the last scan; of the worst errors from the
    manoeuvre on, not-a-number without one."""

    last: float
    worst: float

    @property
    def smaller_gain(self) -> float:
        return self.last if math.isnan(self.worst) else min(self.last, self.worst)


def remedy_sentence(
    study: Study,
    results: Sequence[CaseResult[Any]],
    tables_by_name: "Mapping[str, pd.DataFrame]",
    alternatives: Callable[[Any, int], Sequence[Settings] | None],
) -> list[Sentence]:
    """What helps the first filter that measures more than the baseline and is surely worse, where its process noise is
    not swept.

    alternatives: of a case's keys and a filter's index, what is tried with and without a larger process noise, where
    that alone does not help; None of a filter that measures no more."""
    for result in results:
        if any(is_process_noise(type(result.spec), key.rpartition(".")[2]) for key, _ in result.swept_values):
            continue
        baseline = result.axes.filters[result.axes.baseline]
        for i, member in enumerate(result.spec.members):
            key, others = process_noise_key(member), alternatives(result.spec, i)
            if key and others is not None and _is_worse(study, result, member.name, baseline, tables_by_name):
                return [_sentence(study, result, i, _candidates(result.spec, i, key, others))]
    return []


def _is_worse(
    study: Study, result: CaseResult[Any], name: str, baseline: str, tables_by_name: "Mapping[str, pd.DataFrame]"
) -> bool:
    """Whether a filter surely loses at the last scan, or at the worst one from the manoeuvre on."""
    component = result.axes.components[0][0]
    labels = {"case": result.name, "component": component}
    gains = tables.select_rows(tables_by_name["gains"], filter=name, baseline=baseline, **labels)
    if not len(gains):
        return False
    if compared_value.row_value(gains.iloc[-1], GAIN).estimate.hi < -MIN_LOSS:
        return True
    if (since := _manoeuvre_scan(study, result.spec, result.axes.t_s)) is None:
        return False
    rows = [tables.select_rows(tables_by_name["curves"], filter=each, **labels) for each in (name, baseline)]
    own, other = (compared_value.extreme(part[part["k"] >= since], SIGMA)[1] for part in rows)
    is_over = own.value > other.value * (1 + MIN_LOSS / 100)
    return is_over and compared_value.are_distinguished(own, other)


def _manoeuvre_scan(study: Study, spec: Any, t_s: np.ndarray) -> int | None:
    return manoeuvre_scan(study.manoeuvre_start_s(spec), np.asarray(t_s, dtype=float))


def _candidates(spec: Any, index: int, key: str, alternatives: Sequence[Settings]) -> list[list[Settings]]:
    """What is tried, in groups, of which the first that helps is taken."""
    given = getattr(spec.members[index], key)
    roots = [math.sqrt(factor) if key.startswith("sigma") else factor for factor in VARIANCE_FACTORS]
    noises: list[Settings] = [
        ((f"{spec.bare_keys}.{index}.{key}", float(f"{factor * given:.2g}")),) for factor in roots
    ]
    both = [settings + noise for settings, noise in product(alternatives, noises)]
    return [group for group in (noises, list(alternatives), both) if group]


def _sentence(study: Study, result: CaseResult[Any], index: int, groups: Sequence[Sequence[Settings]]) -> Sentence:
    """The settings with which the filter gains most, and how much; or that none of those tried helps."""
    count = min(max(result.count, TRIAL_REALISATIONS), MAX_TRIAL_REALISATIONS)
    fields = {"case": key_labels.plain_case_label(result), "filter": result.spec.members[index].name, "count": count}
    for group in groups:
        trials = {settings: _trial(study, result.spec, index, settings, TRIAL_REALISATIONS) for settings in group}
        best = max(trials, key=lambda settings: trials[settings].smaller_gain)
        trial = _trial(study, result.spec, index, best, count) if trials[best].smaller_gain > MIN_GAIN else trials[best]
        if trial.smaller_gain > MIN_GAIN:
            text = tr(
                "{case}, {filter}: {settings} --out cured helps: {gains} ({count} trials).",
                settings=" ".join(f"--set {key}={_option_text(value)}" for key, value in best),
                gains=_gains_text(trial),
                **fields,
            )
            return Sentence(text)
    tried: dict[str, list[str]] = {}
    for key, value in dict.fromkeys(pair for group in groups for settings in group for pair in settings):
        name = key_labels.without_markup(key_labels.key_symbol(result, key))
        tried.setdefault(name, []).append(key_labels.value_with_unit(result, key, value))
    text = tr(
        "{case}, {filter}: nothing helps of what was tried on {count} realisations: {tried}.",
        tried="; ".join(f"{name} = {join_names(values)}" for name, values in tried.items()),
        **fields | {"count": TRIAL_REALISATIONS},
    )
    return Sentence(text)


def _option_text(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _gains_text(trial: Trial) -> str:
    last = tr("the gain is {gain} % at the last scan", gain=numeral(f"{trial.last:.0f}"))
    if math.isnan(trial.worst):
        return last
    return tr("{last}, {gain} % at worst from the manoeuvre on", last=last, gain=numeral(f"{trial.worst:.0f}"))


@lru_cache(maxsize=64)  # the answer is made for the page, and again where a program asks for it
def _trial(study: Study, spec: Any, index: int, settings: Settings, count: int) -> Trial:
    """What a filter gains over the baseline with other values of keys; endless losses where they are impossible."""
    other = next(member for member in spec.members if member.name == (spec.baseline or spec.members[0].name))
    own = spec.members[index]
    changes: dict[str, Any] = {}
    for path, value in settings:
        part, *_, key = path.split(".")
        if part == spec.bare_keys:
            own = own.model_copy(update={key: value})
        else:
            changes[part] = getattr(spec, part).model_copy(update={key: value})
    changed = spec.model_copy(update={**changes, spec.bare_keys: (other, own), "baseline": other.name})
    try:
        plan = study.prepare(Case("trial", "trial", study.name, changed, (), count, 1))
    except ConfigError:
        return Trial(-math.inf, math.nan)
    sums = plan.layout.unpack(study.simulate(plan, 0, count))
    result = CaseResult("trial", study.name, changed, (), count, sums, plan.axes)
    rows = tables.select_rows(study.curves([result]), component=plan.axes.components[0][0])
    sigmas = tables.exact_first(rows, "sigma", "exact_sigma")
    is_other, is_own = (rows["filter"].eq(name).to_numpy() for name in (other.name, own.name))
    worst = math.nan
    if (since := _manoeuvre_scan(study, changed, plan.axes.t_s)) is not None:
        is_late = rows["k"].to_numpy() >= since
        worst = 100 * (1 - float(np.nanmax(sigmas[is_own & is_late]) / np.nanmax(sigmas[is_other & is_late])))
    last = 100 * (1 - float(sigmas[is_own][-1] / sigmas[is_other][-1]))
    return Trial(-math.inf if math.isnan(last) else last, worst)
