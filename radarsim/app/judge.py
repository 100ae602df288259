"""A filter of somebody else judged on the noise of a run, from a function, from arrays, or from a file of estimates."""

import hashlib
import itertools
import os
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast
from zipfile import BadZipFile

import numpy as np

from radarsim.app import configs, run
from radarsim.app.case_work import CaseWork
from radarsim.app.configs import Config, Overrides
from radarsim.config.case_choice import case_choice
from radarsim.config.check import check
from radarsim.config.document import Document, Faults, Origin
from radarsim.config.experiment import Case, Experiment
from radarsim.config.schema import OwnCode
from radarsim.errors import ConfigError, DisagreementError, MeasureError, argument
from radarsim.language import tr
from radarsim.report import statistics
from radarsim.studies import outside, registry
from radarsim.studies.interface import TRUE, true_column
from radarsim.studies.outside import Called, Chunks, Given, Outside, Plan, Plots

if TYPE_CHECKING:
    import pandas as pd

    from radarsim.app.result import Result

TRIED = 256  # realisations on which a filter is checked before it is judged
MATERIAL = 1e-3  # of a component's rms error: changes below it are rounding, which also float32 makes
FOLLOWS = 50  # realisations from which on it is tested whether errors follow the plots
REARRANGED = 10.0  # times: by so much smaller are errors in another order only where that is the right one
FACTORS = 1e3, 1e-3, -1.0, 3.6, 1 / 3.6, 180 / np.pi, np.pi / 180  # by which values in another unit are right
AXES = "realisation", "k", "t_s"  # columns of a table of estimates beside the components
ROUNDED = 1e-3  # of the time between scans: so far a time in a table may be from that of the plots


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
    progress: Callable[[int, int, int], None] | None = None,
) -> "Result":
    """Judge a filter of your own on the plots of a run; returns a result like that of `run`, its filter beside the
    config's.

    estimates is an array (n, K, d) for realisations 0 … n - 1 of `plots`, or a pair with covariances (n, K, d, d); the
    file of one (npz, csv, parquet); an iterator of such chunks; a function of plots that gives one; or an object, or
    class, with `start(world)` and `step(plots)`, which is called scan by scan: see `radarsim.studies.outside`. The d
    components are the leading ones of the state, or those named. one_by_one: the function takes one realisation.

    Gains are against every filter of the config, paired on the same realisations. Not-a-number before the first
    estimate of a realisation is no estimate yet; after it, or an error over a hundred times those of the config's
    filters, is a failure: `tables["failures"]`. σ and gains count the others. `warnings` say what is
    unsound: a function that looks ahead, that gives other estimates when called again, single precision.

    against="tuned": the config's filters stand there tuned too, each by `radarsim.tune` with noise of another seed,
    over all cases, for `wanted`, by default σ of the first component at the last scan.

    The other arguments are those of `run`; blocks are not stored, and results are in out/CONFIG_NAME. Raises
    ConfigError for estimates of another shape, order or seed.

    >>> import radarsim
    >>> result = judge("rls2", lambda plots: plots["range_m"], name="raw plots", realisations=500)
    >>> result.gains.query("filter == 'raw plots' and component == 'r'")["baseline"].unique().tolist()
    ['r', 'r+Vr']
    """
    asked: dict[str, Any] = {"precision": precision, "threads": threads, "figures": figures, "width_mm": width_mm}
    texts = run.merged(configs.check(overrides, out=out, **asked), None, seed)
    tuned = {"against": against, "wanted": wanted}
    loaded = configs.load(config, texts)
    named = (components,) if isinstance(components, str) else tuple(components)
    experiment, warnings = judged(loaded, estimates, name, named, one_by_one, realisations, **tuned)
    member = experiment.cases[0].outside[-1]
    asked = {"precision": precision, "of": of, "progress": progress, "threads": 0 if member.in_order else threads}
    return finished(experiment, warnings, out, figures, width_mm, **asked)


def finished(
    experiment: Experiment,
    warnings: Sequence[str],
    out: str | os.PathLike[str] | None,
    figures: bool | str | Sequence[str] = True,
    width_mm: float | None = None,
    command: str = "none: the filter was given in Python",
    **asked: Any,
) -> "Result":
    """The result of an experiment of `judged`, with what the checks found, written if `out` is given."""
    try:
        result = run.run(experiment, **asked)
    except (DisagreementError, MeasureError) as error:  # raised again below
        result = cast("Result", error.result)
    judged_by = {one.name: one.identity for case in result.experiment.cases for one in case.outside}
    result.facts |= {"command": command, "judged": judged_by}
    result.facts["warnings"] = [*warnings, *result.facts["warnings"]]
    if out is None:
        result.check()
    else:
        result.write(out, figures, width_mm)
    return result


