"""Recorded plots from Python: simulate, read, track, fit, with pandas in and out."""

import os
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from radarsim.app.configs import Config, Overrides, load
from radarsim.recorded import fit as fitting
from radarsim.recorded import follow
from radarsim.recorded import plots as files

if TYPE_CHECKING:
    import pandas as pd

    from radarsim.studies.interface import Drawn

Found = TypeVar("Found")


def simulate(config: Config, realisation: int = 0, overrides: Overrides = ()) -> "pd.DataFrame":
    """Return one realisation's plots, exactly those of a run, with the truth in columns true_….

    Raises ConfigError for an invalid config, a config of several cases, or a study without recorded plots.

    >>> import radarsim
    >>> radarsim.simulate("rls2").columns.tolist()[:3]
    ['t_s', 'range_m', 'velocity_mps']
    """
    import pandas as pd

    return pd.DataFrame(follow.simulated(load(config, overrides), realisation))


def plots(
    config: Config, n: int = 1000, first: int = 0, overrides: Overrides = (), chunk: int | None = None
) -> "Drawn | Iterator[Drawn]":
    """Return the plots of realisations first … first + n - 1, exactly those of a run, with the truth, as arrays.

    t_s (K,) are the times of the scans, columns[name] (n, K) what is measured, with NaN where a plot is missed, and
    truth (n, K, C) the true state, whose components are named with their units. Where a scan may have several plots,
    columns are (n, K, M), filled up with NaN. With chunk, an iterator of as many realisations at a time, in flat
    memory; a filter over all of them may take 10 million.

    Raises ConfigError for an invalid config, a config of several cases, or a study without plots.

    >>> import radarsim
    >>> made = radarsim.plots("rls2", n=500)
    >>> made
    <plots of realisations 0 … 499, 15 scans: range_m, velocity_mps; truth r (m), Vr (m/s), ar (m/s2)>
    >>> made.columns["range_m"].shape, made.truth.shape
    ((500, 15), (500, 15, 3))
    >>> [part.n for part in radarsim.plots("rls2", n=500, chunk=200)]
    [200, 200, 100]
    """
    parts = follow.batches(load(config, overrides), n, first, chunk)
    return next(parts) if chunk is None else parts


def read_plots(path: str | os.PathLike[str]) -> "pd.DataFrame":
    """Read a file of plots as written by `radarsim import` or `radarsim simulate`: numbers, and the column `track` as
    text.

    Raises ConfigError if it cannot be read.
    """
    import pandas as pd

    from radarsim.errors import ConfigError

    try:
        texts = pd.read_csv(path, comment="#", dtype=str, keep_default_na=False)
        # Python's own parsing of numbers loses no digit.
        measured = [str(name) for name in texts if name != files.TRACK]
        numbers = {name: texts[name].replace("", "nan").astype(float) for name in measured}
    except (OSError, ValueError) as error:
        raise ConfigError(f"{os.fspath(path)}: cannot be read: {error}") from error
    return texts.assign(**numbers)


def track(
    config: Config, recorded: "str | os.PathLike[str] | pd.DataFrame", overrides: Overrides = ()
) -> "pd.DataFrame":
    """Run the config's filters over recorded plots (a file or a table); returns the columns of `radarsim track`.

    Raises ConfigError with all faults of config and plots.

    >>> import radarsim
    >>> found = radarsim.track("rls2", radarsim.simulate("rls2"))
    >>> found[found["component"] == "r"].groupby("filter").size().to_dict()
    {'r': 15, 'r+Vr': 15}
    """
    import pandas as pd

    rows: list[tuple[str, ...]] = []
    header: list[str] = []

    def sink(piece: Any, name: str | None) -> None:
        header[:] = files.header_of(piece, name is not None)
        rows.extend(files.rows_of(piece, name))

    experiment = load(config, overrides)
    _with_file(recorded, lambda path: follow.follow(experiment, path, sink))
    table = pd.DataFrame(rows, columns=header)
    text = ("recorded_track", "filter", "component", "unit")
    return table.assign(**{name: pd.to_numeric(table[name]) for name in header if name not in text})


def fit(
    config: Config,
    recorded: "str | os.PathLike[str] | pd.DataFrame",
    overrides: Overrides = (),
    filter_name: str | None = None,
    robust: bool = False,
) -> "pd.DataFrame":
    """Fit σ and the manoeuvre variance to recorded plots (a file or a table), with 95 % intervals.

    Columns: key, stated, value, lo, hi, identifiable. robust: allow for outliers. Raises ConfigError.

    >>> import radarsim
    >>> plots = radarsim.simulate("rls2", overrides=["scans=60"])
    >>> radarsim.fit("rls2", plots)["key"].tolist()
    ['radar.sigma_range_m', 'radar.sigma_velocity_mps', 'manoeuvre_variance']
    """
    import pandas as pd

    experiment = load(config, overrides)
    found = _with_file(recorded, lambda path: fitting.fit(experiment, path, filter_name, robust))
    names = ("key", "stated", "value", "lo", "hi", "identifiable")
    return pd.DataFrame([{name: getattr(one, name) for name in names} for one in found.keys], columns=names)


def _with_file(recorded: "str | os.PathLike[str] | pd.DataFrame", act: Callable[[str], Found]) -> Found:
    """Call with the file of recorded plots; a table is first written into a temporary one."""
    if isinstance(recorded, str | os.PathLike):
        return act(os.fspath(recorded))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "plots.csv"
        recorded.to_csv(path, index=False)
        return act(str(path))
