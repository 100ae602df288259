"""Realisations whose normals are shifted towards a wrong fold, and the weights that correct for the shift.

The normals z of a realisation are drawn from the mixture α₀ N(0, 1) + Σ α_m N(s_m u_m, 1), u_m unit vectors. The ratio
of the density of N(0, 1) to that of the mixture is

    w(z) = 1 / (α₀ + Σ α_m exp(s_m u_mᵀ z − s_m²/2)),

at most 1/α₀ (Owen & Zhou, Journal of the American Statistical Association 95, 2000, 135)."""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.compiler import kernel, kernel_part
from radarsim.kernels.lanes import WIDTH, address, exponential, full, get, put, row, rows
from radarsim.kernels.mixtures import add_event_weight, add_realisation_weight, law_index
from radarsim.studies.ambiguous_doppler.kernels import layout
from radarsim.studies.ambiguous_doppler.kernels.layout import Banks, Sums, World, work_arrays
from radarsim.studies.ambiguous_doppler.kernels.plots import fill_normals, put_plots
from radarsim.studies.ambiguous_doppler.kernels.sums import add_group, run_filters

# A fold of the best hypothesis is wrong; the velocity is off by more than half the span; a fold is wrong, and the right
# hypothesis was dropped at a scan that filled the list.
WRONG, BEYOND, FULL, EVENTS = 0, 1, 2, 3


class Mixture(NamedTuple):
    """A mixture of the plain law and M shifted ones, over normals as `plots.fill_normals` has them."""

    key: np.ndarray  #: (2,) of the stream that decides from which component a realisation is drawn
    cumulative: np.ndarray  #: (M + 1,) running sums of the shares α, the plain law first; the last is 1
    shift: np.ndarray  #: (M,) s_m
    units: np.ndarray  #: (M, 2 + 2K) u_m


class Losses(NamedTuple):
    """Weighted sums over realisations."""

    events: np.ndarray  #: (F, K, EVENTS, 4) Σw, Σw², the number, and Σw⁴ of the realisations with the event
    drawn: np.ndarray  #: (3,) number of plain realisations, and Σw, Σw² of all


@kernel_part
def put_weights(mixture, normals, weights):
    """Write the weights of eight realisations into a row, from the rows of their normals; both are addresses."""
    density = full(mixture.cumulative[0])
    for m in range(mixture.shift.size):
        projection, shift = full(0.0), mixture.shift[m]
        for r in range(mixture.units.shape[1]):
            projection = projection + mixture.units[m, r] * get(normals, r)
        share = mixture.cumulative[m + 1] - mixture.cumulative[m]
        density = density + share * exponential(shift * projection - 0.5 * shift * shift)
    put(weights, 0, 1.0 / density)


@kernel
def fill_shifted(world, mixture, first, normals, components, weights):
    """Draw normals of realisations first … first + 7, each shifted by its component of the mixture.

    Filled: components (8,), 0 the plain law, and weights (8,)."""
    fill_normals(world, first, normals)
    for n in range(WIDTH):
        components[n] = component = law_index(mixture.key, mixture.cumulative, first + n)
        if component > 0:
            for r in range(mixture.units.shape[1]):
                normals[WIDTH * r + n] += mixture.shift[component - 1] * mixture.units[component - 1, r]
    put_weights(mixture, address(normals), address(weights))


@kernel_part
def add_events(world, banks, memory, weights, size, losses):
    """Add the weights of the first `size` realisations of a group of eight to the events that they have."""
    scans, out = world.truth.shape[0], address(memory.out)
    for f in range(banks.bank.size):
        max_hypotheses, lost, crowded_out = banks.max_hypotheses[banks.bank[f]], 0, 0  # a bit for each lane
        for k in range(scans):
            plot = row(address(memory.plots), k * layout.PLOT)
            bank = row(out, (banks.bank[f] * scans + k) * layout.OUTPUT)
            velocity = row(bank, banks.estimate_field[f] + 1)
            for n in range(size):
                if bank[layout.LISTED * WIDTH + n] == 0.0 and lost >> n & 1 == 0:
                    lost |= 1 << n
                    crowded_out |= (1 if bank[layout.COUNT * WIDTH + n] >= max_hypotheses else 0) << n
                if bank[layout.RIGHT * WIDTH + n] == 0.0:
                    add_event_weight(weights[n], losses.events[f, k], WRONG)
                    if crowded_out >> n & 1 == 1:
                        add_event_weight(weights[n], losses.events[f, k], FULL)
                if abs(velocity[n] - plot[(layout.TRUTH + 1) * WIDTH + n]) > 0.5 * world.spans[k]:
                    add_event_weight(weights[n], losses.events[f, k], BEYOND)


@kernel
def add_weighted_block(world, banks, mixture, memory, scratch, sums, losses, first, count):
    """Add the realisations first … first + count - 1: all to the losses, with their weights, plain ones to the sums."""
    components, weights = scratch
    for group in range(0, count, WIDTH):
        fill_shifted(world, mixture, first + group, memory.normals, components, weights)
        put_plots(world, first + group, memory.normals, memory.plots)
        run_filters(world, banks, memory, group == 0)
        size = min(WIDTH, count - group)
        for n in range(WIDTH):
            memory.active[n] = 1.0 if n < size and components[n] == 0 else 0.0
        for n in range(size):
            add_realisation_weight(weights[n], memory.active[n], losses.drawn)
        add_events(world, banks, memory, weights, size, losses)
        add_group(world, banks, memory, sums)


def simulate_weighted_block(
    world: World, banks: Banks, mixture: Mixture, sums: Sums, losses: Losses, first: int, count: int
) -> None:
    """Add realisations first … first + count - 1 of a case without missed plots."""
    scratch = np.zeros(WIDTH, np.int64), rows(1)
    add_weighted_block(world, banks, mixture, work_arrays(len(world.t), banks), scratch, sums, losses, first, count)