def judged(
    experiment: Experiment,
    estimates: Any,
    name: str,
    components: tuple[str, ...] = (),
    one_by_one: bool = False,
    realisations: float | None = None,
    against: str | None = None,
    wanted: str | None = None,
) -> tuple[Experiment, list[str]]:
    """The experiment with a filter beside its own, under a name with the filter's, and what the checks say of it."""
    left_out, judged_at = list[str](), None
    if against not in (None, "tuned"):
        raise ConfigError(f"{argument('against', '--against')}: must be tuned, got {against!r}")
    if wanted is not None and not against:
        raise ConfigError(f"{argument('wanted', '--for')}: needs {argument('against', '--against')} tuned")
    if against:
        from radarsim.app import tune

        experiment, left_out, judged_at = tune.beside(experiment, wanted, realisations=realisations)
    _nameable(name)
    n, cases = configs.whole(realisations), experiment.cases
    member = source(estimates, name, components, one_by_one, experiment)
    member.judged_at = judged_at
    there = len(member.arrays[0]) if isinstance(member, Given) else None
    if there is not None and (n or 0) > there:
        raise ConfigError(f"{name}: there are estimates of {there} realisations, fewer than {n}")
    counts: dict[str, Any] = {"realisations": n or there} if n or there else {}
    cases = tuple(replace(case, outside=(*case.outside, member), **counts) for case in cases)
    stem = f"{experiment.stem}_{'_'.join(name.split())}"
    made = replace(experiment, stem=stem, cases=cases, **counts)
    return made, [*left_out, *(line for case in made.cases for line in tried(case, member))]


def source(given: Any, name: str, components: tuple[str, ...], one_by_one: bool, experiment: Experiment) -> Outside:
    """Where the estimates come from. Raises ConfigError for any other kind."""
    if callable(given) or hasattr(given, "step") or hasattr(given, "start"):
        components = components or outside.components_of(given)
        of = given if hasattr(given, "__qualname__") else type(given)
        return Called(name, given, f"{of.__module__}.{of.__qualname__}", components, one_by_one)
    if len(cases := experiment.cases) > 1:
        which = case_choice(experiment, "radarsim judge {} ESTIMATES")
        raise ConfigError(f"{name}: estimates belong to one case, and there are {len(cases)}: {which}")
    if isinstance(given, Iterator):
        return Chunks(name, given, "iterator", components)
    if isinstance(given, str | os.PathLike):
        given, components = read(Path(given), cases[0], components)
    x, P = outside.copied(given)
    if x.ndim not in (2, 3) or not x.size or x.dtype.kind not in "fiu":
        got = f"{x.dtype} {x.shape}" if x.ndim else f"{given!r:.60}"
        raise ConfigError(f"{name}: estimates must be an array (n, K, d), a function, an iterator or a file, got {got}")
    if P is not None and P.shape[:1] != x.shape[:1]:
        there = f"{len(x)} realisations, as the estimates, got {len(P) if P.ndim else P}"
        raise ConfigError(f"{name}: covariances must be of {there}")
    found = hashlib.sha256(np.ascontiguousarray(x).tobytes())
    found.update(b"" if P is None else np.ascontiguousarray(P).tobytes())
    return Given(name, (x, P), found.hexdigest(), components)


def _nameable(name: str) -> None:
    """Raises ConfigError where no filter, or no folder of results, can be called so."""
    faults, origin = Faults(), Origin(argument("name"), key="name")
    check(OwnCode, Document({"name": name, "python": ""}, "judge", None, {(): origin}), faults)
    faults.raise_if_any()
    if "/" in name or name.startswith("."):
        raise ConfigError(f"{origin}: must be no path, got {name!r}")


def command(
    experiment: Experiment, estimates: str, name: str, overrides: Sequence[str], options: Sequence[str] = ()
) -> str:
    """The command that judges a file again."""
    verb, own, *rest = shlex.split(configs.command(experiment, overrides, configs.RESULTS, verb="judge"))[1:]
    return shlex.join(["radarsim", verb, own, estimates, "--name", name, *options, *rest])


