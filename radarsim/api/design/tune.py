"""`radarsim tune`: the values of a filter's keys with which a quantity is best over a family of cases.

Where the quantity is exact, exact values are searched and compared. Elsewhere every value is simulated with the same
noise, from a seed that only the search uses; which of the searches ended best is decided with noise of another. The
gain is measured on the realisations of the config's seed, which neither has used, so that no number contains the
optimism of a minimum. There both filters see the same plots: the gain is paired."""

import math
import os
import re
import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import deepcopy
from dataclasses import replace
from typing import Any

import numpy as np

from radarsim.api import arguments, configs
from radarsim.api.configs import Config, load
from radarsim.api.design import quantities, question
from radarsim.api.design.jackknife import jackknife_interval
from radarsim.api.design.objective import BATCHES, Curve, Objective, resolve_quantity
from radarsim.api.design.quantities import MeasuredQuantity
from radarsim.api.design.question import measure_seconds
from radarsim.api.design.tuned_content import tuned_content
from radarsim.api.design.tuning_cost import FamilyCost, Variants, case_with_filters
from radarsim.api.design.tuning_intervals import (
    FLAT_CHANGE,
    equally_good,
    flat_interval,
    keys_without_effect,
    spread_of_tuning,
)
from radarsim.api.design.tuning_result import TunedKey, TunedQuantity, TuningResult, family_words
from radarsim.api.design.tuning_search import FoundMinimum, expected_places, find_minimum
from radarsim.api.design.tuning_space import (
    Path,
    Place,
    SearchedKey,
    from_scale,
    is_at_end,
    parse_range,
    rename_arguments_in_errors,
    searched_keys,
    set_at_path,
    value_at_path,
)
from radarsim.api.load_experiments import combine_overrides
from radarsim.api.repeat_command import RESULTS
from radarsim.config.experiment import Case, Experiment
from radarsim.config.identity import all_keys
from radarsim.config.labels import label
from radarsim.config.overrides import override_origin
from radarsim.config.yaml_text import one_line_yaml
from radarsim.engine.results import Axes
from radarsim.errors import ConfigError, argument
from radarsim.language.translate import plural, tr
from radarsim.report.user_filters.rival_comparison import TUNED
from radarsim.report.wording import format_number
from radarsim.studies import registry
from radarsim.studies.counted_scans import sigma_and_bias_by_scan

TUNED_OUT = f"{RESULTS}/tuned"  # where the run with tuned values writes
# More than the seed of the config: the seeds of the noise that is searched with, and that the best is chosen with.
SEARCH_SEED_OFFSET, CHOICE_SEED_OFFSET = 2**32, 2**33


def _predict(notify: Callable[[str], None], cost: FamilyCost, place_s: float) -> None:
    """Tell the user what the search will do and how long it takes, if that is long; place_s: seconds of one place."""
    first_places, full_places = expected_places(cost)
    pilot, count = (1, 1) if cost.exact else (cost.pilot_realisations, cost.count)
    for curve in cost.curves:
        curve.expected = first_places * pilot + full_places * count
    keys = plural("{count} key", "{count} keys", len(cost.searched))
    work = tr("searches {keys}, about {count} places", keys=keys, count=first_places + full_places)
    question.predict_duration(notify, work, place_s * (first_places * pilot / count + full_places))


def tuning_gains(cost: FamilyCost, names: Sequence[str], pairs: Sequence[np.ndarray]) -> list[TunedQuantity]:
    """The gain of each case, and the last of all; pairs (1 + n, 2) of each case: stated and tuned."""
    gained, sign = [], -1 if cost.definition.more_is_better else 1
    pairs_with_total = [*pairs, np.stack([cost.combined([pair[:, i] for pair in pairs]) for i in (0, 1)], axis=1)]
    for name, pair in zip((*names, ""), pairs_with_total, strict=True):
        stated, tuned = pair.T
        with np.errstate(divide="ignore", invalid="ignore"):
            gains = sign * (stated - tuned) * (100 / stated if cost.definition.kind == "size" else 1)
        ends: Sequence[float] = (
            jackknife_interval(gains[1:], float(gains[0])) if len(gains) > 1 else [float(gains[0])] * 3
        )
        gained.append(TunedQuantity(name, float(stated[0]), float(tuned[0]), *ends))
    return gained


