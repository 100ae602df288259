"""Recorded plots from Python: simulate, read, track, fit, register, with pandas in and out."""

import os
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

from radarsim.api.configs import Config, Overrides, load
from radarsim.api.display import Displayable
from radarsim.errors import ConfigError
from radarsim.recordings import csv_output, simulate_plots
from radarsim.recordings import read_plots as recordings_read_plots
from radarsim.recordings import track as recordings_track
from radarsim.recordings.fit import fit as fit_fit
from radarsim.recordings.formats import asterix
from radarsim.recordings.registration import register as registration_register
from radarsim.recordings.registration import result, sentences

if TYPE_CHECKING:
    import pandas as pd

    from radarsim.studies.plot_arrays import SimulatedPlots


Output = TypeVar("Output")
RecordingSource: TypeAlias = "str | os.PathLike[str] | pd.DataFrame"


def simulate(config: Config, realisation: int = 0, overrides: Overrides = ()) -> "pd.DataFrame":
    """Return one realisation's plots, exactly those of a run, with the truth in columns true_….

    Raises ConfigError for an invalid config, a config of several cases, or a study without recorded plots.

    >>> import radarsim
    >>> radarsim.simulate("rls2").columns.tolist()[:3]
    ['t_s', 'range_m', 'velocity_mps']
    """
    import pandas as pd

    return pd.DataFrame(simulate_plots.simulate_realisation(load(config, overrides), realisation))


def plots(
    config: Config,
    n: int = 1000,
    first: int = 0,
    overrides: Overrides = (),
    chunk: int | None = None,
    purpose: str = "judging",
) -> "SimulatedPlots | Iterator[SimulatedPlots]":
    """Return the plots of realisations first … first + n - 1, exactly those of a run, with the truth, as arrays.

    t_s (K,) are the times of the scans, columns[name] (n, K) what is measured, with NaN where a plot is missed, and
    truth (n, K, C) the true state, whose components are named with their units. Where a scan may have several plots,
    columns are (n, K, M), filled up with NaN. With chunk, an iterator of as many realisations at a time, in flat
    memory; a filter over all of them may take 10 million.

    purpose="training" draws the same world with another seed, for a filter that learns: judged on the realisations that
    it has learned, it would be better than it is.

    Raises ConfigError for an invalid config, a config of several cases, or a study without plots.

    >>> import radarsim
    >>> made = radarsim.plots("rls2", n=500)
    >>> made
    <plots of realisations 0 … 499, 15 scans: range_m, velocity_mps; truth r (m), Vr (m/s), ar (m/s2)>
    >>> made.columns["range_m"].shape, made.truth.shape
    ((500, 15), (500, 15, 3))
    >>> [part.n for part in radarsim.plots("rls2", n=500, chunk=200)]
    [200, 200, 100]
    >>> bool((radarsim.plots("rls2", n=500, purpose="training")["range_m"] == made["range_m"]).any())
    False
    """
    parts = simulate_plots.plot_batches(load(config, overrides), n, first, chunk, purpose)
    return next(parts) if chunk is None else parts


def read_plots(path: str | os.PathLike[str]) -> "pd.DataFrame":
    """Read a file of plots as written by `radarsim import` or `radarsim simulate`: numbers, and text where
    that names something (`track`, `radar`, `address`, `mode_3a`, …).

    Raises ConfigError if it cannot be read."""
    import pandas as pd

    if not isinstance(path, str | os.PathLike):
        raise ConfigError(f"path: must be the path of a file, as str or Path, got {path!r}")
    try:
        texts = pd.read_csv(path, comment="#", dtype=str, keep_default_na=False)
    except (OSError, ValueError) as error:
        raise ConfigError(f"{os.fspath(path)}: cannot be read: {error}") from error
    faults = []
    for number, name in enumerate(texts, start=1):
        if name not in (recordings_read_plots.TRACK_COLUMN, "radar", *asterix.TEXT_COLUMNS):
            try:
                texts[name] = texts[name].replace("", "nan").astype(float)  # Python's own parsing loses no digit
            except ValueError:
                row = int(pd.to_numeric(texts[name].replace("", "0"), errors="coerce").isna().argmax())
                must = f"{number}: {name}: must be a number or empty, got {texts[name][row]!r}"
                faults.append(f"{recordings_read_plots.row_location(path, row)}:{must}")
    if faults:
        raise ConfigError(*faults)
    return texts


def track(config: Config, recorded: RecordingSource, overrides: Overrides = ()) -> "pd.DataFrame":
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
        header[:] = csv_output.track_header(piece, name is not None)
        rows.extend(csv_output.track_lines(piece, name))

    experiment = load(config, overrides)
    _with_file(recorded, lambda path: recordings_track.track_plots(experiment, path, sink))
    table = pd.DataFrame(rows, columns=header)
    text = ("recorded_track", "filter", "component", "unit")
    return table.assign(**{name: pd.to_numeric(table[name]) for name in header if name not in text})


