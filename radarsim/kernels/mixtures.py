"""Realisations drawn from a mixture of laws (importance sampling): which law, and the sums of their weights."""

from radarsim.kernels.compiler import inline
from radarsim.kernels.random import uniforms


@inline
def law_index(key, cumulative, realisation):
    """The index of the law of a mixture that a realisation is drawn from, 0 for the plain law.

    cumulative (M + 1,): cumulative shares of the laws, the last is 1."""
    u, _ = uniforms(key[0], key[1], realisation, 0)
    m = 0
    while u > cumulative[m]:
        m += 1
    return m


@inline
def add_event_weight(w, sums, j):
    """Add an event of weight w to row j of sums (n, 4): Σw, Σw², number and Σw⁴."""
    sums[j, 0] += w
    sums[j, 1] += w * w
    sums[j, 2] += 1.0
    sums[j, 3] += w**4


@inline
def add_realisation_weight(w, plain, weight_sums):
    """Add a realisation of weight w, drawn from the plain law or not, to weight_sums (3,): plain ones, Σw and Σw²."""
    weight_sums[0] += plain
    weight_sums[1] += w
    weight_sums[2] += w * w