# ---- files -----------------------------------------------------------------------------------------------------------
def read(path: Path, case: Case, components: tuple[str, ...]) -> tuple[Any, tuple[str, ...]]:
    """Estimates of a file, with covariances where it has them, by realisation from 0 on; the components that it names.

    Raises ConfigError for a file that is none of the kinds, or of other realisations or another seed than the case's.
    """
    try:
        if path.suffix == ".npz":
            with path.open("rb") as file, np.lib.npyio.NpzFile(file, allow_pickle=False) as held:
                return _of_arrays(path, dict(held), case, components)
        import pandas as pd

        if path.suffix not in (".csv", ".parquet"):
            raise ConfigError(f"{path}: must end in .npz, .csv or .parquet")
        table = pd.read_csv(path, comment="#") if path.suffix == ".csv" else pd.read_parquet(path)
        return _of_table(path, table.rename(columns=lambda name: str(name).strip()), case)
    except (OSError, EOFError, ValueError, TypeError, ImportError, BadZipFile) as error:
        raise ConfigError(f"{path}: cannot be read: {error}") from error


def _of_arrays(
    path: Path, held: Mapping[str, np.ndarray], case: Case, components: tuple[str, ...]
) -> tuple[Any, tuple[str, ...]]:
    if "estimates" not in held:
        raise ConfigError(f"{path}: must hold an array `estimates` (n, K, d), got {', '.join(held) or 'nothing'}")
    if "seed" in held and (seed := held["seed"].ravel().tolist()) != [case.seed]:
        raise ConfigError(f"{path}: of plots with seed {', '.join(map(str, seed))}; the run has seed {case.seed}")
    x, P = held["estimates"], held.get("covariances")
    if x.ndim not in (2, 3):
        raise ConfigError(f"{path}: estimates must be an array (n, K, d), got {x.dtype} {x.shape}")
    rows = next((held[one].ravel() for one in ("realisation", "realisations") if one in held), np.arange(len(x)))
    if len(rows) != len(x) or rows.dtype.kind not in "fiu":
        got = f"{len(rows)} of type {rows.dtype}"
        raise ConfigError(f"{path}: realisation: must be {len(x)} numbers, as many as there are estimates, got {got}")
    order = _in_order(path, rows)
    own = tuple(map(str, np.atleast_1d(held["components"]))) if "components" in held else components
    return (x[order], P[order] if P.shape[:1] == x.shape[:1] else P) if P is not None else x[order], own


def _of_table(path: Path, table: "pd.DataFrame", case: Case) -> tuple[Any, tuple[str, ...]]:
    """One row a realisation and scan: `realisation`, `k` or `t_s`, and a column for each component."""
    drawn = outside.drawing(registry.study(case.study), case)(0, 1)
    columns = {
        name: one
        for name in table
        for one, unit in drawn.components
        if name in (one, true_column(one, unit).removeprefix(TRUE))
    }
    at = next((one for one in AXES[1:] if one in table), "")
    if "realisation" not in table or not at or not columns:
        wanted = f"realisation, k or t_s, and of {', '.join(one for one, _ in drawn.components)} those it estimates"
        raise ConfigError(f"{path}: must have the columns {wanted}; got {', '.join(map(str, table))}")
    held = {name: _numbers(path, table, name) for name in ("realisation", at, *columns)}
    K, places = len(drawn.t_s), np.arange(1, len(drawn.t_s) + 1.0) if at == "k" else drawn.t_s
    scan = np.searchsorted((places[1:] + places[:-1]) / 2, held[at])
    off = np.abs(held[at] - places[scan]) > ROUNDED * np.diff(places).min(initial=np.inf)
    if off.any():
        ends = f"{places[0]:g} … {places[-1]:g}"
        raise ConfigError(f"{path}: {at}: must be one of the {K} scans of the plots, {ends}, got {held[at][off][0]:g}")
    rows = np.lexsort((scan, held["realisation"]))
    each, counts = np.unique(held["realisation"], return_counts=True)
    if (counts != K).any() or (scan[rows].reshape(-1, K) != np.arange(K)).any():
        odd = each[counts != K] if (counts != K).any() else each[(scan[rows].reshape(-1, K) != np.arange(K)).any(1)]
        raise ConfigError(f"{path}: realisation {odd[0]:g}: must have a row for each of the {K} scans, empty cells "
                          f"where there is no estimate")  # fmt: skip
    order = _in_order(path, each)
    x = np.stack([held[name][rows].reshape(-1, K) for name in columns], axis=-1)
    return x[order], tuple(columns.values())


def _numbers(path: Path, table: "pd.DataFrame", name: str) -> np.ndarray:
    """A column as numbers, not-a-number where it is empty."""
    import pandas as pd

    numbers = pd.to_numeric(table[name], errors="coerce")
    wrong = numbers.isna() & (table[name].notna() | (name in AXES))
    if wrong.any():
        row = int(np.argmax(wrong))
        got = table[name].iloc[row]
        raise ConfigError(
            f"{path}: row {row + 1}, {name}: must be a number, got {got!r}"
            if isinstance(got, str)
            else f"{path}: row {row + 1}, {name}: has no value"
        )
    return numbers.to_numpy(dtype=float)


