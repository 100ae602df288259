"""Realisations whose normals are shifted towards a wrong fold, and the weights that make up for it.

The normals z of a realisation are drawn from the mixture α₀ N(0, 1) + Σ α_m N(s_m u_m, 1), u_m unit vectors. The ratio
of the law that they should have to the one that they have is

    w(z) = 1 / (α₀ + Σ α_m exp(s_m u_mᵀ z − s_m²/2)),

at most 1/α₀ (Owen & Zhou, Journal of the American Statistical Association 95, 2000, 135).
"""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.compile import kernel, part
from radarsim.kernels.lanes import WIDTH, address, exponential, full, get, put, row, rows
from radarsim.kernels.random import uniforms
from radarsim.studies.ambiguous_doppler.kernels import records as rec
from radarsim.studies.ambiguous_doppler.kernels.plots import fill_normals, put_plots
from radarsim.studies.ambiguous_doppler.kernels.records import Banks, Sums, World, memory
from radarsim.studies.ambiguous_doppler.kernels.sums import add_group, run_filters

# A fold of the best hypothesis is wrong; the velocity is off by over half the span; a fold is wrong, and the right
# hypothesis left the list at a scan that left it as long as it may be.
WRONG, BEYOND, FULL, EVENTS = 0, 1, 2, 3


class Mixture(NamedTuple):
    """A mixture of M shifted laws beside the plain one, over a realisation's normals as `plots.fill_normals` has them.

    key (2,)              of the stream that says which part a realisation is drawn from
    cumulative (M + 1,)   running sums of the shares α, the plain one first; the last is 1
    shift (M,)            s_m
    units (M, 2 + 2K)     u_m
    """

    key: np.ndarray
    cumulative: np.ndarray
    shift: np.ndarray
    units: np.ndarray


class Losses(NamedTuple):
    """Weighted sums over realisations.

    events (F, K, EVENTS, 4)   Σw, Σw², the number, and Σw⁴ of the realisations that have it
    drawn  (3,)                realisations that are plain, and Σw, Σw² of all
    """

    events: np.ndarray
    drawn: np.ndarray


@part
def drawn_from(mixture, realisation):
    """Which part of the mixture a realisation is drawn from: 0 is the plain law, m is shifted along u_m−1."""
    which, _ = uniforms(mixture.key[0], mixture.key[1], realisation, 0)
    m = 0
    while which > mixture.cumulative[m]:
        m += 1
    return m


@part
def weigh(mixture, normals, weights):
    """The weights of eight realisations into a row, from the rows of their normals; both are addresses."""
    density = full(mixture.cumulative[0])
    for m in range(mixture.shift.size):
        along, shift = full(0.0), mixture.shift[m]
        for r in range(mixture.units.shape[1]):
            along = along + mixture.units[m, r] * get(normals, r)
        share = mixture.cumulative[m + 1] - mixture.cumulative[m]
        density = density + share * exponential(shift * along - 0.5 * shift * shift)
    put(weights, 0, 1.0 / density)


@kernel
def fill_shifted(world, mixture, first, normals, chosen, weights):
    """Normals of realisations first … first + 7, each shifted by the part that it is drawn from; chosen, weights (8,).

    chosen is the number of the part, 0 the plain law.
    """
    fill_normals(world, first, normals)
    for n in range(WIDTH):
        chosen[n] = m = drawn_from(mixture, first + n)
        if m > 0:
            for r in range(mixture.units.shape[1]):
                normals[WIDTH * r + n] += mixture.shift[m - 1] * mixture.units[m - 1, r]
    weigh(mixture, address(normals), address(weights))


@part
def add_event(weight, to):
    """Count an event of a realisation."""
    to[0] += weight
    to[1] += weight * weight
    to[2] += 1.0
    to[3] += weight**4


@part
def add_events(world, banks, memory, weights, size, losses):
    """Add what befell the first `size` of a group of eight realisations, by their weights."""
    scans, out = world.truth.shape[0], address(memory.out)
    for f in range(banks.bank.size):
        most, gone, crowded = banks.most[banks.bank[f]], 0, 0  # a bit for each of the eight
        for k in range(scans):
            plot = row(address(memory.plots), k * rec.PLOT)
            bank = row(out, (banks.bank[f] * scans + k) * rec.OUTPUT)
            velocity = row(bank, banks.place[f] + 1)
            for n in range(size):
                if bank[rec.LISTED * WIDTH + n] == 0.0 and gone >> n & 1 == 0:
                    gone |= 1 << n
                    crowded |= (1 if bank[rec.COUNT * WIDTH + n] >= most else 0) << n
                if bank[rec.RIGHT * WIDTH + n] == 0.0:
                    add_event(weights[n], losses.events[f, k, WRONG])
                    if crowded >> n & 1 == 1:
                        add_event(weights[n], losses.events[f, k, FULL])
                if abs(velocity[n] - plot[(rec.TRUTH + 1) * WIDTH + n]) > 0.5 * world.spans[k]:
                    add_event(weights[n], losses.events[f, k, BEYOND])


@kernel
def add_block(world, banks, mixture, memory, room, sums, losses, first, count):
    """Add the realisations first … first + count - 1: all to the losses, by their weights, plain ones to the sums."""
    chosen, weights = room
    for group in range(0, count, WIDTH):
        fill_shifted(world, mixture, first + group, memory.normals, chosen, weights)
        put_plots(world, first + group, memory.normals, memory.plots)
        run_filters(world, banks, memory, group == 0)
        size = min(WIDTH, count - group)
        for n in range(WIDTH):
            memory.counted[n] = 1.0 if n < size and chosen[n] == 0 else 0.0
        for n in range(size):
            losses.drawn[0] += memory.counted[n]
            losses.drawn[1] += weights[n]
            losses.drawn[2] += weights[n] * weights[n]
        add_events(world, banks, memory, weights, size, losses)
        add_group(world, banks, memory, sums)


def simulate_block(
    world: World, banks: Banks, mixture: Mixture, sums: Sums, losses: Losses, first: int, count: int
) -> None:
    """Add realisations first … first + count - 1, each plot of which is detected."""
    room = np.zeros(WIDTH, np.int64), rows(1)
    add_block(world, banks, mixture, memory(len(world.t), banks), room, sums, losses, first, count)
