"""One block: plots, gains, filters and sums of eight realisations after the other.

Realisations whose normals are shifted towards a wrong fold, and the weights that make up for it.

The normals z of a realisation are drawn from the mixture α₀ N(0, 1) + Σ α_m N(s_m u_m, 1), u_m unit vectors. The ratio
of the law that they should have to the one that they have is

    w(z) = 1 / (α₀ + Σ α_m exp(s_m u_mᵀ z − s_m²/2)),

at most 1/α₀ (Owen & Zhou, Journal of the American Statistical Association 95, 2000, 135)."""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.compile import aligned_zeros, inline, kernel, part
from radarsim.kernels.hypotheses import Lists
from radarsim.kernels.lanes import WIDTH, address, exponential, full, get, put, row, rows, total, where_greater
from radarsim.kernels.random import add_drawn, add_weight, part_of
from radarsim.studies.ambiguous_doppler.kernels import records as rec
from radarsim.studies.ambiguous_doppler.kernels import steps, together
from radarsim.studies.ambiguous_doppler.kernels.records import Banks, Sums, World, memory
from radarsim.studies.ambiguous_doppler.kernels.steps import fill_gains, fill_normals, put_plots, run_merged, run_single
from radarsim.studies.ambiguous_doppler.kernels.together import Orders, run_choosing, run_interacting, run_together


# ---- sums ------------------------------------------------------------------------------------------------------------
@part
def run_filters(world, banks, memory, fresh):
    """Gains and outputs of all banks over the plots in memory; gains are made again where `fresh`."""
    scans, plots = world.truth.shape[0], address(memory.plots)
    sigma = address(world.sigma)
    if fresh:
        for d in range(banks.designs.shape[0]):
            fill_gains(
                address(banks.designs[d]), sigma, scans, plots, row(address(memory.gains), d * scans * rec.GAINS)
            )
    lists = Lists(
        address(memory.listed), address(memory.children), address(memory.parents), memory.room, memory.parents.size
    )
    for b in range(banks.kind.size):
        kind, part, size = banks.kind[b], banks.parts[b, 0], banks.size[b]
        shares, stay = address(banks.shares[b]), banks.stay[b]
        bank = Orders(address(banks.designs), address(banks.parts[b]), address(banks.orders[b]), size, stay)
        outputs = address(memory.out)
        out = row(outputs, b * scans * rec.OUTPUT)
        if kind == rec.WEIGHS:
            together.run_weighing(outputs, bank, banks.reads[b], shares, scans, out)
        elif kind == rec.CHOOSES:
            run_choosing(outputs, bank, banks.reads[b], shares, scans, out)
        elif kind == rec.INTERACTS:
            how = banks.unfolding[b]
            if how != rec.REMEMBERS:
                run_interacting(bank, how, sigma, world.spans, plots, out, address(memory.interacting))
                continue
            room = (address(memory.together), address(memory.broad), lists)
            limits = (np.exp(-banks.deepest[b]), banks.most[b])
            for lane in range(WIDTH):
                own = address(memory.out[b * scans * rec.OUTPUT * WIDTH + lane :])
                run_together(bank, limits, sigma, world.spans, address(memory.plots[lane:]), own, room)
        elif kind == rec.REMEMBERS:
            for lane in range(WIDTH):
                steps.run_remembering(
                    address(banks.designs[part]),
                    banks.most[b],
                    banks.deepest[b],
                    world.spans,
                    address(memory.plots[lane:]),
                    address(memory.gains[part * scans * rec.GAINS * WIDTH + lane :]),
                    address(memory.out[b * scans * rec.OUTPUT * WIDTH + lane :]),
                    lists,
                )
        elif kind == rec.MERGES:
            run_merged(address(banks.designs[part]), sigma, world.spans, plots, out)
        else:
            gains = row(address(memory.gains), part * scans * rec.GAINS)
            run_single(kind, address(banks.designs[part]), world.spans, plots, gains, out)


@inline
def errors(estimate, plot, counted, c):
    """Error of component c, zero where it does not count."""
    return counted * (get(estimate, c) - get(plot, rec.TRUTH + c))


@part
def add_scan(plot, estimated, counted, half_span, sums):
    """Add a scan of a filter: estimated are its rows, the baseline's and the oracle's; counted (lanes); sums addresses.
    Gives the number of lanes whose velocity is off by over half a span."""
    beyond, (own, base, oracle), (error, (paired, against), estimates) = full(0.0), estimated, sums
    for c in range(3):
        e = errors(own, plot, counted, c)
        e2, b, o = e * e, errors(base, plot, counted, c), errors(oracle, plot, counted, c)
        error[4 * c] += total(e)
        error[4 * c + 1] += total(e2)
        error[4 * c + 2] += total(e2 * e)
        error[4 * c + 3] += total(e2 * e2)
        paired[c] += total(e2 * (b * b))
        against[c] += total(e2 * (o * o))
        estimates[c] += total(counted)
        if c == 1:
            beyond = where_greater(e2, full(half_span * half_span), full(1.0), full(0.0))
    return total(beyond)


