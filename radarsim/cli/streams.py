"""Standard streams that never end a command: what cannot be written is dropped, and the exit code says so at the end.

A write can fail at any time: in the middle of a run, in a warning, when the interpreter flushes its buffers after the
last statement. So the error is caught where all of these meet, below the buffers, and the work goes on.
"""

import contextlib
import errno
import io
import os
import select
import sys
from collections.abc import Iterator
from typing import Any

from radarsim.errors import StoreError


class TolerantFile(io.FileIO):
    """A file that is open for writing and drops all data from the first error on; `error` keeps this error."""

    error: OSError | None = None

    def write(self, data: Any, /) -> int:
        """Write some of the data, as files do; the number of bytes that need not be written again."""
        if self.error is None:
            try:
                while (count := super().write(data)) is None:  # a full pipe whose other side made it non-blocking
                    select.select([], [self], [])
                return count
            except OSError as error:
                self.error = error
        return len(data)


@contextlib.contextmanager
def tolerant_output() -> Iterator[None]:
    """While entered, and when the interpreter exits, writing to standard output and error raises nothing.

    An answer that could not be written turns exit code 0 into that of StoreError, with a line on standard error. A
    reader that has closed its pipe (`| head`) and a closed descriptor (`>&-`) are no faults.
    """
    for name in ("stdin", "stdout", "stderr"):
        if getattr(sys, name) is None:  # its descriptor is closed: the null device takes it, before another file does
            mode = "r" if name == "stdin" else "w"
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8", errors="replace"))  # noqa: SIM115
    output, _ = _replace("stdout"), _replace("stderr")
    code: str | int | None = None
    try:
        yield
    except SystemExit as exit_request:
        code = exit_request.code
    sys.stdout.flush()
    if output is not None and output.error is not None and output.error.errno != errno.EPIPE:
        sys.stderr.write(f"output: cannot be written: {output.error.strerror}\n")
        code = code or StoreError.exit_code
    sys.exit(code)


def _replace(name: str) -> TolerantFile | None:
    """Put a stream over a tolerant file in the place of a standard one; it takes every character."""
    stream = getattr(sys, name)
    if stream is not getattr(sys, f"__{name}__"):  # the null device, or a stream of another program
        return None
    file = TolerantFile(stream.fileno(), "w", closefd=False)
    buffered = io.BufferedWriter(file)
    by_line = stream.line_buffering or stream.write_through
    setattr(sys, name, io.TextIOWrapper(buffered, encoding=stream.encoding, errors="replace", line_buffering=by_line))
    return file
