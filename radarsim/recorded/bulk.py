"""The plots of many realisations in a file: arrays of NumPy (.npz), or one row a plot as Parquet or CSV. Memory does
not grow with their number."""

import os
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from radarsim.config.experiment import Experiment
from radarsim.errors import ConfigError
from radarsim.recorded import follow
from radarsim.recorded.plots import cells
from radarsim.report.files import Writer
from radarsim.studies.interface import Drawn

NUMBERS = 200_000  # drawn at a time: what a processor keeps near
Parts = Callable[[], Iterator[Drawn]]  # the plots, drawn anew at each call


def write(
    experiment: Experiment, n: int, first: int, path: str | os.PathLike, progress: Callable[[int, int], object]
) -> Drawn:
    """Write the plots of n realisations of an experiment's one case from number `first` on, in the format that the
    path's ending names, CSV by default. Returns those of the first ones.

    Raises ConfigError as `follow.batches`, or where a format's package is missing; errors of `Writer`.
    """
    to = FORMATS.get(Path(path).suffix.lower(), to_csv)
    one = next(follow.batches(experiment, n, first, chunk=2))
    size = max(8, NUMBERS // sum(array[0].size for array in one.arrays().values()))

    def parts() -> Iterator[Drawn]:
        for part in follow.batches(experiment, n, first, size):
            yield part
            progress(part.first - first + part.n, n)

    with Writer(path, {"the config": experiment.path}) as file:
        to(file, one, parts, n)
    return one


def to_npz(file: Writer, one: Drawn, parts: Parts, n: int) -> None:
    """`realisation` (n,), `t_s` (K,), and each array (n, K) or (n, K, M); (1, K) where all realisations have the same.

    One array after the other, so that the plots are drawn as often as there are arrays.
    """
    widest = max(array.shape[2] for part in parts() for array in part.columns.values()) if one.several else 0
    first, alone = {"realisation": np.arange(one.n), **one.arrays()}, {"t_s": one.t_s}
    alone |= {name: array[:1] for name, array in first.items() if array.strides[0] == 0}
    with zipfile.ZipFile(file.binary, "w") as archive:
        for name, array in (first | alone).items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                if name in alone:
                    np.lib.format.write_array(member, np.ascontiguousarray(array))
                    continue
                shape = (n, *array.shape[1:2], *[widest] * (array.ndim - 2))
                header = {"descr": np.lib.format.dtype_to_descr(array.dtype), "fortran_order": False, "shape": shape}
                np.lib.format.write_array_header_1_0(member, header)
                for part in parts():
                    values = part.arrays().get(name, np.arange(part.first, part.first + part.n))
                    if values.ndim == 3:
                        more = widest - values.shape[2]
                        values = np.pad(values, ((0, 0), (0, 0), (0, more)), constant_values=np.nan)
                    member.write(values.tobytes())


def to_csv(file: Writer, one: Drawn, parts: Parts, n: int) -> None:
    """The rows of all realisations, with the number of each in the column `realisation`."""
    file.write([tuple(one.table())])
    for part in parts():
        file.write(zip(*map(cells, part.table().values()), strict=True))


def to_parquet(file: Writer, one: Drawn, parts: Parts, n: int) -> None:
    """The same rows as numbers."""
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError as error:
        need = "Parquet needs pyarrow (pip install 'radarsim[parquet]'); .npz and .csv do not"
        raise ConfigError(f"{file.path}: {need}") from error
    schema = pyarrow.table(one.table()).schema
    with parquet.ParquetWriter(file.binary, schema) as rows:
        for part in parts():
            rows.write_table(pyarrow.table(part.table(), schema))


FORMATS = {".npz": to_npz, ".parquet": to_parquet}  # beside CSV
