"""A user filter judged on the noise of a run: from a function, from arrays, or from a file."""

import hashlib
import os
import shlex
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace as replaced
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from radarsim.api import arguments, configs, load_experiments, repeat_command, run
from radarsim.api.configs import Config, Overrides
from radarsim.api.estimate_files import read_estimates
from radarsim.api.filter_checks import check_user_filter
from radarsim.api.replacement import earlier_result
from radarsim.config.case_choice import case_choice
from radarsim.config.common_keys import UserFilterKeys
from radarsim.config.document import Document
from radarsim.config.error_list import ErrorList, Origin
from radarsim.config.experiment import Experiment
from radarsim.config.validate import validate
from radarsim.errors import ConfigError, DisagreementError, MeasureError, argument
from radarsim.report import provenance
from radarsim.studies.user_filters import estimates
from radarsim.studies.user_filters.filters import CalledFilter, EstimateChunks, StoredEstimates, UserFilter

if TYPE_CHECKING:
    from radarsim.api.result import Result


def judge(
    config: Config,
    estimates: Any,
    *,
    name: str = "mine",
    components: Sequence[str] = (),
    one_by_one: bool = False,
    against: str | None = None,
    wanted: str | None = None,
    overrides: Overrides = (),
    realisations: float | None = None,
    seed: int | None = None,
    precision: float | None = None,
    of: str = "sigma",
    threads: int | None = None,
    out: str | os.PathLike[str] | None = None,
    figures: bool | str | Sequence[str] = True,
    width_mm: float | None = None,
    replace: bool = False,
    progress: Callable[[int, int, int], None] | None = None,
) -> "Result":
    """Judge a filter of your own on the plots of a run; returns a result like that of `run`, its filter beside the
    config's.

    estimates is an array (n, K, d) for realisations 0 … n - 1 of `plots`, or a pair with covariances (n, K, d, d); the
    file of one (npz, csv, parquet); an iterator of such chunks; a function of plots that gives one; or an object, or
    class, with `start(world)` and `step(plots)`, which is called scan by scan: see
    `radarsim.studies.user_filters.filters`. The d components are the leading ones of the state, or those named.
    one_by_one: the function takes one realisation.

    Gains are against every filter of the config, paired on the same realisations. Not-a-number before the first
    estimate of a realisation is no estimate yet; after it, or an error over a hundred times those of the config's
    filters, is a failure: `tables["failures"]`. σ and gains count the others. `warnings` say what is
    unsound: a function that looks ahead, that gives other estimates when called again, single precision.

    against="tuned": the config's filters stand there tuned too, each by `radarsim.tune` with noise of another seed,
    over all cases, for `wanted`, by default σ of the first component at the last scan. The answer is about the
    component and scan of `wanted`; without it, about those that the answer of the study is about. In the long run the
    cases last until their filters have settled: a file holds the estimates of so many scans.

    The other arguments are those of `run`; blocks are not stored, and results are in out/CONFIG_NAME. Raises
    ConfigError for estimates of another shape, order or seed.

    >>> import radarsim
    >>> result = judge("rls2", lambda plots: plots["range_m"], name="raw plots", realisations=500)
    >>> result.gains.query("filter == 'raw plots' and component == 'r'")["baseline"].unique().tolist()
    ['r', 'r+Vr']
    """
    override_texts = arguments.check_arguments(
        overrides, out=out, precision=precision, threads=threads, figures=figures, width_mm=width_mm
    )
    override_texts = load_experiments.combine_overrides(override_texts, None, seed)
    base_experiment = configs.load(config, override_texts)
    component_names = (components,) if isinstance(components, str) else tuple(components)
    experiment, warnings = add_user_filter(
        base_experiment, estimates, name, component_names, one_by_one, realisations, against=against, wanted=wanted
    )
    if experiment.cases[0].user_filters[-1].in_order:
        threads = 0
    run_arguments: dict[str, Any] = {"precision": precision, "of": of, "progress": progress, "threads": threads}
    return run_judged_experiment(experiment, warnings, out, figures, width_mm, replace=replace, **run_arguments)


def run_judged_experiment(
    experiment: Experiment,
    warnings: Sequence[str],
    out: str | os.PathLike[str] | None,
    figures: bool | str | Sequence[str] = True,
    width_mm: float | None = None,
    command: str = "none: the filter was given in Python",
    replace: bool = False,
    **run_arguments: Any,
) -> "Result":
    """The result of an experiment with a judged filter and the warnings of its checks, written if `out` is given."""
    if out is not None and not replace:
        earlier = earlier_result(experiment, out)
        earlier.check_replacement([member.name for member in experiment.cases[0].user_filters])
        earlier.check_counts({case.name: case.realisations for case in experiment.cases})
    try:
        result = run.run(experiment, **run_arguments)
    except (DisagreementError, MeasureError) as error:  # raised again below
        result = cast("Result", error.result)
    filter_identities = {
        user_filter.name: user_filter.identity for case in result.experiment.cases for user_filter in case.user_filters
    }
    result.facts |= {"command": command, "judged": filter_identities}
    result.facts["warnings"] = [*warnings, *result.facts["warnings"]]
    if out is None:
        result.check()
    else:
        result.write(out, figures, width_mm, replace=replace)
    return result


