"""The commands as Python functions; the command line calls these functions too.

They write nothing unless `out` names a directory. Stored results are read from `out`, by default results/.
"""

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, SupportsFloat, SupportsIndex

from radarsim.app import configs
from radarsim.app.configs import RESULTS, Config, Overrides
from radarsim.app.shown import Shown
from radarsim.errors import ConfigError, argument
from radarsim.threads import limited

if TYPE_CHECKING:
    import pandas as pd

    from radarsim.app.compare import Comparison, DopplerChart, Source
    from radarsim.app.outlook import Outlook
    from radarsim.app.readings import Readings
    from radarsim.app.result import Result
    from radarsim.app.sensitivity import Sensitivity
    from radarsim.app.solve import Answer
    from radarsim.engine.run import Signals, Stop
    from radarsim.report.drawing import Figure

Figures = bool | str | Sequence[str]  # whether to write figures, or in which formats
Progress = Callable[[int, int, int], None]
Out = str | os.PathLike[str]


def load(config: Config, *, out: Out = RESULTS, overrides: Overrides = ()) -> "Result":
    """Load the stored result of an experiment from `out`; computes and writes nothing.

    config and overrides as for `run`; of as many realisations as the last run reported, unless overrides say. `write`
    of the result makes tables, figures and report, as `radarsim report` does. Raises ConfigError, with the command to
    run, if something is missing.

    >>> import radarsim, tempfile
    >>> with tempfile.TemporaryDirectory() as out:
    ...     ran = radarsim.run("rls2", realisations=2000, out=out, figures=False)
    ...     loaded = load("rls2", out=out)
    >>> loaded.curves.equals(ran.curves)
    True
    """
    from radarsim.app import run

    overrides = run.merged(overrides)
    return run.from_store(run.load(config, overrides), out, overrides)


def check(
    config: Config,
    *,
    overrides: Overrides = (),
    realisations: float | None = None,
    seed: int | None = None,
    precision: float | None = None,
    of: str = "sigma",
    share: tuple[int, int] | None = None,
    threads: int | None = None,
    out: Out | None = None,
    progress: Progress | None = None,
) -> "Outlook":
    """Forecast a run: cases, filters, realisations, seconds on one thread, memory in MB.

    The arguments are those of `run`. share: the share of one of several machines, such as (2, 3) for the second of
    three. out: a directory whose stored blocks are not counted. Raises ConfigError for a wrong config or argument.

    >>> outlook = check("range_doppler", realisations=1e4)
    >>> outlook.table.columns.tolist()[:4]
    ['case', 'filters', 'scans', 'realisations']
    """
    from radarsim.app import outlook as overview
    from radarsim.app.run import load, merged

    overrides = configs.check(overrides, threads=threads, precision=precision, out=out)
    if share is not None and not (_is_pair(share, SupportsIndex) and 1 <= share[0] <= share[1]):
        raise ConfigError(f"share: must be two whole numbers i, n with 1 ≤ i ≤ n, got {share!r}")
    experiment = load(config, merged(overrides, realisations, seed))
    return overview.outlook(experiment, threads, precision, progress, of, out, share)


def solve(
    config: Config,
    key: str,
    *,
    equals: float,
    filter: str | None = None,
    at_s: float | None = None,
    at_k: int | None = None,
    between: tuple[float, float] | None = None,
    case: str | None = None,
    overrides: Overrides = (),
    realisations: float | None = None,
    seed: int | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
    notify: Callable[[str], None] | None = None,
    **quantity: str | None,
) -> "Answer":
    """Find the value of a key at which a quantity equals `equals`, in its unit; gains and rates in per cent.

    The quantity is given as an argument named after an option of `radarsim solve`: `gain="r"` or `sigma="Vr"` of a
    component, for the `filter`; or a rate of a filter, `lock="sequence"`, `loss="nearest"`, … It is taken at time at_s,
    s, or at scan at_k, counted from 1; default: the last scan. between: the range of the key to search. case: the case,
    if the config has several. realisations: the number for each simulated value, if nothing exact is known. notify is
    called with a line on what a search of some seconds will do.

    `value` lies between `lo` and `hi` (95 %; equal where `exact`). If the target cannot be attained, value is None, and
    limit, at limit_at, is the nearest attainable value. Raises ConfigError for a wrong config, key, filter or quantity.

    >>> answer = solve("rls2", "radar.sigma_velocity_mps", gain="r", filter="r+Vr", at_s=60, equals=30)
    >>> print(f"{answer.value:.4f} {answer.unit}", answer.exact)
    13.7212 m/s True
    """
    from radarsim.app import solve as solving
    from radarsim.app.quantities import Wanted
    from radarsim.app.run import merged

    named = {name: value for name, value in quantity.items() if value is not None}
    if len(named) != 1:
        given = ", ".join(named) or "none"
        examples = f"{argument('sigma=…', '--sigma')}, {argument('gain=…', '--gain')}"
        raise ConfigError(f"name one quantity, as `radarsim solve --help` lists them: {examples}, …; got {given}")
    checked = configs.check(overrides, threads=threads, equals=equals, **_place(at_s, at_k))
    if not isinstance(key, str):
        raise ConfigError(f"key: must be text, got {key!r}")
    if between is not None and not _is_pair(between):
        raise ConfigError(f"between: must be two rising numbers, got {between!r}")
    ((name, component),) = named.items()
    return solving.solve(
        *(config, key, Wanted(name, filter, component, at_s, at_k), equals),
        overrides=merged(checked, None, seed),
        between=between,
        case=case,
        realisations=configs.whole(realisations),
        threads=threads,
        progress=progress,
        notify=notify,
    )


