"""A question about a key: the cases with its values, its range, and what an answer says."""

import math
import os
import shlex
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import SupportsFloat

from radarsim.api.configs import Config, load
from radarsim.api.design import root_search
from radarsim.api.design.objective import Curve
from radarsim.api.design.quantities import MeasuredQuantity
from radarsim.api.design.solve_answer import Answer, number, rounded
from radarsim.api.repeat_command import RESULTS
from radarsim.config import numeric_keys
from radarsim.config.experiment import Case, Experiment
from radarsim.config.find_files import did_you_mean
from radarsim.config.labels import label
from radarsim.config.overrides import override_origin
from radarsim.errors import ConfigError, argument
from radarsim.language.translate import term, tr
from radarsim.report.statistics import Estimate

SOLVED_OUT = f"{RESULTS}/solved"  # where the run that confirms an answer writes
SEARCH_FACTOR = 1000.0  # the search goes from a thousandth of a positive key's value to a thousand times it
WHOLE_NUMBER_NOTE = term("the nearest whole number that is at least as good as the target")
MAX_NAMED_CASES = 6  # cases listed in a message
JUMP_NOTE = term("the quantity jumps over the target there")
ROUNDING_CHANGE = 1e-12  # relative change of a quantity that may be rounding
MIN_PREDICTED_S = 2.0  # duration of a search from which it is predicted


@dataclass
class Cases:
    """A case of a config, `base`, and the same case with other values at a key. All share the noise of the base, even
    where the value changes the world."""

    config: Config
    overrides: tuple[str, ...]
    name: str | None = None
    base: Case = field(init=False)
    user_filters: tuple[str, ...] = field(init=False)  # filters written in Python, which the cases do not hold
    stem: str = field(init=False)  # of the config, if it has one case; else of the case

    def __post_init__(self) -> None:
        experiment = load(self.config, self.overrides)
        self.base = self._select_case(experiment)
        self.user_filters = tuple(user_filter.name for case in experiment.cases for user_filter in case.user_filters)
        self.stem = experiment.stem if len(experiment.cases) == 1 else self.base.stem

    def _select_case(self, experiment: Experiment) -> Case:
        cases_by_name = {case.name: case for case in experiment.cases}
        if self.name is None and len(cases_by_name) == 1:
            return replace(experiment.cases[0], user_filters=())
        if self.name is None:
            choices = ", ".join(repr(name) for name in list(cases_by_name)[:MAX_NAMED_CASES]) + (
                ", …" if len(cases_by_name) > MAX_NAMED_CASES else ""
            )
            raise ConfigError(
                f"{experiment.stem} has {len(cases_by_name)} cases: choose one with {argument('case')}: {choices}"
            )
        if self.name not in cases_by_name:
            suggestion = did_you_mean(self.name, cases_by_name) or f"; there are: {', '.join(cases_by_name)}"
            raise ConfigError(f"no case {self.name!r} in {experiment.stem}{suggestion}")
        return replace(cases_by_name[self.name], user_filters=())

    def case_with_value(self, key: str, value: float) -> Case:
        """The case with another value at a key. Raises ConfigError where the config refuses it."""
        setting = self._setting(key, value)
        key = setting.partition("=")[0]
        try:
            return replace(self._select_case(load(self.config, (*self.overrides, setting))), noise_keys=self.base.spec)
        except ConfigError as error:
            raise ConfigError(*(_drop_argument_name(line, key) for line in error.lines)) from error

    def _setting(self, key: str, value: float) -> str:
        """A key's setting; for an item of a list the whole list, which the config may give in degrees or leave out."""
        holder, _, index = key.rpartition(".")
        if not index.isdecimal():
            return f"{key}={_yaml(value)}"
        items = {
            item.path: item.value
            for item in numeric_keys.numeric_keys(self.base.spec)
            if item.path.rpartition(".")[0] == holder
        }
        expected_paths = [f"{holder}.{i}" for i in range(len(items))]
        if list(items) != expected_paths or None in items.values():
            return f"{key}={_yaml(value)}"
        values = (value if path == key else item_value for path, item_value in items.items())
        return f"{holder}=[{', '.join(_yaml(number) for number in values if number is not None)}]"


