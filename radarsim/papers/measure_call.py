"""The call of a measure that a claim names, and what it may give."""

import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from radarsim.config.value_text import quoted_value
from radarsim.errors import AUTHOR_ERRORS, ConfigError, MeasureError, RadarsimError
from radarsim.papers.evidence import INTERVAL_ROUNDING, MissingEvidence, UnknownName, exact_number, has_interval
from radarsim.papers.interpretations import ImpossibleInterpretation
from radarsim.report.statistics import Estimate
from radarsim.user_code import errors as user_code_errors


@dataclass(frozen=True)
class MeasureCall:
    """A function by name, or a method of the evidence where function is None, with its cases and arguments."""

    name: str
    function: Callable[..., Any] | None
    cases: tuple
    arguments: Mapping[str, Any]
    source: str = field(default="", compare=False)  # where it is written, for messages

    def __call__(self, evidence: Any) -> Estimate:
        """The measured value; a plain number is without noise. Raises MeasureError where the function fails."""
        try:
            if self.function is None:
                value = getattr(evidence, self.name)(*self.cases, **self.arguments)
            else:
                value = self.function(evidence, *self.cases, **self.arguments)
        except AUTHOR_ERRORS as error:
            is_our_error = isinstance(error, RadarsimError) and not isinstance(error, ConfigError)
            if is_our_error or (
                isinstance(error, MissingEvidence | ImpossibleInterpretation) and not self._misspelt(error)
            ):
                raise
            raise MeasureError(f"{self.source}: {self.name}: {user_code_errors.error_summary(error)}") from error
        return self._checked(value)

    def _checked(self, value: Any) -> Estimate:
        """The value as an estimate. Raises MeasureError for what is none."""
        if not isinstance(value, str | bytes):
            with suppress(TypeError, ValueError, OverflowError):
                estimate = Estimate(*map(float, value)) if isinstance(value, Estimate) else exact_number(value)
                if self._is_of_user and not math.isfinite(estimate.value):
                    return exact_number(math.nan)
                if self._is_of_user and not _is_within(estimate):
                    raise MeasureError(
                        f"{self.source}: {self.name}: must give an Estimate whose value is within its interval, got "
                        f"{estimate.value:.6g} and [{estimate.lo:.6g}, {estimate.hi:.6g}]"
                    )
                return value if isinstance(value, Estimate) else estimate
        raise MeasureError(f"{self.source}: {self.name}: must give an Estimate or a number, got {quoted_value(value)}")

    @property
    def _is_of_user(self) -> bool:
        return self.function is not None and not self.function.__module__.startswith("radarsim.")

    def _misspelt(self, error: Exception) -> bool:
        """Whether a function of a package asks for a name that the paper's own case does not have."""
        return self._is_of_user and isinstance(error, UnknownName)

    def number(self, evidence: Any) -> float:
        """Its value alone."""
        return float(self(evidence).value)

    def exact_number(self, evidence: Any) -> float:
        """Its value where that is exact, else NaN."""
        estimate = self(evidence)
        return math.nan if has_interval(estimate) else float(estimate.value)


def _is_within(estimate: Estimate) -> bool:
    """Whether a value is within its interval, but for rounding; an end may be unknown."""
    rounding = INTERVAL_ROUNDING * abs(estimate.value)
    return not (estimate.lo > estimate.value + rounding or estimate.hi < estimate.value - rounding)