def fit(
    config: Config,
    recorded: RecordingSource,
    overrides: Overrides = (),
    filter: str | None = None,
    allowing: Sequence[str] | None = None,
) -> "pd.DataFrame":
    """Fit σ and the manoeuvre variance to recorded plots (a file or a table), with 95 % intervals.

    Columns: key, stated, value, lo, hi, identifiable; plain, plain_lo, plain_hi: of errors that are normal and
    independent. allowing: for "outliers", "correlation" (a further key correlation_time_s) or both; default: for
    those that the plots show plainly. Raises ConfigError.

    >>> import radarsim
    >>> plots = radarsim.simulate("rls2", overrides=["scans=60"])
    >>> radarsim.fit("rls2", plots)["key"].tolist()
    ['radar.sigma_range_m', 'radar.sigma_velocity_mps', 'manoeuvre_variance']
    """
    import pandas as pd

    if allowing is not None and (
        not isinstance(allowing, list | tuple) or any(name not in fit_fit.FITTED_EXPLANATIONS for name in allowing)
    ):
        raise ConfigError(f"allowing: must be a list of {', '.join(fit_fit.FITTED_EXPLANATIONS)}, got {allowing!r}")
    experiment = load(config, overrides)
    fitted = _with_file(recorded, lambda path: fit_fit.fit_plots(experiment, path, filter, allowing))
    return pd.DataFrame(fit_fit.fit_rows(fitted))


class RegistrationResult(Displayable):
    """The biases of a radar; its text is the answer.

    biases: a row for each of range_m, range_scale, bearing_rad, time_s with value, lo, hi (95 %), identifiable, why (it
    is not). aircraft: a row for each with its remaining errors: range_m, bearing_rad (medians), time_s, sigma_time_s.
    findings: a row for each error that the biases do not describe: coordinate, companion (what it goes with), cause (''
    if unknown), keys, rivals (causes that the plots do not exclude); coefficients: of the causes, as biases.
    sigma_range_m, sigma_bearing_rad: of a plot, without outliers. plots, matched: their number, and those with a
    position of their aircraft."""

    def __init__(self, registration: result.Registration):
        import pandas as pd

        self._registration = registration
        document = result.registration_document(registration)
        self.biases, self.aircraft = (pd.DataFrame(document[name]) for name in ("biases", "aircraft"))
        self.findings, self.coefficients = (
            pd.DataFrame(document[name], columns=[field.name for field in fields(row_type)])
            for name, row_type in (("findings", result.Finding), ("coefficients", result.Bias))
        )
        self.sigma_range_m, self.sigma_bearing_rad = registration.adjustment.sigma
        self.plots, self.matched = registration.plots, registration.matched

    def _answer_lines(self) -> Sequence[str]:
        return sentences.registration_lines(self._registration)


def register(radar: RecordingSource, other: RecordingSource) -> RegistrationResult:
    """Find the biases of a radar's plots against positions of the same aircraft, each a file as `radarsim import`
    writes it, or a table with its columns, whose times then have the same zero.

    Plots: t_s, range_m, bearing_rad; positions: t_s, x_m, y_m, z_m (north, up, east of the radar); both: address,
    callsign or mode_3a, or track as the address. The model, its errors and sources: `radarsim.recordings.registration`.
    Raises ConfigError where too few plots have a position.

    >>> import numpy as np, pandas as pd, radarsim
    >>> t = np.arange(0.0, 300, 5)
    >>> flown = pd.concat([pd.DataFrame({"t_s": t, "track": name, "x_m": x + 200 * t, "y_m": 9e3, "z_m": 150 * t})
    ...                    for name, x in (("a", -3e4), ("b", 4e4), ("c", -9e4), ("d", 2e4))])
    >>> plots = flown.assign(range_m=np.linalg.norm(flown[["x_m", "y_m", "z_m"]], axis=1) + 50,
    ...                      bearing_rad=np.arctan2(flown["z_m"], flown["x_m"]) % 6.283185307179586)
    >>> radarsim.register(plots, flown).biases.set_index("key")["value"].round(6).abs().to_dict()
    {'range_m': 50.0, 'range_scale': 0.0, 'bearing_rad': 0.0, 'time_s': 0.0}
    """
    return _with_file(
        radar,
        lambda path: _with_file(
            other, lambda other_path: RegistrationResult(registration_register.register_radar(path, other_path))
        ),
    )


def _with_file(recorded: RecordingSource, act: Callable[[str], Output]) -> Output:
    """Call with the file of recorded plots; a table is first written into a temporary one."""
    if isinstance(recorded, str | os.PathLike):
        return act(os.fspath(recorded))
    if not hasattr(recorded, "to_csv"):
        raise ConfigError(f"recorded: must be the path of a file or a table (pandas), got {recorded!r}")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "plots.csv"
        recorded.to_csv(path, index=False)
        try:
            return act(str(path))
        except ConfigError as error:
            raise ConfigError(*(line.replace(str(path), "the table") for line in error.lines)) from error