def _place(at_s: float | None, at_k: int | None) -> dict[str, object]:
    """The time or scan, where given. Raises ConfigError for both at once."""
    if at_s is not None and at_k is not None:
        both = f"{argument('at_s', '--at')} and {argument('at_k', '--at-k')}"
        raise ConfigError(f"{both} do not go together: a time or a scan")
    if isinstance(at_k, SupportsFloat) and not float(at_k).is_integer():
        raise ConfigError(f"{argument('at_k', '--at-k')}: must be a whole number, that of a scan, got {at_k:g}")
    return {name: value for name, value in (("at_s", at_s), ("at_k", at_k)) if value is not None}


def _is_pair(given: object, kind: Any = SupportsFloat) -> bool:
    return isinstance(given, Iterable) and len(two := list(given)) == 2 and all(isinstance(one, kind) for one in two)


def sensitivity(
    config: Config,
    *,
    at_s: float | None = None,
    at_k: int | None = None,
    of: str | None = None,
    component: str | None = None,
    case: str | None = None,
    overrides: Overrides = (),
    realisations: float | None = None,
    seed: int | None = None,
    out: Out | None = None,
    figures: Figures = True,
    width_mm: float | None = None,
    progress: Progress | None = None,
) -> "Sensitivity":
    """Show what +10 % of each key changes in σ and gain, or in another quantity `of`; largest effect first.

    Taken at time at_s, s, or at scan at_k, counted from 1; default: the last scan. Rows are sorted by `component`, by
    default the first. `table` has a row for each key, filter and component: the value, in the component's unit or per
    cent, and its change, in per cent or points, with a 95 % interval if simulated. out: directory for table and figure.
    Raises ConfigError.

    >>> found = sensitivity("rls2", at_s=60)
    >>> first = found.table.iloc[0]
    >>> print(first["key"], first["filter"], first["component"], f"{first['sigma_change_percent']:.2f}")
    radar.detection_probability r r 34.40
    """
    from radarsim.app import sensitivity as finding
    from radarsim.app.run import merged

    checked = configs.check(overrides, out=out, figures=figures, width_mm=width_mm, **_place(at_s, at_k))
    formats = configs.formats(figures)
    asked: dict[str, Any] = {"at_s": at_s, "at_k": at_k, "of": of, "component": component, "case": case}
    asked |= {"realisations": configs.whole(realisations), "progress": progress}
    found = finding.sensitivity(config, overrides=merged(checked, None, seed), **asked)
    return found if out is None else finding.write(found, out, formats, width_mm)


def compare(
    *sources: "Source | Mapping[str, Source]",
    out: Out | None = None,
    figures: Figures = True,
    width_mm: float | None = None,
) -> "Comparison":
    """Compare results with the first one: differences with 95 % intervals, on common axes.

    Each source is a result of `run` or `load`, a config with a stored result in results/ or `out`, or the folder of a
    result; a single mapping gives them by name. out: directory for table, page and figures. If two results use the same
    measurements and the same baseline filter, the difference is paired.

    `table` is comparison.csv: a row for each quantity, filter, component and common time. Raises ConfigError where
    results are missing or have nothing in common, StoreError where a stored one is damaged.

    >>> import radarsim
    >>> mine = radarsim.run("rls2", realisations=2000, overrides={"radar.sigma_velocity_mps": 4})
    >>> compare({"paper": radarsim.run("rls2", realisations=2000), "mine": mine}).table["label"].unique().tolist()
    ['mine']
    """
    from radarsim.app import compare as comparing

    configs.check(out=out, figures=figures, width_mm=width_mm)
    given: Any = sources[0] if len(sources) == 1 and isinstance(sources[0], Mapping) else sources
    return comparing.compare(given, out, formats=configs.formats(figures), width_mm=width_mm)


