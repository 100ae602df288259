"""From a filter's options to the arrays that the kernels read: windows, gates, noise."""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from radarsim.bursts import estimators
from radarsim.bursts.block_sums import WindowTables, block_edges
from radarsim.bursts.burst import Burst
from radarsim.bursts.fisher import fisher_sums
from radarsim.bursts.kernels.sequence import OPTIONS, WINDOW
from radarsim.bursts.kernels.signal import BLOCK_SUMS
from radarsim.physics.motion import process_noise
from radarsim.studies.pulses_to_tracks.kernels import layout
from radarsim.studies.pulses_to_tracks.scenario import fisher_bounds
from radarsim.studies.pulses_to_tracks.window_menu import (
    RATIOS,
    Menu,
    designer,
    parameter_count,
    start_scans,
    widest_forecast,
    window_menu,
)

UNLIMITED_DEPTH = 10.0**300  # of a list from which no hypothesis is dropped
BLOCKS_PER_WINDOW = 20  # as the discriminator's
KINDS = {None: layout.NONE, "fisher_bound": layout.BOUND, "spectrum": layout.SPECTRUM}
USES = {None: layout.AS_MEASURED, "as_measured": layout.AS_MEASURED} | {
    "gated": layout.GATED,
    "mixture": layout.MIXTURE,
}
HANDOVER_SEARCH: dict[str, Any] = {
    "coherent": True,
    "search": 2,
    "margin": 2.0,
    "tolerance": 0.3,
}  # P4's cure at a hand-over


@dataclass
class WindowList:
    """The windows of all designs."""

    windows: list[np.ndarray] = field(default_factory=list)

    def add(self, records: np.ndarray) -> int:
        """Add records; returns the index of the first."""
        start = sum(map(len, self.windows))
        self.windows.append(records)
        return start


@dataclass(frozen=True)
class FilterDesign:
    """The arrays of the filters, with the tables, sums and menus behind them."""

    arrays: layout.Filters
    tables: WindowTables
    sums: estimators.World
    menus: tuple[Menu | None, ...]


def design_filters(spec: Any, bursts: list[Burst]) -> FilterDesign:
    """Design all filters of a case: their menus, and the records of the windows of each scan and entry.

    Windows are designed for the weakest burst, and weighted with the noise of each."""
    weakest = max(bursts, key=lambda burst: burst.noise_variance)
    menus = tuple(
        None if options.estimator in KINDS else window_menu(weakest, options, widest_forecast(spec, options))
        for options in spec.filters
    )
    lengths = sorted({spec.pulses} | {w for menu in menus if menu for windows in menu.windows for w in windows})
    if any(options.estimator == "spectrum" for options in spec.filters):
        lengths = list(range(1, spec.pulses + 1))  # a spectrum needs every pulse
    edges = block_edges(lengths, BLOCKS_PER_WINDOW)
    zero = np.zeros((1, spec.pulses))
    sums = estimators.world(weakest, BLOCK_SUMS, edges, False, zero, zero)
    tables = WindowTables(edges, sums.mean, BLOCKS_PER_WINDOW)
    return FilterDesign(_filter_arrays(spec, bursts, menus, tables), tables, sums, menus)