def _in_order(path: Path, rows: np.ndarray) -> np.ndarray:
    """The order in which the realisations of a file are 0, 1, 2, …"""
    order = np.argsort(rows, kind="stable")
    if (wrong := np.flatnonzero(rows[order] != np.arange(len(rows)))).size:
        at = int(wrong[0])
        raise ConfigError(f"{path}: must hold every realisation from 0 on once: where {at} should be there is "
                          f"{rows[order][at]}; `radarsim simulate CONFIG --realisations 0:{len(rows)} -o …` "
                          f"writes them")  # fmt: skip
    return order


# ---- checks ----------------------------------------------------------------------------------------------------------
def tried(case: Case, member: Outside) -> list[str]:
    """What is unsound about a filter, found on a few realisations; raises ConfigError where its estimates are not of
    these plots."""
    plan = cast("Plan", CaseWork(case).plans[-1])
    drawn = plan.draw(0, min(case.realisations, TRIED))
    plots = outside.plots_of(plan, drawn)
    given = member.estimates(plots)
    raw = outside.plain(outside.parts(given)[0])
    inner = outside.inner_errors(plan, 0, drawn.n)
    found = outside.judged(plan, member, given, drawn, outside.largest(inner))
    x, _ = outside.checked(member.name, given, drawn.n, len(plan.world.t_s), plan.names, member.components)
    places = outside.columns_of(member.name, x.shape[2], plan.names, member.components)
    _rearranged(plan, member, x, drawn.truth_of(plan.axes.components), places, inner)
    if isinstance(member, Given | Chunks):  # others are given the plots
        _follows(case, member, found.error, inner)
    rms = np.sqrt(_mean(np.square(found.error), (0, 1)))[places]
    lines = []
    if raw.dtype.kind == "f" and raw.dtype.itemsize < np.dtype(float).itemsize:
        largest = np.abs(raw.reshape(-1, x.shape[2])).max(0, where=np.isfinite(x).reshape(-1, x.shape[2]), initial=0)
        step = float(np.nan_to_num(np.spacing(largest) / rms).max())
        lines += [tr("{name}: estimates are {type}, rounded by up to {share:.1g} of their rms error",
                        name=member.name, type=str(raw.dtype), share=step)] if step else []  # fmt: skip
    if not isinstance(member, Given | Chunks):
        if any(not np.array_equal(plots[one], drawn.columns[one], equal_nan=True) for one in drawn.columns):
            lines.append(tr("{name}: changes the plots it is given; it gets copies", name=member.name))
        lines += _repeatable(plan, member, x, MATERIAL * rms)
    return lines


def _mean(values: np.ndarray, axis: int | tuple[int, ...]) -> np.ndarray:
    """The mean of what is finite, not-a-number where nothing is."""
    there = np.isfinite(values)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.where(there, values, 0).sum(axis) / there.sum(axis))


def _median(values: np.ndarray) -> np.ndarray:
    """The median over realisations of what is finite, infinite where nothing is."""
    return np.asarray(np.median(np.where(np.isfinite(values), values, np.inf), axis=0))


def _typical(values: np.ndarray) -> np.ndarray:
    """The median of each component (d,) of what is finite in values (…, d)."""
    finite = (one[np.isfinite(one)] for one in np.moveaxis(values, -1, 0))
    return np.array([np.median(one) if one.size else np.nan for one in finite])


def _again(plan: Plan, member: Outside, plots: Plots) -> np.ndarray:
    return outside.checked(
        member.name, member.estimates(plots), plots.n, len(plan.world.t_s), plan.names, member.components
    )[0]


def _differ(one: np.ndarray, other: np.ndarray, least: np.ndarray) -> bool:
    if one.shape != other.shape:
        return True
    with np.errstate(invalid="ignore"):
        return bool((np.isfinite(one) != np.isfinite(other)).any() or (np.abs(one - other) > least).any())