def _drop_argument_name(line: str, key: str) -> str:
    """A message about a key's value without the name of an argument that the user did not give.

    >>> line = "overrides['filters.0.orders']: filters.0.orders.0: must be <= 2, got 3"
    >>> _drop_argument_name(line, "filters.0.orders")
    'filters.0.orders.0: must be <= 2, got 3'
    """
    origin = f"{override_origin(key)}: "
    if not line.startswith(origin):
        return line
    message = line.removeprefix(origin)
    return message if message.startswith(f"{key}.") else f"{key}: {message}"


def _yaml(value: float) -> str:
    """A number as a config writes it: whole numbers without a point."""
    return repr(int(value)) if float(value).is_integer() and abs(value) < 1e15 else repr(float(value))


@dataclass(frozen=True)
class Question:
    """A parsed question: cases, key, target and range."""

    cases: Cases
    key: str
    quantity: MeasuredQuantity
    equals: float
    search_range: root_search.Range
    config_value: float | None
    unit: str
    overrides: tuple[str, ...]
    realisations: int | None = None
    last_s: float | None = None
    settled: bool = True

    def command(self, value: float) -> str:
        """The run that confirms a value, with independent noise and the requested number of realisations, in a
        directory of its own: the usual one may hold the config's results."""
        config_name = self.cases.config if isinstance(self.cases.config, str | os.PathLike) else "CONFIG.yaml"
        settings = [*self.overrides, f"{self.key}={number(value)}"]
        realisations_option = [] if self.realisations is None else ["-n", str(self.realisations)]
        set_options = [word for setting in settings for word in ("--set", setting)]
        return shlex.join(
            ["radarsim", "run", os.fspath(config_name), *set_options, "--out", SOLVED_OUT, *realisations_option]
        )


def key_range(
    keys: Sequence[numeric_keys.NumericKey],
    name: str,
    between: tuple[float, float] | None,
    factor: float = SEARCH_FACTOR,
) -> root_search.Range:
    """The search range of a key, up to `factor` times its value if it has no bounds. Raises ConfigError where it has
    neither bounds nor a starting value."""
    key, values = keys[0], [numeric_key.value for numeric_key in keys if numeric_key.value]
    if between is not None:
        low, high = between
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise ConfigError(f"{argument('between')}: must be two rising numbers, got {low:g} {high:g}")
        if key.is_whole:
            low, high = float(math.ceil(low)), float(math.floor(high))
            if low > high:
                ends_text = " ".join(f"{end:g}" for end in between)
                raise ConfigError(
                    f"{argument('between')}: {name} takes whole numbers, and there is none from {ends_text}"
                )
        return root_search.search_range(low, high, key.is_whole)
    if math.isfinite(key.low) and math.isfinite(key.high) and not key.is_whole:
        return root_search.search_range(key.low, key.high)
    if not values:
        reason = "there is no value to search about" if key.value is None else f"is {key.value:g} in the config"
        raise ConfigError(f"{name}: {reason}, and its own range has no end: give {range_option()}")
    if key.low >= 0:
        low, high = max(rounded(min(values) / factor), key.low), min(rounded(max(values) * factor), key.high)
        return root_search.search_range(
            math.ceil(low) if key.is_whole else low, math.floor(high) if key.is_whole else high, key.is_whole
        )
    size = 10 * max(map(abs, values))
    return root_search.search_range(max(-size, key.low), min(size, key.high), key.is_whole)


def range_option() -> str:
    """The argument that sets the search range."""
    return argument("between=(low, high)", "--between LO HI")


def predict_duration(notify: Callable[[str], None], work: str, seconds: float) -> None:
    """Tell the user the work and the duration of a search, if it is long."""
    if seconds > MIN_PREDICTED_S:
        notify(tr("{what}: about {seconds:.0f} s", what=work, seconds=seconds))


def question_fields(question: Question) -> dict[str, str]:
    """The quantity and the key, as fields of a sentence."""
    return {"quantity": question.quantity.translated_words, "key": question.key}


