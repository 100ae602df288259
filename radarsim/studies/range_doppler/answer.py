"""What the report of P1's experiments asks and answers, in sentences."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from radarsim.config.experiment import Experiment
from radarsim.language.translate import join_names, plural, quote_name, tr
from radarsim.report import compared_value, key_labels, sentences, tables, wording
from radarsim.report.quantities import SIGMA
from radarsim.report.sentences import Sentence
from radarsim.studies.range_doppler import gain_answer, settling, variance_answer
from radarsim.studies.range_doppler.config import FOLDED_STUDY, can_fold
from radarsim.studies.range_doppler.tables import Result, follows_the_model, span_mps

if TYPE_CHECKING:
    import pandas as pd


TablesByName = Mapping[str, "pd.DataFrame"]
MAX_CASES = 4  # with a broken model, or with a D_M that was looked for, each with a sentence of its own


def question(experiment: Experiment) -> str:
    """What the experiment asks, in one sentence."""
    filters = list(dict.fromkeys(f.name for case in experiment.cases for f in case.spec.filters))
    names = list(dict.fromkeys(getattr(case.spec.radar, "name", None) or case.stem for case in experiment.cases))
    if any("velocity" in f.observes for case in experiment.cases for f in case.spec.filters):
        return tr("How much does Doppler reduce the tracking errors of {radars}?", radars=key_labels.list_radars(names))
    return tr(
        "How large are the errors of {radars} with {filters}?",
        radars=key_labels.list_radars(names),
        filters=join_names([*map(quote_name, filters)]),
    )


def answer(results: Sequence[Result], tables_by_name: TablesByName) -> list[Sentence]:
    """Sentences with numbers and 95 % intervals: the gains at the last scan, component by component.

    Of cases that nothing is swept in, where there are such; with the greatest loss of any case at any scan. Further:
    the best D_M where several are tried, first where nothing but D_M is swept, and the worst error where a target
    breaks the model; the D_M that was looked for; and whether the radar's velocities are folded."""
    best = variance_answer.best_variances(results, tables_by_name)
    is_about_variance = variance_answer.sweeps_variance_only(results)
    gains = gain_answer.answer_gains(results, tables_by_name, omits_range=is_about_variance and len(best) > 1)
    return [
        *([*best, *gains] if is_about_variance else [*gains, *best]),
        *_broken_model_sentences(results, tables_by_name),
        *variance_answer.optimised_variances(results[:MAX_CASES]),
        *_ambiguity_sentences(results),
    ]


def alternatives(spec: Any, index: int) -> list[tuple[tuple[str, Any], ...]] | None:
    """Other forms of the process noise of a filter, by index, that suit a manoeuvre that begins within a scan; None of
    one that measures no more than the baseline."""
    baseline = spec.baseline or spec.filters[0].name
    if any(len(f.observes) >= len(spec.filters[index].observes) for f in spec.filters if f.name == baseline):
        return None
    given = getattr(spec.filters[index], "process_noise", None)
    forms = () if given is None else ("white_jerk", "white_acceleration")
    return [((f"filters.{index}.process_noise", form),) for form in forms if form != given]


def _broken_model_sentences(results: Sequence[Result], tables_by_name: TablesByName) -> list[Sentence]:
    """Where a target breaks the model: the worst σ of the range and the largest bias of each filter, from the scan on
    that counts."""
    compared = {member.name for members in variance_answer.cases_over_variance(results).values() for member in members}
    broken = [result for result in results if not follows_the_model(result) and result.name not in compared]
    rows = tables.group_by(tables.select_rows(tables_by_name["curves"], component="r"), "case", "filter")
    broken_sentences = []
    for result in broken[:MAX_CASES]:
        counted = settling.case_scans(result.spec, result.axes.manoeuvre_variance, component=0)
        clauses = [
            _worst_errors(filter_rows[filter_rows["k"] >= counted.k], name)
            for name in result.axes.filters
            for filter_rows in [rows[result.name, name]]
        ]
        text = tr(
            "{case}, {since}: {filters}.",
            case=key_labels.plain_case_label(result),
            since=wording.since(*counted),
            filters=sentences.join("; ", clauses).text,
        )
        broken_sentences.append(sentences.compose(text, clauses))
    if omitted_count := len(broken) - len(broken_sentences):
        text = plural(
            "{count} further case breaks the model: see curves.csv.",
            "{count} further cases break the model: see curves.csv.",
            omitted_count,
        )
        broken_sentences.append(Sentence(text))
    return broken_sentences


def _worst_errors(rows: "pd.DataFrame", filter_name: str) -> Sentence:
    """The largest σ and the largest bias of a filter over some scans, as a clause."""
    worst, sigma = compared_value.extreme(rows, SIGMA)
    most_biased, bias = compared_value.largest_bias(rows)
    text = tr(
        "largest RMS range error {sigma} at {t_s:g} s, largest bias {bias} at {bias_t_s:g} s{chosen}",
        sigma=sigma.text(tr("m")),
        t_s=worst["t_s"],
        bias=bias.text(tr("m")),
        bias_t_s=most_biased["t_s"],
        chosen=sigma.choice_remark() or bias.choice_remark(),
    )
    return Sentence(f"{quote_name(filter_name)}: {text}", sigma.intervals)


def _ambiguity_sentences(results: Sequence[Result]) -> list[Sentence]:
    """That velocities are not folded, where the repetition rate that a config gives would fold the target's."""
    spans: dict[str, str] = {}
    for result in results:
        if "repetition_rate_hz" in result.spec.radar.model_fields_set and (result.axes.observes == 2).any():
            span, speed = span_mps(result), result.axes.speed_mps
            if 2 * speed < span:
                continue
            text = tr(
                "an unambiguous interval of {span:.4g} m/s, which folds the target's {speed:.4g} m/s",
                span=span,
                speed=speed,
            )
            spans.setdefault(key_labels.without_markup(key_labels.config_device(result)), text)
    if not spans:
        return []
    assumption = tr(
        "Velocities are assumed unambiguous; the repetition rate alone distinguishes only λF/2 ({spans}).",
        spans="; ".join(f"{name}: {span}" for name, span in spans.items()),
    )
    if not all(can_fold(result.spec) for result in results):
        return [Sentence(assumption)]
    advice = tr(
        "With folded velocities: the same command with {setting}.", setting=f"--set {FOLDED_STUDY} --out folded"
    )
    return [Sentence(assumption), Sentence(advice)]