def add_user_filter(
    experiment: Experiment,
    estimates: Any,
    name: str,
    components: tuple[str, ...] = (),
    one_by_one: bool = False,
    realisations: float | None = None,
    against: str | None = None,
    wanted: str | None = None,
) -> tuple[Experiment, list[str]]:
    """The experiment with a further filter, named after both, and the warnings of the filter's checks."""
    tuning_warnings, judged_at = list[str](), None
    if against not in (None, "tuned"):
        raise ConfigError(f"{argument('against', '--against')}: must be tuned, got {against!r}")
    if against or wanted:
        from radarsim.api.design import quantities, tune
    if wanted and quantities.parse_quantity(wanted, None).over == "long run":
        from radarsim.api import long_experiment, precision_target

        (experiment,), wanted = precision_target.with_long_run([experiment], wanted)
        tuning_warnings = long_experiment.long_run_notes([experiment])
    if wanted and not against:
        judged_at = tune.judged_point(experiment, wanted)
    elif against:
        experiment, left_out, judged_at = tune.tune_baseline(experiment, wanted, realisations=realisations)
        tuning_warnings += left_out
    _check_name(name)
    n, cases = arguments.whole_number(realisations), experiment.cases
    member = make_user_filter(estimates, name, components, one_by_one, experiment)
    member.answer_at = judged_at
    available = len(member.arrays[0]) if isinstance(member, StoredEstimates) else None
    if available is not None and (n or 0) > available:
        raise ConfigError(f"{name}: there are estimates of {available} realisations, fewer than {n}")
    counts: dict[str, Any] = {"realisations": n or available} if n or available else {}
    cases = tuple(replaced(case, user_filters=(*case.user_filters, member), **counts) for case in cases)
    stem = f"{experiment.stem}_{'_'.join(name.split())}"
    judged_experiment = replaced(
        experiment, stem=stem, cases=cases, content=_renamed_content(experiment, stem), **counts
    )
    return judged_experiment, [
        *tuning_warnings,
        *(line for case in judged_experiment.cases for line in check_user_filter(case, member)),
    ]


OUTER_KEYS = ("figures", "realisations", "runs", "scenarios", "seed")  # of a config that includes another


def _renamed_content(experiment: Experiment, stem: str) -> dict[str, Any] | None:
    """The content of an experiment under another name; its cases keep theirs."""
    if experiment.content is None:
        return None
    inner = {key: value for key, value in experiment.content.items() if key not in OUTER_KEYS}
    outer = {key: value for key, value in experiment.content.items() if key in OUTER_KEYS}
    return {"name": stem, "include": [inner], **outer}


def make_user_filter(
    source: Any, name: str, components: tuple[str, ...], one_by_one: bool, experiment: Experiment
) -> UserFilter:
    """A user filter from a function, object, iterator, file or array. Raises ConfigError for anything else."""
    if callable(source) or hasattr(source, "step") or hasattr(source, "start"):
        components = components or estimates.components_of(source)
        named_object = source if hasattr(source, "__qualname__") else type(source)
        return CalledFilter(
            name, source, f"{named_object.__module__}.{named_object.__qualname__}", components, one_by_one
        )
    if len(cases := experiment.cases) > 1:
        case_options = case_choice(experiment, "radarsim judge {} ESTIMATES")
        raise ConfigError(f"{name}: estimates belong to one case, and there are {len(cases)}: {case_options}")
    if isinstance(source, Iterator):
        return EstimateChunks(name, source, "iterator", components)
    if isinstance(source, str | os.PathLike):
        source, components = read_estimates(Path(source), cases[0], components)
    x, P = estimates.copy_estimates(source)
    if x.ndim not in (2, 3) or not x.size or x.dtype.kind not in "fiu":
        description = f"{x.dtype} {x.shape}" if x.ndim else f"{source!r:.60}"
        raise ConfigError(
            f"{name}: estimates must be an array (n, K, d), a function, an iterator or a file, got {description}"
        )
    if P is not None and P.shape[:1] != x.shape[:1]:
        got = f"{len(P) if P.ndim else P}"
        raise ConfigError(f"{name}: covariances must be of {len(x)} realisations, as the estimates, got {got}")
    digest = hashlib.sha256(np.ascontiguousarray(x).tobytes())
    digest.update(b"" if P is None else np.ascontiguousarray(P).tobytes())
    return StoredEstimates(name, (x, P), digest.hexdigest(), components)


def _check_name(name: str) -> None:
    """Raise ConfigError for a name that a filter, or a folder of results, cannot have."""
    faults, origin = ErrorList(), Origin(argument("name"), key="name")
    validate(UserFilterKeys, Document({"name": name, "python": ""}, "judge", None, {(): origin}), faults)
    faults.raise_if_any()
    if "/" in name or name.startswith("."):
        raise ConfigError(f"{origin}: must be no path, got {name!r}")


def command(
    experiment: Experiment, estimates: str, name: str, overrides: Sequence[str], options: Sequence[str] = ()
) -> str:
    """The command that judges a file again, without folders of this machine."""
    verb, config, *further_words = shlex.split(
        repeat_command.command(experiment, overrides, repeat_command.RESULTS, verb="judge")
    )[1:]
    config, estimates = map(provenance.portable_path, (config, estimates))
    return shlex.join(["radarsim", verb, config, estimates, "--name", name, *options, *further_words])
