"""What the commands answer, for Python: the commands call these functions too.

They write nothing unless `out` names a directory. What is stored in results/ is read there, or in `out`.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from radarsim.app.configs import RESULTS, Config, Overrides
from radarsim.app.shown import Shown
from radarsim.errors import ConfigError, argument
from radarsim.threads import limited

if TYPE_CHECKING:
    import pandas as pd

    from radarsim.app.compare import Compared, Drawn, Source
    from radarsim.app.outlook import Outlook
    from radarsim.app.question import Answer
    from radarsim.app.readings import Done
    from radarsim.app.sensitivity import Sensitivity
    from radarsim.engine.run import Signals, Stop
    from radarsim.report.drawing import Figure

Figures = bool | str | Sequence[str]  # whether to write figures, or in which formats
Progress = Callable[[int, int, int], None]
Out = str | os.PathLike[str]


def check(
    config: Config,
    *,
    realisations: float | None = None,
    seed: int | None = None,
    overrides: Overrides = (),
    precision: float | None = None,
    of: str = "sigma",
    share: tuple[int, int] | None = None,
    threads: int | None = None,
    out: Out | None = None,
    progress: Progress | None = None,
) -> "Outlook":
    """What a run would compute, and how long that takes: cases, filters, realisations, seconds of one thread, MB.

    The arguments are those of `run`. share: of one of several machines, (2, 3) for the second of three. out: less what
    is stored there. Raises ConfigError for a wrong config or argument.

    >>> outlook = check("range_doppler", realisations=1e4)
    >>> outlook.table.columns.tolist()[:4]
    ['case', 'filters', 'scans', 'realisations']
    """
    from radarsim.app import outlook as overview
    from radarsim.app.run import load, merged

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
    told: Callable[[str], None] | None = None,
    **quantity: str | None,
) -> "Answer":
    """The value of a key at which a quantity reaches `equals`: in its component's unit, or per cent of gains and rates.

    The quantity is one more argument, as an option of `radarsim solve`: `gain="r"` or `sigma="Vr"` of a component, for
    the `filter`; of a study with filters' own rates `lock="sequence"`, `loss="nearest"`, … It is taken at time at_s, s,
    or at scan at_k, from 1; of neither at the last scan. between: the values of the key that are searched. case: of a
    config that has several. realisations: behind each value that is simulated, where nothing exact is known. told is
    called with a line that says what a search of some seconds will do.

    `value` lies between `lo` and `hi` (95 %; equal where `exact`). Where the target cannot be attained value is None,
    and limit, at limit_at, is the nearest. Raises ConfigError for a wrong config, key, filter or quantity.

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
    _one_place(at_s, at_k)
    ((name, component),) = named.items()
    return solving.solve(
        *(config, key, Wanted(name, filter, component, at_s, at_k), equals),
        overrides=merged(overrides, None, seed),
        between=between,
        case=case,
        realisations=None if realisations is None else int(realisations),
        threads=threads,
        progress=progress,
        told=told,
    )


def _one_place(at_s: float | None, at_k: int | None) -> None:
    """Raises ConfigError for a time and a scan at once."""
    if at_s is not None and at_k is not None:
        both = f"{argument('at_s', '--at')} and {argument('at_k', '--at-k')}"
        raise ConfigError(f"{both} do not go together: a time or a scan")


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
    """What +10 % of each key changes: σ and gain, or another quantity `of` the study; the largest effect first.

    At time at_s, s, or scan at_k, from 1; of neither at the last scan. component leads the order, by default the first.
    `table` has a row a key, filter and component: the value, in the component's unit or per cent, and its change, in
    per cent or points, with 95 % intervals where it is simulated. out: where table and figure are written.
    Raises ConfigError.

    >>> found = sensitivity("rls2", at_s=60)
    >>> first = found.table.iloc[0]
    >>> print(first["key"], first["filter"], first["component"], f"{first['sigma_change_percent']:.2f}")
    radar.sigma_range_m r r 10.00
    """
    from radarsim.app import configs
    from radarsim.app import sensitivity as finding
    from radarsim.app.run import merged

    _one_place(at_s, at_k)
    formats = configs.formats(figures)
    asked: dict[str, Any] = {"at_s": at_s, "at_k": at_k, "of": of, "component": component, "case": case}
    asked |= {"realisations": realisations, "progress": progress}
    found = finding.sensitivity(config, overrides=merged(overrides, None, seed), **asked)
    return found if out is None else finding.write(found, out, formats, width_mm)