@part
def add_calibration(out, plot, calibration):
    """Count the lanes by the probability of the best hypothesis, and those where it is right; of plots that count."""
    for i in range(WIDTH):
        if plot[rec.DETECTED * WIDTH + i] > 0.0:
            p = out[rec.PROBABILITY * WIDTH + i]
            p = p if p >= 0.0 else 0.0  # not-a-number, which the errors show, is no place in the table
            number = 3 * min(int(p * rec.BINS), rec.BINS - 1)
            calibration[number] += 1.0
            calibration[number + 1] += out[rec.RIGHT * WIDTH + i]
            calibration[number + 2] += p


@part
def add_group(world, banks, memory, sums):
    """Add the outputs of a group of eight realisations to the sums."""
    scans = world.truth.shape[0]
    whole, out = get(address(memory.counted), 0), address(memory.out)
    for k in range(scans):
        plot = row(address(memory.plots), k * rec.PLOT)
        counted = whole * get(plot, rec.STARTED)
        put(plot, rec.DETECTED, whole * get(plot, rec.DETECTED))  # read by add_calibration, and no more after it
        base = row(out, (banks.bank[banks.baseline] * scans + k) * rec.OUTPUT + banks.place[banks.baseline])
        for f in range(banks.bank.size):
            bank = row(out, (banks.bank[f] * scans + k) * rec.OUTPUT)
            oracle = base
            if banks.oracle >= 0:
                oracle = row(out, (banks.bank[banks.oracle] * scans + k) * rec.OUTPUT + banks.place[banks.oracle])
            folds = address(sums.folds[f, k])
            estimated, half_span = (row(bank, banks.place[f]), base, oracle), 0.5 * world.spans[k]
            powers, products = address(sums.error[f, k]), (address(sums.paired[f, k]), address(sums.oracle[f, k]))
            into = powers, products, address(sums.estimates[f, k])
            folds[rec.BEYOND_SUM] += add_scan(plot, estimated, counted, half_span, into)
            folds[rec.RIGHT_SUM] += total(counted * get(bank, rec.RIGHT))
            folds[rec.LISTED_SUM] += total(counted * get(bank, rec.LISTED))
            folds[rec.COUNT_SUM] += total(counted * get(bank, rec.COUNT))
            kind, unfolding = banks.kind[banks.bank[f]], banks.unfolding[banks.bank[f]]
            if kind == rec.REMEMBERS or (kind == rec.INTERACTS and unfolding == rec.REMEMBERS):
                add_calibration(bank, plot, address(sums.calibration[f, k]))
            if kind >= rec.INTERACTS:
                for order in range(3):
                    w = counted * get(bank, rec.WEIGHTS + order)
                    sums.orders[f, k, order, 0] += total(w)
                    sums.orders[f, k, order, 1] += total(w * w)


@kernel
def add_block(world, banks, memory, sums, first, count):
    """Add the realisations first … first + count - 1 to the sums."""
    for group in range(0, count, WIDTH):
        for n in range(WIDTH):
            memory.counted[n] = 1.0 if group + n < count else 0.0
        fill_normals(world, first + group, memory.normals)
        put_plots(world, first + group, memory.normals, memory.plots)
        run_filters(world, banks, memory, group == 0 or world.detection < 1.0)
        add_group(world, banks, memory, sums)


@kernel
def fill_outputs(world, banks, memory, first):
    """Plots and outputs of the realisations first … first + 7, left in memory."""
    fill_normals(world, first, memory.normals)
    put_plots(world, first, memory.normals, memory.plots)
    run_filters(world, banks, memory, True)


@kernel
def fill_drawn(world, normals, plots, first, measured, truth):
    """`drawn_plots` into measured (2, K, n) and truth (3, K, n or 0), n whole eights; normals, plots: work arrays."""
    scans, groups = measured.shape[1], measured.shape[2] // WIDTH
    for g in range(groups):
        fill_normals(world, first + g * WIDTH, normals)
        put_plots(world, first + g * WIDTH, normals, plots)
        for k in range(scans):
            scan = row(address(plots), k * rec.PLOT)
            detected, half = get(scan, rec.DETECTED), full(0.5)
            for m in range(2):  # RANGE, VELOCITY
                value = where_greater(detected, half, get(scan, m), full(np.nan))
                put(address(measured), (m * scans + k) * groups + g, value)
            if truth.shape[2] > 0:
                for c in range(3):
                    put(address(truth), (c * scans + k) * groups + g, get(scan, rec.TRUTH + c))