def chart(
    *configs: Config,
    overrides: Overrides = (),
    out: Out | None = None,
    figures: Figures = True,
    width_mm: float | None = None,
    progress: Progress | None = None,
) -> "DopplerChart":
    """Chart the gain by Doppler for all radars, with the configs' radars marked; simulates nothing.

    Without configs, shows the five radars of the first paper. `table` is chart.csv: a row for each case and filter,
    with the gains in the long run, per cent. out: directory for table, figures and the page with sliders. Raises
    ConfigError if the configs' study has no chart.

    >>> chart("rls2").figures[0]
    'gain_against_time'
    """
    from radarsim.app import compare as drawing
    from radarsim.app.configs import check, formats

    checked = check(overrides, out=out, figures=figures, width_mm=width_mm)
    if checked and not configs:
        raise ConfigError(f"{argument('overrides', '--set')}: without a config there is nothing to change")
    shown: dict[str, Any] = {"formats": formats(figures), "width_mm": width_mm, "progress": progress}
    return drawing.chart(configs, out, overrides=overrides, **shown)


class Claims(Shown):
    """Claims of papers and their verdicts; one row for each measured part of a claim."""

    def __init__(self, rows: Sequence[dict[str, Any]]):
        self.rows = tuple(rows)

    @property
    def table(self) -> "pd.DataFrame":
        """The columns of claims.csv, and `config`, which judges the claim."""
        from radarsim.report.tables import read_rows

        return read_rows(self.rows, self.rows[0] if self.rows else ())

    @property
    def _described(self) -> "Mapping[str, Figure]":
        from radarsim.report.claims import page

        drawn = page.figure(self.rows)
        return {} if drawn is None else {"claims": drawn}

    def _said(self) -> list[str]:
        from radarsim.language import tr
        from radarsim.report.claims import page

        lines = [page.counted(self.rows)] if self.rows else []
        for parts in page.grouped(self.rows):
            verdict = page.verdict_of(parts).replace("*", "")
            lines.append(f"{parts[0]['claim']} {verdict}: {tr(parts[0]['statement'])}")
        return lines

    def draw(self, path: Out) -> None:
        """Write the figure to a file. Raises ConfigError if the name has no known format or no claim is judged."""
        from radarsim.app.configs import FORMATS
        from radarsim.report import files
        from radarsim.report.figures import save

        kind, drawn = Path(path).suffix[1:].lower(), self._described
        if kind not in FORMATS:
            raise ConfigError(f"{path}: must end in {', '.join(f'.{one}' for one in FORMATS)}")
        if not drawn:
            raise ConfigError(f"{path}: no claim is judged here, so there is nothing to draw")
        files.replace_all(Path(path).parent, {Path(path).name: save(drawn["claims"], (kind,))[kind]})


def claims(*names: str, out: Out = RESULTS) -> Claims:
    """List the papers' claims with verdicts from the results stored in `out`; computes nothing.

    names are claims (P1.3), papers (P1) or configs; default: all claims of all papers. `table` has a row for each
    measured part of a claim: measured value, 95 % interval, expected value, verdict. Claims without stored results are
    listed as not run. Raises ConfigError for unknown names.

    >>> found = claims("P1.3", out="/nowhere")
    >>> found.table["verdict"].tolist()
    ['not run']
    """
    from radarsim.app.run import claims as rows

    configs.check(out=out)
    configs.texts(names)
    return Claims(rows(names, out))


def readings(
    *names: str,
    realisations: float | None = None,
    decide: bool = False,
    threads: int | None = None,
    time_limit: "float | Stop | None" = None,
    out: Out | None = None,
    figures: bool = True,
    progress: Progress | None = None,
    stop: "Signals | None" = None,
) -> "Readings":
    """Judge claims (P1.4) or whole papers (P1) under every reading that the papers allow; default: all.

    Readings are judged exactly where possible, otherwise by runs of `realisations`, by default the number that the
    paper's readings declare. decide: extend the runs, up to `realisations`, until each claim is decided. time_limit is
    in seconds. out: directory for readings.csv, a figure for each claim, and the stored runs.

    `table` is readings.csv: a row for each claim, reading and part. Raises ConfigError for unknown names, TargetUnmet
    if the time did not suffice.

    >>> readings("P1.4")
    P1.4 depends on: holds in 4 of 6 readings; depends on: start
    """
    from tempfile import TemporaryDirectory

    from radarsim.app import readings as reading
    from radarsim.app.run import RunOptions
    from radarsim.engine import run

    configs.check(threads=threads, time_limit=time_limit, out=out, figures=figures)
    configs.texts(names)
    wanted = reading.asked(names)
    limit = time_limit if time_limit is None or callable(time_limit) else run.TimeLimit(time_limit)
    asked: dict[str, Any] = {"realisations": configs.whole(realisations), "decide": decide}
    asked |= {"progress": progress, "figures": figures, "stop": stop, "write": out is not None}
    with TemporaryDirectory(prefix="radarsim-") as folder, limited(threads):
        options = RunOptions(None, threads, run.Either(stop, limit))
        return reading.readings(wanted, out=Path(folder if out is None else out), options=options, **asked)
