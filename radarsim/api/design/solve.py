"""`radarsim solve`: the value of a numeric key at which a quantity reaches a target.

If the quantity is known exactly, the value is the root of the exact function. Otherwise the quantity is simulated, with
the same noise at every value (`sampled_solve`)."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

from radarsim.api import arguments, configs
from radarsim.api.configs import Config
from radarsim.api.design import quantities, root_search, solve_answer
from radarsim.api.design.objective import ROUGH_VALUES, Curve, Objective, resolve_quantity
from radarsim.api.design.quantities import QuantityName
from radarsim.api.design.question import (
    JUMP_NOTE,
    WHOLE_NUMBER_NOTE,
    Cases,
    Question,
    boundary_note,
    check_effect,
    first_attaining,
    key_range,
    make_answer,
    measure_seconds,
    nearest_value,
    predict_duration,
    question_fields,
    scan_options,
    undefined_error,
)
from radarsim.api.design.sampled_solve import solve_by_sampling
from radarsim.api.design.solve_answer import Answer
from radarsim.api.load_experiments import combine_overrides
from radarsim.config import numeric_keys
from radarsim.config.labels import label
from radarsim.errors import ConfigError, argument
from radarsim.language.translate import tr
from radarsim.report.statistics import Estimate
from radarsim.studies import registry

DERIVATIVE_STEP = 1e-4  # of a value: the step of a derivative
JUMP = (
    1e-4  # of a quantity: larger changes may be jumps of means over detection patterns, when other patterns are merged
)
STEP = 1e-3  # on the scale of the search, the step of a rough derivative
ROUGH_VALUES_PER_PLACE = 2  # rough values for each place of the scan, including those around roots and turns
LENGTH_KEYS = {"scans", "duration_s"}  # of the run
TIME_KEYS = LENGTH_KEYS | {"radar.scan_period_s", "sensor.scan_period_s"}  # which move the last scan
TINY = 1e-300  # instead of zero
CLOSING_VALUES = 12  # values, besides those of the scan, to close a bracket to rounding and take the slope
TARGET_TOLERANCE = (
    1e-10  # of the quantity: distance from the target at which a search ends; rough values jump by 1e-4 anyway
)
ROUGH_WIDTH = 1e-4  # relative width to which a rough root is closed
DOUBTFUL_DISTANCE = (
    0.01  # of the quantity: a rough search that comes this near to the target without a root is repeated exactly
)


def solve(
    config: Config,
    key: str,
    *,
    equals: float,
    wanted: str | None = None,
    filter: str | None = None,
    at_s: float | None = None,
    at_k: int | None = None,
    between: tuple[float, float] | None = None,
    case: str | None = None,
    overrides: configs.Overrides = (),
    realisations: float | None = None,
    seed: int | None = None,
    threads: int | None = None,
    sampled: bool = False,
    progress: Callable[[int, int, int], None] | None = None,
    notify: Callable[[str], None] | None = None,
    **quantity: str | None,
) -> Answer:
    """Find the value of a key at which a quantity equals `equals`, in its unit; gains and rates in per cent.

    wanted says the quantity, as in `tune`: `"sigma r at 60 s"`, `"worst sigma r from 60 s"`, `"sigma r in the long
    run"`. Or it is given as an argument named after an option of `radarsim solve`: `gain="r"` or `sigma="Vr"` of a
    component, for the `filter`; or a rate of a filter, `lock="sequence"`, `loss="nearest"`, …, taken at time at_s, s,
    or at scan at_k, counted from 1; default: the last scan. between: the range of the key to search. case: the case, if
    the config has several. realisations: the number for each simulated value, if nothing exact is known; sampled:
    simulate even if it is. notify is called with a line on what a search of some seconds will do.

    `value` lies between `lo` and `hi` (95 %; equal where `exact`). If the target cannot be attained, value is None, and
    limit, at limit_at, is the nearest attainable value. Raises ConfigError for a wrong config, key, filter or quantity.

    >>> answer = solve("rls2", "radar.sigma_velocity_mps", gain="r", filter="r+Vr", at_s=60, equals=30)
    >>> print(f"{answer.value:.4f} {answer.unit}", answer.exact)
    13.7212 m/s True
    """
    requested = {name: value for name, value in quantity.items() if value is not None}
    if len(requested) + (wanted is not None) != 1:
        given_names = ", ".join([*requested, *([argument("wanted", "--for")] if wanted is not None else [])]) or "none"
        examples = f"{argument('wanted=…', '--for')}, {argument('sigma=…', '--sigma')}, {argument('gain=…', '--gain')}"
        raise ConfigError(f"name one quantity, as `radarsim solve --help` lists them: {examples}, …; got {given_names}")
    texts = combine_overrides(
        arguments.check_arguments(overrides, threads=threads, equals=equals, **scan_options(at_s, at_k)), None, seed
    )
    if not isinstance(key, str):
        raise ConfigError(f"key: must be text, got {key!r}")
    if between is not None and not arguments.is_pair(between):
        raise ConfigError(f"between: must be two rising numbers, got {between!r}")
    if not math.isfinite(equals):
        raise ConfigError(f"{argument('equals')}: must be a finite number, got {equals:g}")
    if wanted is None:
        ((name, component),) = requested.items()
        request = QuantityName(name, filter, component, at_s, at_k)
    else:
        request = quantities.parse_request(wanted, filter, at_s, at_k)
    cases, count = Cases(config, texts, case), arguments.whole_number(realisations)
    matching_keys = numeric_keys.find_numeric_keys(cases.base.spec, key)
    measured, axes = resolve_quantity(request, cases.base, cases.user_filters)
    objective, moves_scans = Objective([measured], threads), key in TIME_KEYS
    search_range = key_range(matching_keys, key, between)
    curve = Curve(cases, key, objective, count or cases.base.realisations, progress, sampled)
    config_value = matching_keys[0].value if len({numeric_key.value for numeric_key in matching_keys}) == 1 else None
    has_last_s = len(axes.t_s) and not moves_scans and not objective.is_limit(cases.base)
    question = Question(
        cases,
        key,
        replace(measured, settled_s=None) if moves_scans else measured,
        equals,
        search_range,
        config_value,
        quantities.unit(measured, axes),
        texts,
        count,
        last_s=float(axes.t_s[-1]) if has_last_s else None,
        settled=moves_scans or objective.is_settled(cases.base),
    )
    work = _solve_exactly if curve.exact else solve_by_sampling
    return work(question, curve, notify or (lambda line: None))


def _solve_exactly(question: Question, curve: Curve, notify: Callable[[str], None]) -> Answer:
    """The answer if the quantity is known exactly."""
    attained_now = curve.exact_value(None)
    grid = question.search_range.grid()
    curve.expected = len(grid) + CLOSING_VALUES
    study = registry.study(question.cases.base.study)
    base = curve.objective.shortened(question.cases.base)
    curve.has_rough_values &= not question.search_range.whole_numbers
    probe_value = grid[len(grid) // 3]  # not the config's own value, which a study may have cached
    approximation = study.exact_but_for(base)
    rough_value_s = measure_seconds(partial(curve.roughly, probe_value))
    # One exact value more than the search needs, if a value may take seconds; if each pattern of plots is followed, a
    # value takes a twentieth of a second.
    exact_value_s = (
        measure_seconds(partial(curve.exact_value, probe_value)) if approximation or not curve.has_rough_values else 0.0
    )
    fields = question_fields(question)
    work = tr("computes the {quantity} at about {count} values of {key}", **fields, count=curve.expected)
    seconds = CLOSING_VALUES * exact_value_s + len(grid) * (
        ROUGH_VALUES_PER_PLACE * rough_value_s if curve.has_rough_values else exact_value_s
    )
    predict_duration(notify, work + (tr(", each {near}", near=tr(approximation)) if approximation else ""), seconds)
    try:
        search_result = roots(question, curve)
    except root_search.UndefinedFunctionError:
        raise undefined_error(question, curve) from None
    realisations = (
        ROUGH_VALUES if curve.has_rough_values else 0
    )  # both kinds differ a little where the key has no effect
    check_effect(question, [(x, estimate.value) for (x, n), estimate in curve.estimates.items() if n == realisations])
    values = search_result.roots
    if question.search_range.whole_numbers:
        values = tuple(dict.fromkeys(first_attaining(question, x, curve.exact_value) for x in values))
    answer = partial(make_answer, question, attained_now, exact=True)
    if not values:
        limit = search_result.nearest_value + question.equals
        notes = boundary_note(question, curve, search_result.nearest) + _long_run_notes(question, curve)
        return answer(limit=limit, limit_at=search_result.nearest, notes=notes)
    value = nearest_value(values, question)
    approximation = study.exact_but_for(curve.objective.shortened(question.cases.case_with_value(question.key, value)))
    attained = curve.exact_value(value)
    is_jump = not question.search_range.whole_numbers and abs(attained - question.equals) > JUMP * max(
        abs(question.equals), abs(attained_now)
    )
    return answer(
        solution=Estimate(value, value, value),
        attained=attained,
        slope=None if is_jump else slope(curve.exact_value, value, question.search_range),
        other_values=tuple(x for x in values if x != value),
        notes=((JUMP_NOTE,) if is_jump else ())
        + ((WHOLE_NUMBER_NOTE,) if question.search_range.whole_numbers and attained != question.equals else ())
        + ((tr("σ is {what}", what=tr(approximation)),) if approximation else ()),
    )


def _long_run_notes(question: Question, curve: Curve) -> tuple[str, ...]:
    """What is attainable in the long run, of a target that is not attainable at a time; none where that is unknown."""
    case = question.cases.base
    if question.quantity.over != "at" or not curve.objective.is_planned:
        return ()
    quantity = replace(question.quantity, over="long run", at_s=None, at_k=None)
    try:
        long_run = Curve(question.cases, question.key, Objective([quantity]), curve.realisations)
        long_run.has_rough_values &= not question.search_range.whole_numbers
        result = roots(replace(question, quantity=quantity), long_run)
    except (ConfigError, root_search.UndefinedFunctionError):
        return ()
    at = nearest_value(result.roots, question) if result.roots else result.nearest
    fields = {"key": question.key, "at": solve_answer.with_unit(at, label(case.spec, question.key).unit)}
    if result.roots:
        return (tr("in the long run {key} = {at} attains it", **fields),)
    limit = solve_answer.with_unit(result.nearest_value + question.equals, question.unit)
    if question.key in LENGTH_KEYS:
        return (tr("in the long run it is {limit}", limit=limit),)
    return (tr("in the long run the nearest is {limit}, at {at}", limit=limit, **fields),)


def roots(question: Question, curve: Curve) -> root_search.Roots:
    """The values at which the exact quantity reaches the target; searched roughly first if that is much cheaper.

    Raises root_search.UndefinedFunctionError if the quantity has no value on the range."""

    def difference(x: float) -> float:
        return curve.exact_value(x) - question.equals

    if not curve.has_rough_values:
        return root_search.find_roots(difference, question.search_range)
    size = max(abs(question.equals), TINY)
    rough_roots = root_search.find_roots(
        lambda x: curve.roughly(x) - question.equals, question.search_range, ROUGH_WIDTH
    )
    refined = [
        refine_rough_root(difference, curve, question.search_range, x, TARGET_TOLERANCE * size)
        for x in rough_roots.roots
    ]
    exact_roots = [x for x in refined if x is not None]
    if len(exact_roots) < len(refined) or (not refined and abs(rough_roots.nearest_value) < DOUBTFUL_DISTANCE * size):
        return root_search.find_roots(difference, question.search_range)
    return root_search.Roots(
        tuple(exact_roots),
        rough_roots.nearest,
        rough_roots.nearest_value if exact_roots else difference(rough_roots.nearest),
    )


def refine_rough_root(
    difference: Callable[[float], float], curve: Curve, search_range: root_search.Range, x: float, near_enough: float
) -> float | None:
    """The root near a rough one: by secants, the first from the rough quantity; if they fail, bracketed."""
    u = search_range.to_scale(x)
    ends = search_range.from_scale(u - STEP), search_range.from_scale(u + STEP)
    low, high = (curve.roughly(end) for end in ends)
    rising = (high - low) / (search_range.to_scale(ends[1]) - search_range.to_scale(ends[0]))
    root = root_search.refine_root(difference, search_range, x, rising, near_enough)
    return root_search.find_root_near(difference, search_range, x, near_enough) if root is None else root


def slope(function: Callable[[float], float], value: float, search_range: root_search.Range) -> float | None:
    """The change of a function for one unit of the key, by a central difference within the range; one-sided at an end.
    Error of the order of 1e-8 of itself; of whole numbers the change to the next."""
    step = DERIVATIVE_STEP * (abs(value) or 1.0)
    low, high = max(value - step, search_range.low), min(value + step, search_range.high)
    if search_range.whole_numbers:
        low, high = value, min(value + 1, search_range.high)
    if math.isnan(function(low)):
        low = value
    if math.isnan(function(high)):
        high = value
    if low == high or math.isnan(function(low)) or math.isnan(function(high)):
        return None
    return (function(high) - function(low)) / (high - low)