def _filter_arrays(
    spec: Any, bursts: list[Burst], menus: tuple[Menu | None, ...], tables: WindowTables
) -> layout.Filters:
    """The filters' arrays; scans whose bursts are the same share their windows."""
    count, scans = len(spec.filters), len(bursts)
    entries = max((len(menu.windows) for menu in menus if menu), default=1)
    window_list = WindowList()
    estimator_options = np.zeros(count, OPTIONS)
    first_window = np.zeros((count, scans, entries), np.int64)
    window_count = np.zeros((count, scans, entries), np.int64)
    whole_burst, sigma = np.zeros((count, scans), np.int64), np.ones((count, scans, 2))
    for f, (options, menu) in enumerate(zip(spec.filters, menus, strict=True)):
        scan_of_burst: dict[Burst, int] = {}
        for k, burst in enumerate(bursts):
            if burst in scan_of_burst:
                for array in (first_window, window_count, whole_burst, sigma):
                    array[f, k] = array[f, scan_of_burst[burst]]
                continue
            scan_of_burst[burst] = k
            if options.takes:
                sigma[f, k] = fisher_bounds(burst, parameter_count(options))
                whole_burst[f, k] = window_list.add(_window_records(burst, options, (spec.pulses,), None, tables)[0])
            for entry, windows in enumerate(menu.windows if menu else ()):
                spreads = menu.spreads(entry) if menu else None
                records, estimator_options[f] = _window_records(burst, options, windows, spreads, tables)
                first_window[f, k, entry], window_count[f, k, entry] = window_list.add(records), len(records)
        if options.takes and menu is None:
            estimator_options[f] = _window_records(bursts[0], options, (spec.pulses,), None, tables)[1]
    last_options = estimator_options.copy()
    last_options["search"] = 0
    names = [options.name for options in spec.filters]
    return layout.Filters(
        filters=np.array([_filter_record(spec, *pair) for pair in zip(spec.filters, menus, strict=True)]),
        options=estimator_options,
        last_options=last_options,
        windows=np.concatenate([*window_list.windows, np.zeros(1, WINDOW)]),
        first_window=first_window,
        window_count=window_count,
        whole_burst=whole_burst,
        sigma=sigma,
        baseline=names.index(spec.baseline) if spec.baseline else 0,
        ideals=np.array([idealisation(spec, options) for options in spec.filters]),
    )


def idealisation(spec: Any, options: Any) -> int:
    """The number of the filter with ideal errors that is otherwise the same; −1: there is none, or it is the filter."""
    if not options.takes or options.estimator == "fisher_bound":
        return -1
    for i, candidate in enumerate(spec.filters):
        keys = ("observes", "manoeuvre_variance", "process_noise")
        is_same = all(getattr(candidate, key) == getattr(options, key) for key in keys)
        if is_same and candidate.estimator == "fisher_bound" and candidate.derivatives == options.derivatives:
            return i
    return -1


def _window_records(
    burst: Burst, options: Any, lengths: tuple[int, ...], spreads: tuple[float, float] | None, tables: WindowTables
) -> tuple[np.ndarray, np.void]:
    """The records of an estimator's windows, and its options; without a forecast if no spreads are given."""
    size = parameter_count(options)
    search_options = HANDOVER_SEARCH if options.estimator == "cured" and spreads else {}
    window_designer = designer(burst, size, spreads or (1.0, 1.0))
    design = estimators.Design(lengths, forecast=spreads is not None, **search_options)
    information = dict(zip(lengths, fisher_sums(burst, size, list(lengths)), strict=True))
    records, estimator_options = estimators.estimators(
        [design], tables.window, burst, window_designer.sigma, information, window_designer
    )
    return records[0], estimator_options[0]


def _filter_record(spec: Any, options: Any, menu: Menu | None) -> np.void:
    """The record of a filter for the kernels."""
    dt = spec.radar.scan_period_s
    record = np.zeros(1, layout.FILTER)[0]
    record["kind"] = KINDS.get(options.estimator, layout.SEQUENCE)
    record["takes"], record["use"], record["start"] = options.takes, USES[options.use], start_scans(options)
    record["track"] = options.forecast == "track"
    record["noise"] = process_noise(options.process_noise, options.manoeuvre_variance, dt)[np.triu_indices(3)]
    if options.use == "gated":
        from scipy.special import chdtri

        record["gate"] = chdtri(options.takes, 1.0 - options.gate_probability)
    if options.use == "mixture":
        # An estimate that did not lock is anywhere in the span, its acceleration anywhere the rate can be swept.
        record["lock"], record["density"] = options.lock_probability, 1.0 / spec.span_mps
        if options.takes == 2:
            record["density"] /= spec.span_mps / spec.burst_s
    record["max_hypotheses"] = options.hypotheses or 1
    if record["max_hypotheses"] > 1:
        record["max_depth"] = -math.log(options.prune_below) if options.prune_below > 0 else UNLIMITED_DEPTH
        record["averages"] = options.estimate == "mean"
    if menu is not None:
        record["top"], record["levels"], record["ratio"] = menu.top, menu.levels, np.log(RATIOS)
        record["fixed"] = menu.top if options.forecast != "track" else 0.0
    return record