def family_cases(
    config: Config, settings: Sequence[str], member_settings: Sequence[str], case_names: Sequence[str]
) -> tuple[list[Case], list[str]]:
    """The cases over which a filter is tuned, and the names of filters of Python, which they are without.

    members: settings of each. Raises ConfigError."""
    user_filters: list[str] = []
    cases, set_keys = [], {setting.partition("=")[0].strip() for setting in settings}
    for member_setting in member_settings:
        key = member_setting.partition("=")[0].strip()
        if key in set_keys:
            raise ConfigError(f"{argument('over', '--over')}: {key} is given by {override_origin(key)} too")
        with rename_arguments_in_errors({str(override_origin(key)): argument("over", "--over")}):
            experiment = load(config, [*settings, *([member_setting] if member_setting else [])])
        user_filters += [user_filter.name for case in experiment.cases for user_filter in case.user_filters]
        cases += [
            replace(case, name=f"{case.name} {member_setting}".strip(), further_baselines=(), user_filters=())
            for case in experiment.cases
        ]
    for name in case_names:
        quantities.check_name(name, [case.name for case in cases], "case")
    return [case for case in cases if not case_names or case.name in case_names], user_filters


def tune(
    config: Config,
    wanted: str,
    *,
    filter: str | None = None,
    over: Mapping[str, Sequence[Any]] | Sequence[str] = (),
    free: Mapping[str, Sequence[float] | None] | Sequence[str] = (),
    case: str | Sequence[str] = (),
    overrides: configs.Overrides = (),
    realisations: float | None = None,
    seed: int | None = None,
    threads: int | None = None,
    sampled: bool = False,
    progress: Callable[[int, int, int], None] | None = None,
    notify: Callable[[str], None] | None = None,
) -> TuningResult:
    """Find the values of a filter's keys with which a quantity is best, and measure what they gain.

    wanted is a quantity of `radarsim solve` with its component, and a time or scan, `"sigma r at 60 s"`, `"gain r at k
    6"`; default: the last scan. free: the keys, by name, `KEY=LOW:HIGH`, or a mapping to the range to search or None;
    default: all of the filter that are real numbers other than zero and have an effect. Elements of a matrix of
    probabilities keep columns that sum to one; zeros stay. over: the family of targets, stems of scenarios or texts
    `KEY=VALUE`, or values by key; case: some of the config's cases; default: all. Over a family the root of the mean of
    σ² is least, or the mean rate is best.

    Several searches start at places over the whole range; `search_ends` are the values at which they ended.

    If σ is not known exactly, or is to be `sampled`, the search uses `realisations` with noise of its own seed, by
    default as many as the config's. The best of its ends is chosen on as many of another seed, and the gain is measured
    on as many of the config's, stated and tuned filter on the same plots. notify is called with a line on what a search
    of some seconds will do.

    `keys` have the stated and the tuned value, `all` and `cases` the gain with its 95 % interval, in per cent of σ, of
    rates in points. Raises ConfigError for a wrong config, key, filter or quantity.

    >>> found = tune("rls2", "sigma r at 60 s", filter="r+Vr", over=["turn", "jerk_pulse"])
    >>> print(f"{found.keys[0].tuned:.3f} {found.keys[0].unit}", f"{found.all.gain:.1f} %", found.exact)
    4.187 (m/s³)² 36.3 % True
    """
    settings = combine_overrides(arguments.check_arguments(overrides, threads=threads), None, seed)
    members, ranges = _family_members(over), _ranges_by_key(free)
    cases, user_filters = family_cases(config, settings, members, [case] if isinstance(case, str) else case)
    request = quantities.parse_quantity(wanted, filter)
    quantity, _ = resolve_quantity(request, cases[0], user_filters)
    searched = _common_keys(cases, str(quantity.filter), ranges)
    count = arguments.whole_number(realisations) or cases[0].realisations
    count = BATCHES * max(2, count // BATCHES)
    variants, curves = list[Variants](), list[Curve]()
    for family_case in cases:
        variants.append(variant := Variants(family_case, str(quantity.filter), searched, quantity.definition.paired))
        quantity, _ = resolve_quantity(request, variant.base)
        curves.append(Curve(variant, "", Objective([quantity], threads), count, progress, sampled))
    exact = all(curve.exact for curve in curves)
    cost = chooser = FamilyCost(variants, curves, exact, count)
    if not exact:
        cost, chooser = cost.with_noise(SEARCH_SEED_OFFSET), cost.with_noise(CHOICE_SEED_OFFSET)
    place_s = _seconds_of_start(cost)
    inert_keys = () if ranges else keys_without_effect(cost)
    if inert_keys and (acting_keys := [key for key in searched if key not in inert_keys]):
        cost, chooser = cost.with_keys(acting_keys), chooser.with_keys(acting_keys)
    _predict(notify or (lambda line: None), cost, place_s)
    found = find_minimum(cost, chooser)
    pairs, ranges_by_path = (_judge_exactly if exact else _judge_by_sampling)(cost, found.place)
    found = found._replace(other_hollows=equally_good(chooser, found.place, found.other_hollows))
    given_settings = [setting for setting in (*settings, members[0]) if setting]
    return _tuning_result(config, cases, cost, found, inert_keys, ranges_by_path, pairs, given_settings)


def _family_members(over: Mapping[str, Sequence[Any]] | Sequence[str]) -> list[str]:
    """The setting `KEY=VALUE` of each member of the family; a single empty one where there is no family."""
    if isinstance(over, Mapping):
        pairs = [{key: value} for key, values in over.items() for value in values]
        over = [text for pair in pairs for text in arguments.check_arguments(pair)]
    arguments.check_texts(over)
    return [*dict.fromkeys(text if "=" in text else f"target={text}" for text in over)] or [""]


def _ranges_by_key(free: Mapping[str, Sequence[float] | None] | Sequence[str]) -> dict[str, tuple[float, float] | None]:
    """The range to search of each key, None for that of the search's own. Raises ConfigError for a key given twice."""
    arguments.check_texts([*free])
    pairs = [parse_range(item) for item in (free.items() if isinstance(free, Mapping) else free)]
    if len(ranges := dict(pairs)) < len(pairs):
        raise ConfigError(f"{argument('free', '--free')}: a key is given twice")
    return ranges


def _common_keys(
    cases: Sequence[Case], filter_name: str, ranges: Mapping[str, tuple[float, float] | None]
) -> tuple[SearchedKey, ...]:
    """The keys of the filter that are searched. Raises ConfigError if they differ between the cases."""
    for case in cases:
        quantities.check_name(filter_name, [member.name for member in case.spec.members])
    keys_by_case = [searched_keys(case, filter_name, ranges) for case in cases]
    if differing_paths := {key.path for keys in keys_by_case for key in {*keys} ^ {*keys_by_case[0]}}:
        text = ", ".join(".".join(map(str, path)) for path in differing_paths)
        raise ConfigError(f"{text}: differs between the cases: choose with {argument('case', '--case')}")
    return keys_by_case[0]


def _seconds_of_start(cost: FamilyCost) -> float:
    """The seconds that the quantity at the stated keys takes. Raises ConfigError if there is no estimate."""
    start = tuple(key.stated for key in cost.searched)
    seconds = measure_seconds(lambda: cost(start, 1))  # compiles
    if not cost.exact:
        seconds = measure_seconds(lambda: cost(start))
    if not math.isfinite(cost(start)):
        raise ConfigError(f"{cost.curves[0].quantity.words}: there is no estimate there")
    return seconds


def _judge_exactly(cost: FamilyCost, best: Place) -> tuple[list[np.ndarray], dict[Path, tuple[float, float]]]:
    """The exact quantity of each case with the stated and the tuned keys (1, 2); and the range of each key that is as
    good."""
    cost.rough = False
    pairs = [np.array([[curve.exact_value(None), curve.exact_value(best)]]) for curve in cost.curves]
    cost.rough = any(curve.has_rough_values for curve in cost.curves)
    ranges = {key.path: flat_interval(cost, best, i) for i, key in enumerate(cost.searched) if key.largest_path is None}
    return pairs, ranges


def _judge_by_sampling(cost: FamilyCost, best: Place) -> tuple[list[np.ndarray], dict[Path, tuple[float, float]]]:
    """The quantity of each case with the stated and the tuned keys, of all realisations and without each of the batches
    (1 + n, 2); and the 95 % interval of each key."""
    pairs = []
    for variant, curve in zip(cost.variants, cost.curves, strict=True):
        names = variant.filter_name, variant.filter_name + TUNED
        both = Objective([replace(curve.quantity, filter=name) for name in names])
        pairs.append(both.batch_values(variant.stated_and_tuned_case(best), cost.count))
    return pairs, spread_of_tuning(cost, best)


def _tuning_result(
    config: Config,
    cases: Sequence[Case],
    cost: FamilyCost,
    found: FoundMinimum,
    inert_keys: Sequence[SearchedKey],
    ranges: Mapping[Path, tuple[float, float]],
    pairs: Sequence[np.ndarray],
    settings: Sequence[str],
) -> TuningResult:
    """The result: tuned keys, gains and notes, with the command of the run that shows the gain."""
    case, quantity, stated_keys = cases[0], cost.curves[0].quantity, cost.filter_keys
    best = found.place
    filter_name = str(quantity.filter)
    (i,) = [i for i, member in enumerate(case.spec.members) if member.name == filter_name]
    prefix, tuned_keys = f"{type(case.spec).bare_keys}.{i}.", deepcopy(dict(stated_keys))
    tuned_values, keys = from_scale(cost.searched, best, stated_keys), []
    for path, value in tuned_values.items():
        set_at_path(tuned_keys, path, value)
        key = prefix + _dotted(path)
        keys.append(
            TunedKey(
                key,
                label(case.spec, key).unit,
                value_at_path(stated_keys, path),
                value,
                *ranges.get(path, (None, None)),
            )
        )
    axes = cost.curves[0].objective.labels(cost.curves[0].cases.base)
    gains = tuning_gains(cost, [family_case.name for family_case in cases], pairs)
    inert_keys = [*(key for key in inert_keys if key not in cost.searched), *keys_without_effect(cost, best)]
    inert = tuple(prefix + _dotted(searched_key.path) for searched_key in inert_keys)
    return TuningResult(
        stem=case.stem,
        filter=filter_name,
        quantity=quantity,
        unit=quantities.unit(quantity, axes),
        minimised=family_words(cost, len(cases)),
        exact=cost.exact,
        keys=tuple(keys),
        cases=tuple(gains[:-1]),
        all=gains[-1],
        training=0 if cost.exact else cost.count,
        judged=0 if cost.exact else cost.count,
        search_ends=cost.from_costs(found.end_costs),
        settings={tuned_key.key: tuned_key.tuned for tuned_key in keys},
        command=_run_command(config, settings, prefix, tuned_values, tuned_keys),
        notes=(
            *_tuning_notes(cost, best, () if {key.key for key in keys} <= {*inert} else inert, tuned_values, ranges),
            *_equality_notes(cost, found.other_hollows, ranges),
        ),
        inert=inert,
    )


def _run_command(
    config: Config, settings: Sequence[str], prefix: str, paths: Iterable[Path], tuned_keys: Mapping[str, Any]
) -> str:
    """The command of a run with the tuned keys, in a directory of its own."""
    setting_texts = list(settings)
    for path in paths:
        # An item of a list is set with the whole list, which other items of it may have changed as well.
        text = re.sub(r"(\.\d+)+$", "", _dotted(path))
        setting_texts.append(f"{prefix}{text}={one_line_yaml(value_at_path(tuned_keys, path[: text.count('.') + 1]))}")
    config_name = os.fspath(config) if isinstance(config, str | os.PathLike) else "CONFIG.yaml"
    set_options = [word for setting in dict.fromkeys(setting_texts) for word in ("--set", setting)]
    return shlex.join(["radarsim", "run", config_name, *set_options, "--out", TUNED_OUT])


def _tuning_notes(
    cost: FamilyCost,
    best: Place,
    inert: Sequence[str],
    tuned_paths: Iterable[Path],
    ranges: Mapping[Path, tuple[float, float]],
) -> list[str]:
    """Notes on keys that end at the end of their range or have no effect, and on missing intervals."""
    keys_and_values = list(zip(cost.searched, best, strict=True))
    notes = [
        tr(
            "{key} ends at {value}, the end of the searched range; --free KEY=LOW:HIGH searches elsewhere",
            key=_dotted(key.path),
            value=format_number(x),
        )
        for key, x in keys_and_values
        if is_at_end(key, x)
    ]
    quantity_words = cost.curves[0].quantity.translated_words
    notes += [tr("{key} has no effect on {quantity}", key=key, quantity=quantity_words) for key in inert]
    fixed_paths = {key.path for key, x in keys_and_values if key.search_range.whole_numbers or is_at_end(key, x)}
    if not cost.exact and any(path not in ranges and path not in fixed_paths for path in tuned_paths):
        notes.append(tr("no intervals of the values: the quantity is flat there, or too noisy to tell its curvature"))
    return notes


def _equality_notes(cost: FamilyCost, ends: Sequence[Place], ranges: Mapping[Path, tuple[float, float]]) -> list[str]:
    """A note on ends of other searches that are as good, where they lie beyond the ranges of the keys."""
    places = [from_scale(cost.searched, end, cost.filter_keys) for end in ends]
    beyond = [
        values
        for values in places
        if any(path not in ranges or not ranges[path][0] <= x <= ranges[path][1] for path, x in values.items())
    ]
    if not beyond:
        return []
    values_text = ", ".join(f"{_dotted(path)} = {format_number(x, '.3g')}" for path, x in beyond[0].items())
    percent = format_number(100 * FLAT_CHANGE)
    how = tr("to {percent} %", percent=percent) if cost.exact else tr("within the interval")
    return [
        plural(
            "{count} other start is as good {how}: {values}",
            "{count} other starts are as good {how}, the best of them at {values}",
            len(beyond),
            how=how,
            values=values_text,
        )
    ]


def _dotted(path: Path) -> str:
    """A path as a dotted key."""
    return ".".join(map(str, path))


def tune_baseline(
    experiment: Experiment, target: str | None, **tune_options: Any
) -> tuple[Experiment, list[str], tuple[str, float] | None]:
    """The experiment with each of its filters as tuned over all its cases too, why some are not, and the component and
    time, s, that they are tuned for, None if it has no component; raises ConfigError where none is.

    target: the quantity, by default σ of the first component at the last scan; tune_options: as `tune` takes it."""
    case, results, left_out = experiment.cases[0], list[TuningResult](), []
    axes = registry.study(case.study).prepare(case).axes
    target = target or f"sigma {axes.components[0][0]}"
    for member in case.spec.members:
        try:
            results.append(tune(experiment, target, filter=member.name, **tune_options))
        except ConfigError as error:
            left_out.append(tr("{filter} is not tuned: {why}", filter=member.name, why=error.lines[0]))
    if not results:
        raise ConfigError(*left_out)
    tuned_cases = []
    for family_case in experiment.cases:
        spec = family_case.spec
        members = [*map(all_keys, spec.members), *(result.member(family_case) for result in results)]
        tuned_cases.append(case_with_filters(family_case, members, getattr(spec, "baseline", None)))
    tuned = replace(experiment, cases=tuple(tuned_cases), content=tuned_content(experiment, tuned_cases))
    return tuned, left_out, _point_of(results[0].quantity, case, axes)


def judged_point(experiment: Experiment, target: str) -> tuple[str, float] | None:
    """The component, and the time in s, of a quantity such as `sigma y at 60 s`; None where it has no component.
    Raises ConfigError for an unknown one."""
    case = experiment.cases[0]
    quantity = quantities.check_quantity(quantities.parse_quantity(target, case.spec.members[0].name), case)
    axes = registry.study(case.study).prepare(case).axes
    if quantity.component is not None:
        quantities.check_name(quantity.component, [name for name, _ in axes.components], "component")
    if quantity.over == "mean":
        option = argument("wanted", "--for")
        raise ConfigError(f"{option}: a judgement is about one scan: give a time, or worst, got {target!r}")
    return _point_of(quantity, case, axes)


def _point_of(quantity: MeasuredQuantity, case: Case, axes: Axes) -> tuple[str, float] | None:
    """The component and the time, s, of a quantity; of a worst one that at which the best filter's σ is largest. None
    without a component, and of what is not at one scan."""
    if quantity.over != "at" and quantity.component:
        return _worst_point(quantity, case, axes) if quantity.over == "worst" else None
    at_s = axes.t_s[-1] if quantity.at_s is None else quantity.at_s
    at_s = at_s if quantity.at_k is None else axes.t_s[list(axes.k).index(quantity.at_k)]
    return (quantity.component, float(at_s)) if quantity.component else None


def _worst_point(quantity: MeasuredQuantity, case: Case, axes: Axes) -> tuple[str, float]:
    """By exact σ, else by that of a few realisations."""
    component = str(quantity.component)
    c = [name for name, _ in axes.components].index(component)
    sigma, _ = sigma_and_bias_by_scan(registry.study(case.study), case, axes, c)
    best = np.fmin.reduce(np.where(np.isnan(sigma), np.inf, sigma), axis=0)
    t_s = np.asarray(axes.t_s, dtype=float)
    counted = np.isfinite(best) & (t_s >= (quantity.from_s or 0.0) * (1 - 1e-12))
    return component, float(t_s[np.where(counted, best, -np.inf).argmax()])
