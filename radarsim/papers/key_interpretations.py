"""Interpretations whose alternatives set keys of a case: those of most papers."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from radarsim.config.document import Document
from radarsim.config.error_list import ErrorList, Origin
from radarsim.config.experiment import Case
from radarsim.config.scalars import from_python
from radarsim.config.validate import validate
from radarsim.errors import ConfigError
from radarsim.papers.claim import Claim
from radarsim.papers.interpretations import Choice, ImpossibleInterpretation, Interpretation, PaperInterpretations


class KeyInterpretations(PaperInterpretations):
    """Interpretations whose alternatives set keys of a case, by dotted names; a bare name applies to every filter."""

    def __init__(self, paper: str, choices: tuple[Choice, ...], module: str = ""):
        self.paper, self.choices, self._module = paper, choices, module

    @property
    def module(self) -> str:
        return self._module or super().module

    def changed_case(self, claim: Claim, case: Case, interpretation: Interpretation) -> Case | None:
        return replace(case, spec=with_settings(case.spec, self.settings(interpretation)))


def with_settings(spec: Any, values: Mapping[str, Any]) -> Any:
    """A config's keys with some values changed; raises ImpossibleInterpretation where they are incompatible."""
    origin, faults = Origin("interpretation"), ErrorList()
    data: Any = from_python(spec.model_dump(exclude_none=True), (), origin, faults)
    for path, value in values.items():
        *above, last = path.split(".")
        places = [data] if path.partition(".")[0] in type(spec).model_fields else data[type(spec).bare_keys]
        try:
            for step in above:
                places = [
                    place[int(step)] if isinstance(place, list) else place.setdefault(step, {}) for place in places
                ]
            for place in places:
                place[last] = value
        except (LookupError, TypeError, ValueError, AttributeError):
            raise ImpossibleInterpretation(f"{path}: there is no such key") from None
    changed = validate(type(spec), Document(data, "interpretation", None, {(): origin}), faults)
    try:
        faults.raise_if_any()
    except ConfigError as error:
        raise ImpossibleInterpretation(error.lines[0]) from None
    return changed