def compare(
    *sources: "Source | Mapping[str, Source]",
    out: Out | None = None,
    figures: Figures = True,
    width_mm: float | None = None,
) -> "Compared":
    """Results side by side, the others against the first: differences with 95 % intervals, on common axes.

    Each is a result of `run` or `load`, a config, whose result is stored in results/ or in `out`, or the folder of a
    result; or one mapping gives them all by the names that they are called by. out: where table, page and figures are
    written. Where two are of the same measurements and share their baseline filter, the difference is paired.

    `table` is comparison.csv: a row for each quantity, filter, component and common time. Raises ConfigError where
    results are missing or have nothing in common, StoreError where a stored one is damaged.

    >>> import radarsim
    >>> mine = radarsim.run("rls2", realisations=2000, overrides={"radar.sigma_velocity_mps": 4})
    >>> compare({"paper": radarsim.run("rls2", realisations=2000), "mine": mine}).table["label"].unique().tolist()
    ['mine']
    """
    from radarsim.app import compare as comparing
    from radarsim.app import configs

    given: Any = sources[0] if len(sources) == 1 and isinstance(sources[0], Mapping) else sources
    return comparing.compare(given, out, formats=configs.formats(figures), width_mm=width_mm)


def chart(
    *configs: Config,
    overrides: Overrides = (),
    out: Out | None = None,
    figures: Figures = True,
    width_mm: float | None = None,
    progress: Progress | None = None,
) -> "Drawn":
    """What Doppler gains for every radar, and those of some configs on it; simulates nothing.

    Without configs the five radars of the first paper. `table` is chart.csv: a row a case and filter, with the gains in
    the long run, per cent. out: where table, figures and the page with sliders are written. Raises ConfigError where
    the configs' study has no chart.

    >>> chart("rls2").figures[0]
    'gain_against_time'
    """
    from radarsim.app import compare as drawing
    from radarsim.app.configs import formats

    shown: dict[str, Any] = {"formats": formats(figures), "width_mm": width_mm, "progress": progress}
    return drawing.chart(configs, out, overrides=overrides, **shown)


class Claims(Shown):
    """Claims of papers and how far each stands; of each as many rows as there are parts that are measured."""

    def __init__(self, rows: Sequence[dict[str, Any]]):
        self.rows = tuple(rows)

    @property
    def table(self) -> "pd.DataFrame":
        """The columns of claims.csv, and `config`, by which it is judged."""
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
        """Write the figure to a file. ConfigError for a name that says no format, or where no claim is judged."""
        from radarsim.app.run import draw_claims

        draw_claims(self.rows, path)


def claims(*names: str, out: Out = RESULTS) -> Claims:
    """The claims of the papers as far as they are judged by what is stored in `out`; computes nothing.

    names are claims (P1.3), papers (P1) or configs; without any all claims of all papers. `table` has a row for each
    part of a claim that is measured: measured value, 95 % interval, what the paper says, verdict. Those without stored
    results are listed as not run. Raises ConfigError for what does not exist.

    >>> found = claims("P1.3", out="/nowhere")
    >>> found.table["verdict"].tolist()
    ['not run']
    """
    from radarsim.app.run import claims as rows

    return Claims(rows(names, out))


def readings(
    *names: str,
    only: Mapping[str, str] | Sequence[str] = (),
    realisations: float | None = None,
    decide: bool = False,
    threads: int | None = None,
    time_limit: "float | Stop | None" = None,
    out: Out | None = None,
    figures: bool = True,
    progress: Progress | None = None,
    stop: "Signals | None" = None,
) -> "Done":
    """A verdict under every reading that the papers allow, of claims (P1.4) or of whole papers (P1); without, of all.

    Exact where that is possible, else by runs of so many realisations, by default as many as the paper's readings
    declare; decide: of more, up to so many, until each claim is decided. only: readings that take these alternatives,
    `{"start": "unweighted"}`. time_limit is in seconds. out: where readings.csv and a figure a claim are written, and
    where runs are stored and continued.

    `table` is readings.csv: a row a claim, reading and part. Raises ConfigError for names that do not exist,
    TargetUnmet where the time did not suffice.

    >>> readings("P1.4")
    P1.4 depends on: holds in 4 of 6 readings; depends on: start
    """
    from tempfile import TemporaryDirectory

    from radarsim.app import readings as reading
    from radarsim.app.run import RunOptions
    from radarsim.engine import run

    alternatives = [f"{key}={value}" for key, value in only.items()] if isinstance(only, Mapping) else only
    wanted = reading.asked(names, alternatives)
    limit = time_limit if time_limit is None or callable(time_limit) else run.TimeLimit(time_limit)
    asked: dict[str, Any] = {"realisations": None if realisations is None else int(realisations), "decide": decide}
    asked |= {"progress": progress, "figures": figures, "stop": stop, "write": out is not None}
    with TemporaryDirectory(prefix="radarsim-") as folder, limited(threads):
        options = RunOptions(None, threads, run.Either(stop, limit))
        return reading.readings(wanted, out=Path(folder if out is None else out), options=options, **asked)
