"""Small matrices of lanes in the rows of an array: each `stride` rows after the one before."""

from radarsim.kernels.compiler import inline
from radarsim.kernels.lanes import WIDTH, get, put, where_greater


@inline
def get3(pointer, first, stride=1):
    """Three numbers, from row `first` on."""
    return get(pointer, first), get(pointer, first + stride), get(pointer, first + 2 * stride)


@inline
def get4(pointer, first, stride=1):
    """Four numbers, from row `first` on."""
    return (*get3(pointer, first, stride), get(pointer, first + 3 * stride))


@inline
def get6(pointer, first, stride=1):
    """Six numbers, from row `first` on."""
    return get3(pointer, first, stride) + get3(pointer, first + 3 * stride, stride)


@inline
def put3(pointer, first, x, stride=1):
    """Write three numbers, from row `first` on."""
    put(pointer, first, x[0])
    put(pointer, first + stride, x[1])
    put(pointer, first + 2 * stride, x[2])


@inline
def put4(pointer, first, x, stride=1):
    """Write four numbers, from row `first` on."""
    put3(pointer, first, x, stride)
    put(pointer, first + 3 * stride, x[3])


@inline
def put6(pointer, first, x, stride=1):
    """Write six numbers, from row `first` on."""
    put3(pointer, first, (x[0], x[1], x[2]), stride)
    put3(pointer, first + 3 * stride, (x[3], x[4], x[5]), stride)


@inline
def choose3(x, y, yes, no):
    """`where_greater` of three numbers."""
    return where_greater(x, y, yes[0], no[0]), where_greater(x, y, yes[1], no[1]), where_greater(x, y, yes[2], no[2])


@inline
def choose6(x, y, yes, no):
    """`where_greater` of six numbers."""
    return choose3(x, y, yes[:3], no[:3]) + choose3(x, y, yes[3:], no[3:])


@inline
def lane3(pointer, first):
    """Three plain numbers of one lane, whose address it is, from row `first` on."""
    return pointer[first * WIDTH], pointer[(first + 1) * WIDTH], pointer[(first + 2) * WIDTH]


@inline
def put_lane3(pointer, first, x):
    """Write three plain numbers of one lane."""
    pointer[first * WIDTH], pointer[(first + 1) * WIDTH], pointer[(first + 2) * WIDTH] = x
