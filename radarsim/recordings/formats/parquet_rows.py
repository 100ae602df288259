"""Columns of a Parquet file, as a sheet."""

import itertools
from collections.abc import Iterator
from typing import BinaryIO

from radarsim.errors import ConfigError
from radarsim.recordings.formats import records
from radarsim.recordings.formats.cell_text import cell_text
from radarsim.recordings.formats.sheet import Sheet


def read_parquet(path: str, file: BinaryIO) -> Sheet:
    """The columns of a Parquet file that are numbers, text or moments."""
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError as error:
        raise records.missing_package("pyarrow", "parquet") from error
    try:
        table = parquet.ParquetFile(file)
        flat = [field.name for field in table.schema_arrow if not pyarrow.types.is_nested(field.type)]
    except (pyarrow.ArrowException, OSError, ValueError) as error:
        raise ConfigError(f"{path}: must be a Parquet file: {_one_line(error)}") from error

    def rows() -> Iterator[tuple[int, list[str]]]:
        number = itertools.count(1)
        try:
            for batch in table.iter_batches(batch_size=records.BATCH_ROWS, columns=flat):
                columns = [map(cell_text, column.to_pylist()) for column in batch.columns]
                yield from zip(number, map(list, zip(*columns, strict=True)), strict=False)
        except (pyarrow.ArrowException, OSError, ValueError, OverflowError) as error:
            raise ConfigError(f"{path}: is damaged at row {next(number)} or after: {_one_line(error)}") from error

    return Sheet(path, flat, rows())


def _one_line(error: Exception) -> str:
    return "".join(c for c in " ".join(str(error).split())[:200] if c.isprintable())
