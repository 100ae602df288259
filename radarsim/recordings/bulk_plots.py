"""Write the plots of many realisations as .npz, Parquet or CSV, in flat memory.

Parquet and CSV have one row for each plot. Memory does not grow with the number of realisations."""

import os
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from radarsim.config.experiment import Experiment
from radarsim.errors import ConfigError
from radarsim.recordings.csv_output import column_texts
from radarsim.recordings.simulate_plots import plot_batches
from radarsim.report.atomic_files import OutputFile
from radarsim.studies.plot_arrays import SimulatedPlots

NUMBERS_PER_DRAW = 200_000  # drawn at a time: what fits into the caches of a processor
PlotSource = Callable[[], Iterator[SimulatedPlots]]  # draws the plots again at each call


def write_realisations(
    experiment: Experiment, n: int, first: int, path: str | os.PathLike, progress: Callable[[int, int], object]
) -> SimulatedPlots:
    """Write the plots of n realisations of an experiment's one case from number `first` on, in the format that the
    path's ending names, CSV by default. Returns those of the first ones.

    Raises ConfigError as `plot_batches`, or where a format's package is missing; errors of `OutputFile`."""
    write = BULK_WRITERS.get(Path(path).suffix.lower(), write_csv)
    first_plots = next(plot_batches(experiment, n, first, chunk=2))
    size = max(8, NUMBERS_PER_DRAW // sum(array[0].size for array in first_plots.arrays().values()))

    def batches() -> Iterator[SimulatedPlots]:
        for batch in plot_batches(experiment, n, first, size):
            yield batch
            progress(batch.first - first + batch.n, n)

    with OutputFile(path, {"the config": experiment.path}) as file:
        write(file, first_plots, batches, n)
    return first_plots


def write_npz(file: OutputFile, first_plots: SimulatedPlots, batches: PlotSource, n: int) -> None:
    """`seed`, `t_s` (K,), `realisation` (n,), and each array (n, K) or (n, K, M); (1, K) where all have the same. One
    array after the other, so that the plots are drawn as often as there are arrays."""
    widest = (
        max(array.shape[2] for batch in batches() for array in batch.columns.values()) if first_plots.several else 0
    )
    arrays = {"realisation": np.arange(first_plots.n), **first_plots.arrays()}
    single_arrays = {"t_s": first_plots.t_s, "seed": np.array(first_plots.seed)}
    single_arrays |= {name: array[:1] for name, array in arrays.items() if array.strides[0] == 0}
    with zipfile.ZipFile(file.binary, "w") as archive:
        for name, array in (arrays | single_arrays).items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                if name in single_arrays:
                    np.lib.format.write_array(member, np.asarray(array, order="C"))
                    continue
                shape = (n, *array.shape[1:2], *[widest] * (array.ndim - 2))
                header = {"descr": np.lib.format.dtype_to_descr(array.dtype), "fortran_order": False, "shape": shape}
                np.lib.format.write_array_header_1_0(member, header)
                for batch in batches():
                    values = batch.arrays().get(name, np.arange(batch.first, batch.first + batch.n))
                    if values.ndim == 3:
                        padding = widest - values.shape[2]
                        values = np.pad(values, ((0, 0), (0, 0), (0, padding)), constant_values=np.nan)
                    member.write(values.tobytes())


def write_csv(file: OutputFile, first_plots: SimulatedPlots, batches: PlotSource, n: int) -> None:
    """The rows of all realisations, with the number of each in the column `realisation`."""
    file.write([tuple(first_plots.table())])
    for batch in batches():
        file.write(zip(*map(column_texts, batch.table().values()), strict=True))


def write_parquet(file: OutputFile, first_plots: SimulatedPlots, batches: PlotSource, n: int) -> None:
    """The same rows as numbers."""
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError as error:
        need = "Parquet needs pyarrow (pip install 'radarsim[parquet]'); .npz and .csv do not"
        raise ConfigError(f"{file.path}: {need}") from error
    schema = pyarrow.table(first_plots.table()).schema
    with parquet.ParquetWriter(file.binary, schema) as writer:
        for batch in batches():
            writer.write_table(pyarrow.table(batch.table(), schema))


BULK_WRITERS = {".npz": write_npz, ".parquet": write_parquet}  # beside CSV