def make_answer(
    question: Question,
    attained_now: float,
    *,
    exact: bool,
    solution: Estimate | None = None,
    attained: float | None = None,
    slope: float | None = None,
    other_values: tuple[float, ...] = (),
    limit: float | None = None,
    limit_at: float | None = None,
    notes: tuple[str, ...] = (),
) -> Answer:
    """An answer to the question: the solution with its interval, or the nearest attainable value `limit`."""
    value = None if solution is None else solution.value
    confirmed_value = limit_at if value is None else value
    assert confirmed_value is not None  # there is a solution or a limit
    return Answer(
        key=question.key,
        unit=label(question.cases.base.spec, question.key).unit,
        quantity=question.quantity,
        quantity_unit=question.unit,
        equals=question.equals,
        now=question.config_value,
        attained_now=attained_now,
        value=value,
        lo=None if solution is None else solution.lo,
        hi=None if solution is None else solution.hi,
        exact=exact,
        attained=attained,
        slope=slope,
        other_values=other_values,
        limit=limit,
        limit_at=limit_at,
        low=question.search_range.low,
        high=question.search_range.high,
        command=question.command(confirmed_value),
        notes=notes,
        last_s=question.last_s,
        settled=question.settled,
    )


def undefined_error(question: Question, curve: Curve) -> ConfigError:
    """The error that says why the quantity has no value on the range, with the reason of the config if it has one."""
    if curve.refusals:
        x, error = min(curve.refusals.items(), key=lambda refusal: refusal[0])
        lines = (
            line if line.startswith(question.key) else f"with {question.key}={number(x)}: {line}"
            for line in error.lines
        )
        return ConfigError(*dict.fromkeys(lines))
    return ConfigError(f"{question.quantity.words}: there is no estimate there, whatever {question.key} is")


def check_effect(question: Question, points: Iterable[tuple[float, float]]) -> None:
    """Raise ConfigError if the quantity is the same at all points (key, quantity) that have an estimate."""
    key_values, quantity_values = zip(*((x, y) for x, y in points if not math.isnan(y)), strict=True)
    if max(quantity_values) - min(quantity_values) <= ROUNDING_CHANGE * max(
        abs(max(quantity_values)), abs(min(quantity_values)), 1e-300
    ):
        observation = (
            f"{quantity_values[0]:.6g} {question.unit} at every value from {min(key_values):g} to {max(key_values):g}"
        )
        raise ConfigError(f"{question.key}: has no effect on the {question.quantity.words}: {observation}")


def first_attaining(question: Question, x: float, quantity_at: Callable[[float], float]) -> float:
    """The first of the whole numbers around a change of sign at which the quantity attains the target."""
    sign = 1 if question.quantity.definition.more_is_better else -1
    neighbours = [n for n in (x, x - 1, x + 1) if question.search_range.low <= n <= question.search_range.high]
    attaining = [n for n in neighbours if sign * (quantity_at(n) - question.equals) >= 0]
    return attaining[0] if attaining else x


def nearest_value(values: Sequence[float], question: Question) -> float:
    """The value nearest to the config's own, on the scale of the search; the first where the config has none."""
    if question.config_value is None or (question.search_range.logarithmic and question.config_value <= 0):
        return values[0]
    config_place = question.search_range.to_scale(question.config_value)
    return min(values, key=lambda x: abs(question.search_range.to_scale(x) - config_place))


def boundary_note(question: Question, curve: Curve, x: float) -> tuple[str, ...]:
    """Whether the nearest value lies at an end of the search range, or of the config's bounds, in words."""
    if x in (question.search_range.low, question.search_range.high):
        return (tr("the end of the searched range; {between} searches elsewhere", between=range_option()),)
    refused_nearby = [value for value in curve.refusals if abs(value - x) <= 0.05 * abs(x)]
    return (term("the limit that the config allows"),) if refused_nearby else ()


def scan_options(at_s: float | None, at_k: int | None) -> dict[str, object]:
    """The time or the scan, if it is given. Raises ConfigError if both are given."""
    if at_s is not None and at_k is not None:
        options = f"{argument('at_s', '--at')} and {argument('at_k', '--at-k')}"
        raise ConfigError(f"{options} do not go together: a time or a scan")
    if isinstance(at_k, SupportsFloat) and not float(at_k).is_integer():
        raise ConfigError(f"{argument('at_k', '--at-k')}: must be a whole number, that of a scan, got {at_k:g}")
    return {name: value for name, value in (("at_s", at_s), ("at_k", at_k)) if value is not None}


def measure_seconds(work: Callable[[], object]) -> float:
    """Measure the seconds that a function takes."""
    start_s = time.monotonic()
    work()
    return time.monotonic() - start_s