def _repeatable(plan: Plan, member: Any, x: np.ndarray, least: np.ndarray) -> Iterator[str]:
    """Whether a filter gives the same again, without the rest of its batch, and with other plots after some scan."""
    n, K = x.shape[:2]
    name = member.name
    if _differ(_again(plan, member, outside.plots_of(plan, plan.draw(0, n))), x, least):
        yield tr(
            "{name}: gives other estimates for the same plots when called again, so its numbers cannot be repeated",
            name=name,
        )
        return
    rows = slice(n // 4, n // 4 + max(n // 2, 1))  # neither the first nor the last, which such a filter may refer to
    part = outside.plots_of(plan, plan.draw(rows.start, rows.stop - rows.start))
    if n > 1 and _differ(_again(plan, member, part), x[rows], least):
        yield tr("{name}: its estimates of a realisation depend on the others in the batch", name=name)
        return
    if hasattr(member.target, "step") or K < 2 or n < 2:
        return
    cut = K // 2
    plots = outside.plots_of(plan, plan.draw(0, n))
    for column in plots.columns.values():
        column[:, cut:] = np.roll(column[:, cut:], 1, axis=0)  # of another realisation
    if _differ(_again(plan, member, plots)[:, :cut], x[:, :cut], least):
        yield tr("{name}: uses later plots: its estimates up to scan {k} change with the plots after it; compare it "
                 "with smoothers, not with filters", name=name, k=cut)  # fmt: skip


def _rearranged(
    plan: Plan, member: Outside, x: np.ndarray, truth: np.ndarray, places: Sequence[int], inner: np.ndarray
) -> None:
    """Raises ConfigError where estimates fit in another order of components or scans, or in another unit, and not as
    they stand."""
    with np.errstate(all="ignore"):
        scale = _typical(np.abs(inner))[list(places)]

        def misfit(order: Sequence[int], step: int) -> float:
            off = np.abs(x[:, ::step][..., list(order)] - truth[..., list(places)])
            return float(_mean(np.log(np.maximum(_typical(off) / scale, 1e-3)), 0))

        d = len(places)
        swaps = itertools.permutations(range(d)) if d <= 4 else (
            [*range(i), j, *range(i + 1, j), i, *range(j + 1, d)] for i in range(d) for j in range(i + 1, d)
        )  # fmt: skip
        every = [(range(d), 1), (range(d), -1), *((order, 1) for order in swaps)]
        fits = np.nan_to_num([misfit(*one) for one in every], nan=np.inf)
        better = fits[0] - fits.min()
        off = np.array([_typical(np.abs(x * by - truth[..., list(places)])) for by in (1.0, *FACTORS)])
        least = np.maximum(off[1:], 1e-3 * scale)
        ratios = np.nan_to_num(np.minimum(off[0], _typical(np.abs(truth[..., list(places)]))) / least, nan=0.0)
    order, step = every[int(fits.argmin())]
    if better > np.log(REARRANGED):
        stand = (
            "the scans from the last to the first"
            if step < 0
            else "the components in the order " + ", ".join(plan.names[places[list(order).index(i)]] for i in range(d))
        )
        by, wanted = np.exp(better), ", ".join(plan.names[i] for i in places)
        raise ConfigError(f"{member.name}: estimates hold {stand}: their errors are then {by:.2g} times smaller; "
                          f"expected {wanted} by rising scans")  # fmt: skip
    if ratios.max() > REARRANGED:
        f, i = np.unravel_index(int(ratios.argmax()), ratios.shape)
        component, unit = plan.axes.components[places[int(i)]]
        by, times = f"{FACTORS[int(f)]:.4g}", f"{ratios.max():.2g}"
        raise ConfigError(f"{member.name}: estimates of {component} must be in {unit}, with the sign of the truth: "
                          f"multiplied by {by} their errors are {times} times smaller")  # fmt: skip


def _follows(case: Case, member: Outside, error: np.ndarray, inner: np.ndarray) -> None:
    """Raises ConfigError where the errors are no more alike those of any filter of the config than by chance. Of all
    that see the same plots they are correlated. For each realisation the products of the normalised errors, cut at
    three, are averaged over scans and components; over realisations their mean is tested against nought."""
    n = len(error)
    if n < FOLLOWS:
        return
    scores = []
    with np.errstate(all="ignore"):
        off = [one - np.nan_to_num(_median(one)) for one in (error, *inner)]
        mine, *own = (np.clip(one / _median(np.abs(one)), -3, 3) for one in off)
        for one in own:
            alike = _mean((mine * one).reshape(n, -1), 1)
            alike = alike[np.isfinite(alike)]
            scores.append(alike.mean() / alike.std() * np.sqrt(alike.size) if alike.size >= FOLLOWS else np.nan)
    if np.isfinite(scores).any() and np.nanmax(scores) < statistics.furthest(len(scores)):
        raise ConfigError(f"{member.name}: its errors have nothing in common with those of the config's filters, "
                          f"which see the same plots: estimates of other realisations, in another order, or of another "
                          f"seed than {case.seed}?")  # fmt: skip