def drawn_plots(world: World, first: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Range and folded velocity (count, K, 2) of realisations first …, not-a-number where missed, and the truth (count,
    K, 3), a view that cannot be written where all have the same."""
    scans, eights, several = len(world.t), -(-count // WIDTH) * WIDTH, world.spread.any()
    measured, truth = aligned_zeros(2, scans, eights), aligned_zeros(3, scans, eights if several else 0)
    single = world._replace(joint=np.zeros_like(world.joint))  # no velocity is unfolded from that of the scan before
    fill_drawn(single, rows(2 + 2 * scans), rows(scans * rec.PLOT), first, measured, truth)
    same = np.broadcast_to(world.truth, (count, scans, 3))
    return measured.transpose(2, 1, 0)[:count], truth.transpose(2, 1, 0)[:count] if several else same


def simulate_block(world: World, banks: Banks, sums: Sums, first: int, count: int) -> None:
    """Add the errors and folds of realisations first … first + count - 1 to the sums."""
    add_block(world, banks, memory(len(world.t), banks), sums, first, count)


def errors_of(world: World, banks: Banks, first: int, count: int) -> np.ndarray:
    """The errors (F, count, K, 3) of realisations first … first + count - 1; NaN where a filter has not started."""
    scans, work = len(world.t), memory(len(world.t), banks)
    plots, out = work.plots.reshape(scans, rec.PLOT, WIDTH), work.out.reshape(-1, scans, rec.OUTPUT, WIDTH)
    rows_of_estimates = banks.place[:, None] + np.arange(3)
    found = np.empty((len(banks.bank), -(-count // WIDTH), WIDTH, scans, 3))
    for group in range(found.shape[1]):
        fill_outputs(world, banks, work, first + group * WIDTH)
        e = out[banks.bank[:, None], :, rows_of_estimates] - plots[:, rec.TRUTH : rec.TRUTH + 3].swapaxes(0, 1)
        e[:, :, plots[:, rec.STARTED] == 0] = np.nan
        found[:, group] = e.transpose(0, 3, 2, 1)
    return found.reshape(len(found), -1, scans, 3)[:, :count]


def simulated(world: World, banks: Banks, first: int) -> tuple[np.ndarray, np.ndarray]:
    """Plots (K, PLOT, 8) and outputs (B, K, OUTPUT, 8) of the realisations first … first + 7, see `records`."""
    plots, out, _ = simulated_lists(world, banks, first)
    return plots, out


def simulated_lists(world: World, banks: Banks, first: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """As `simulated`, and the columns that the last list of hypotheses is left in, see `kernels.hypotheses.Lists`."""
    scans, work = len(world.t), memory(len(world.t), banks)
    fill_outputs(world, banks, work, first)
    shape = (len(banks.kind), scans, rec.OUTPUT, WIDTH)
    return work.plots.reshape(scans, rec.PLOT, WIDTH), work.out.reshape(shape), work.listed


# ---- rare ------------------------------------------------------------------------------------------------------------
# A fold of the best hypothesis is wrong; the velocity is off by over half the span; a fold is wrong, and the right
# hypothesis left the list at a scan that left it as long as it may be.
WRONG, BEYOND, FULL, EVENTS = 0, 1, 2, 3


class Mixture(NamedTuple):
    """A mixture of M shifted laws beside the plain one, over normals as `steps.fill_normals` has them."""

    key: np.ndarray  #: (2,) of the stream that says which part a realisation is drawn from
    cumulative: np.ndarray  #: (M + 1,) running sums of the shares α, the plain one first; the last is 1
    shift: np.ndarray  #: (M,) s_m
    units: np.ndarray  #: (M, 2 + 2K) u_m


class Losses(NamedTuple):
    """Weighted sums over realisations."""

    events: np.ndarray  #: (F, K, EVENTS, 4) Σw, Σw², the number, and Σw⁴ of the realisations that have it
    drawn: np.ndarray  #: (3,) realisations that are plain, and Σw, Σw² of all


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

    chosen is the number of the part, 0 the plain law."""
    fill_normals(world, first, normals)
    for n in range(WIDTH):
        chosen[n] = m = part_of(mixture.key, mixture.cumulative, first + n)
        if m > 0:
            for r in range(mixture.units.shape[1]):
                normals[WIDTH * r + n] += mixture.shift[m - 1] * mixture.units[m - 1, r]
    weigh(mixture, address(normals), address(weights))


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
                    add_weight(weights[n], losses.events[f, k], WRONG)
                    if crowded >> n & 1 == 1:
                        add_weight(weights[n], losses.events[f, k], FULL)
                if abs(velocity[n] - plot[(rec.TRUTH + 1) * WIDTH + n]) > 0.5 * world.spans[k]:
                    add_weight(weights[n], losses.events[f, k], BEYOND)


@kernel
def add_weighted_block(world, banks, mixture, memory, room, sums, losses, first, count):
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
            add_drawn(weights[n], memory.counted[n], losses.drawn)
        add_events(world, banks, memory, weights, size, losses)
        add_group(world, banks, memory, sums)


def simulate_weighted_block(
    world: World, banks: Banks, mixture: Mixture, sums: Sums, losses: Losses, first: int, count: int
) -> None:
    """Add realisations first … first + count - 1, each plot of which is detected."""
    room = np.zeros(WIDTH, np.int64), rows(1)
    add_weighted_block(world, banks, mixture, memory(len(world.t), banks), room, sums, losses, first, count)
