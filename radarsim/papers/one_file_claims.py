"""The claims and interpretations of a study in one file, from its attributes `paper` and `claims_yaml`."""

import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from radarsim.config.model import Model
from radarsim.errors import ConfigError
from radarsim.papers import one_file_measures
from radarsim.papers.claim import Claim, PaperClaims
from radarsim.papers.claim_files import parse_claims
from radarsim.papers.interpretations import Choice, ImpossibleInterpretation, PaperInterpretations
from radarsim.papers.key_interpretations import KeyInterpretations, with_settings
from radarsim.papers.measure_call import MeasureCall
from radarsim.papers.one_file_measures import gain, gain_change, has_values, unknown_key
from radarsim.papers.paper_cases import ShippedCases
from radarsim.studies.onefile import OneFile


def declarations(study: OneFile) -> tuple[tuple[Claim, ...], tuple[Choice, ...]]:
    """The claims and choices in `claims_yaml`."""
    module = _module_of(study)
    source = Path(module.__file__ or "").read_text(encoding="utf-8")
    lines_above = source[: max(source.find(study.claims_yaml), 0)].count("\n")
    text = "\n" * lines_above + study.claims_yaml
    claims, choices = parse_claims(text, str(module.__file__), one_file_measures, module)
    settings = [key for choice in choices for alternative in choice.alternatives for key in alternative.sets]
    if unknown := [key for key in settings if not study.has_key(key)]:
        raise ConfigError(*(f"{study.place}: claims_yaml: choices: sets: there is no key {key}" for key in unknown))
    return claims, choices


def claims_of(study: OneFile) -> PaperClaims | None:
    """The claims of a study; None where it has none."""
    if study.paper is None or not study.claims_yaml:
        return None
    evidence = getattr(_module_of(study), "Evidence", one_file_measures.Evidence)
    return PaperClaims(declarations(study)[0], evidence, *study.paper)


def interpretations_of(study: OneFile) -> PaperInterpretations | None:
    """The interpretations of a study's paper; None where it leaves nothing open."""
    if study.paper is None or not study.claims_yaml or not declarations(study)[1]:
        return None
    claims, choices = declarations(study)
    return KeyInterpretations(claims[0].paper, choices, type(study).__module__)


def claim_faults(study: OneFile, shipped: ShippedCases) -> Sequence[str]:
    """Names in a study's claims and choices that do not exist, a line each with its place: known without a run."""
    if study.paper is None or not study.claims_yaml:
        return ()
    folder = study.shipped()
    configs = sorted(file.stem for file in folder.glob("configs/*.yaml")) if folder else []
    components = [component.name for component in study.components]
    claims, choices = declarations(study)
    return (*_faults_of_claims(claims, components, shipped, configs), *_faults_of_choices(claims, choices, shipped))


def _module_of(study: OneFile) -> Any:
    return sys.modules[type(study).__module__]


def _faults_of_claims(
    claims: Sequence[Claim], components: Sequence[str], shipped: ShippedCases, configs: Sequence[str]
) -> Iterator[str]:
    """Faults in the configs and measures of claims; configs: the stems that the study's package ships."""
    for claim in claims:
        if (cases := shipped(claim.config)) is None:
            available = ", ".join(configs) or "none"
            yield f"{claim.source}: config: no such config {claim.config!r} is shipped; there are {available}"
            continue
        for part in claim.parts:
            if isinstance(part.measure, MeasureCall):
                faults = _faults_of_measure(part.measure, cases, components)
                yield from (f"{part.measure.source}: {fault}" for fault in faults)


def _faults_of_choices(claims: Sequence[Claim], choices: Sequence[Choice], shipped: ShippedCases) -> Iterator[str]:
    """Alternatives whose settings the cases of their claims cannot have."""
    for choice in choices:
        configs = dict.fromkeys(claim.config for claim in claims if choice.affects(claim.id))
        specs = [case.spec for config in configs for case in shipped(config) or ()]
        for alternative in choice.alternatives:
            if why := next(filter(None, (_setting_fault(spec, alternative.sets) for spec in specs)), ""):
                yield f"{alternative.source}: choices: {choice.key}: {alternative.name!r} cannot be set: {why}"


def _faults_of_measure(measure: MeasureCall, cases: Sequence[Any], components: Sequence[str]) -> Iterator[str]:
    """The unknown case, filter, component, gain or scan of a measure: in arguments of the functions here only."""
    named_cases: list[Any] = []
    for key in (key for key in measure.cases if isinstance(key, Mapping)):
        if unknown := unknown_key(key, [case.spec for case in cases]):
            yield f"of: {unknown}: there is no such key"
        elif not (matching := [case for case in cases if has_values(case.spec, key)]):
            yield f"of: no case has {', '.join(f'{path} {value}' for path, value in key.items())}"
        else:
            named_cases.append(matching[0])
    if measure.function is None or measure.function.__module__ != one_file_measures.__name__:
        return
    for argument in ("filter", "over", "component"):
        kind = "component" if argument == "component" else "filter"
        for case in named_cases if argument in measure.arguments else ():
            filters = [member.name for member in (*case.spec.filters, *case.user_filters)]
            allowed = components if kind == "component" else filters
            if (name := measure.arguments[argument]) not in allowed:
                yield f"no {kind} {name!r}; there are {', '.join(allowed)}"
    yield from (fault for case in named_cases for fault in _missing_number(measure, case.spec))


def _missing_number(measure: MeasureCall, spec: Any) -> Iterator[str]:
    """Why a case has no number for a measure of the functions here: no gain of its baseline, no scan after its last."""
    name, scan = measure.arguments.get("filter"), measure.arguments.get("at")
    if measure.function in (gain, gain_change) and name == (spec.baseline or spec.filters[0].name):
        yield f"filter {name!r} is the baseline: it has no gain"
    if scan is not None and not 1 <= scan <= spec.scans:
        yield f"no scan {scan}; there are 1 to {spec.scans}"


def _setting_fault(spec: Model, values: Mapping[str, Any]) -> str:
    """Why a case cannot have these values; nothing where it can."""
    try:
        with_settings(spec, values)
    except ImpossibleInterpretation as error:
        return str(error)
    return ""
