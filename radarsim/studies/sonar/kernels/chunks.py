"""Chunks of realisations, eight of them in a group, and the layout of their recent plots."""

from radarsim.kernels.compiler import kernel_part
from radarsim.kernels.lanes import WIDTH

CHUNK = 512  # realisations, as in `shared_gains`
GROUPS = CHUNK // WIDTH
PITCH = GROUPS + 1  # of the rows of recent plots: rows 4 KiB apart would all use the same few lines of the cache
ROW = PITCH * WIDTH


@kernel_part
def copy_row(source, target):
    """Copy a row (CHUNK,); an assignment to a slice has Numba compile texts of errors for seconds."""
    for i in range(target.size):
        target[i] = source[i]
