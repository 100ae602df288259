"""Which choices give most of the numbers that P1 prints: all of them by the exact recursion, half a million at once.

A version is a form of the manoeuvre covariance, a D_M and a start (recursion.py); each is looked at with its true
errors on a quadratic and those on a truth that moves as the filter believes, after 10 to 40 scans of the slow radars,
and with as long a run of the fast ones or as many scans."""

import itertools
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from radarsim.report.claims.over import Fine, Printed, Search
from radarsim.studies.range_doppler import recursion
from radarsim.studies.range_doppler.measures import RADARS
from radarsim.studies.range_doppler.recursion import FORMS, START_NAMES
from radarsim.threads import mapping

VARIANCES = tuple(float(f"{v:.4g}") for v in np.logspace(-5, 1, 121))  # twenty a decade, with the paper's 10⁻³
FINE = np.logspace(-5, 1, 1201)  # of the windows in D_M
TRUTHS = ("quadratic", "as believed")
SCANS = tuple(range(10, 41))
SPANS = ("same time", "same scans")  # of the fast radars
SHIPPED = {
    **{"process_noise": FORMS[0], "manoeuvre_variance": "0.001", "start": START_NAMES[0]},
    **{"truth": TRUTHS[0], "scans": "15", "span": SPANS[0]},
}
LONG = 400  # scans after which RLS 2 is taken as settled
TOLERANCE = 0.05  # of the steady value
R, V, A = range(3)


INFINITE = np.inf
LOWEST = -1e300  # under every gain


def _printed(
    claim: str,
    what: str,
    unit: str,
    text: str,
    strict: tuple[float, float],
    granular: tuple[float, float] | None = None,
) -> Printed:
    return Printed(claim, what, unit, text, strict, granular or strict)


def _percent(claim: str, what: str, text: str, wide: float | None = None) -> Printed:
    """A printed share or range of shares that rounds to the print, or is as near as `wide`."""
    low, high = (float(end) for end in (text.split("–") * 2)[:2])
    wide = 0.5 if wide is None else wide
    return Printed(claim, what, "%", text, (low - 0.5, high + 0.5), (low - wide, high + wide))


def _over(claim: str, what: str, least: float) -> Printed:
    above = float(np.nextafter(least, INFINITE))
    return Printed(claim, what, "%", f"> {least:g}", (above, INFINITE), (least - 2.5, INFINITE))


# The numbers in the order of `_numbers`. Strict: rounds to the print, "about" within 10 %. Granular: multiples of five
# to ± 2.5, "about 10 %" to ± 1, times to the slower radar's period; 7 and 18, no multiples of five, as in strict.
FIVES = 2.5
READ_AS = (
    'To the digit: what rounds to the print; of times and of "about 10 %", within 10 %. To the steps of the print: '
    'multiples of five ± 2.5, limits by as much, "about 10 %" ± 1, times to one period of the slower radar; 7 and 18, '
    "which are no multiples of five, as to the digit."
)
PRINTED = (
    _printed("P1.1", "RLS 1, least range gain", "%", "7", (6.5, 15.5)),
    _printed("P1.1", "RLS 1, largest range gain", "%", "15", (6.5, 15.5), (6.5, 17.5)),
    _percent("P1.2", "RLS 1, least velocity gain", "10–50", FIVES),
    _percent("P1.2", "RLS 1, largest velocity gain", "10–50", FIVES),
    _printed("P1.3", "RLS 1, largest acceleration gain from k = 5", "%", "< 0", (-INFINITE, -1e-12)),
    _printed("P1.3", "RLS 1, acceleration gain at k = 4", "%", "> 0", (1e-12, INFINITE)),
    _percent("P1.4", "RLS 3, largest range gain", "45", FIVES),
    _percent("P1.4", "RLS 2, largest range gain", "35", FIVES),
    _printed("P1.4", "RLS 3, time of it", "s", "20–30", (18, 33), (10, 40)),
    _printed("P1.4", "RLS 2, time of it", "s", "20–30", (18, 33), (10, 40)),
    _percent("P1.5", "RLS 2, final range gain", "18"),
    _percent("P1.5", "RLS 3, final range gain", "18"),
    _percent("P1.6", "RLS 2, first velocity gain", "80–90", FIVES),
    _percent("P1.6", "RLS 3, first velocity gain", "80–90", FIVES),
    _percent("P1.6", "RLS 2, final velocity gain", "25", FIVES),
    _percent("P1.6", "RLS 3, final velocity gain", "25", FIVES),
    _over("P1.7", "RLS 2, first acceleration gain", 80),
    _over("P1.7", "RLS 3, first acceleration gain", 80),
    _printed("P1.7", "RLS 2, first time without acceleration gain", "s", "90–100", (81, 110), (80, 110)),
    _printed("P1.7", "RLS 3, first time without acceleration gain", "s", "90–100", (81, 110), (80, 110)),
    _over("P1.8", "RLS 4, largest range gain", 50),
    _over("P1.8", "RLS 5, largest range gain", 50),
    _over("P1.9", "RLS 3–5, largest velocity gain", 90),
    _over("P1.10", "RLS 4, largest acceleration gain to k = 5", 80),
    _over("P1.10", "RLS 5, largest acceleration gain to k = 5", 80),
    _printed("P1.11", "time of the largest range gain, RLS 3 : RLS 2", "", "1", (0.9, 1.1), (0.5, 1.5)),
    _printed("P1.14", "RLS 2, settling of σ_r, range only", "Δt", "< 10", (0, 9.999)),
    _printed("P1.17", "RLS 1, largest range gain", "%", "about 10", (9, 11)),
    _printed("P1.17", "RLS 1, scan of it", "k", "3–4", (3, 4)),
    _printed("P1.23", "RLS 2, scans with a loss in acceleration", "", "few", (1, 3)),
)


class _Chunk(NamedTuple):
    """What the numbers of some versions are made of, under one truth: gains by radar (B, K, 3), σ_r of RLS 2 (B, K).

    settled is the steady σ_r of RLS 2, range only (B,)."""

    gains: dict[int, np.ndarray]
    sigma: np.ndarray
    settled: np.ndarray


def _chunks(versions: Sequence[recursion.Version]) -> Iterator[_Chunk]:
    """By truth, in the order of TRUTHS."""
    with mapping() as mapped:  # NumPy computes outside the interpreter's lock
        found = dict(zip(RADARS, mapped(lambda n: recursion.both(RADARS[n], versions, _scans(n)), RADARS), strict=True))
    begins = np.array([recursion.first_scan(start, 2) for _, _, start in versions])
    alone = _settled(versions)
    for truth in range(len(TRUTHS)):
        gains = {}
        for n, (base, own) in found.items():
            gain = recursion.gain(base[truth], own[truth])
            gain[np.arange(gain.shape[1]) + 1 < begins[:, None]] = np.nan  # both are the plot
            gains[n] = gain
        yield _Chunk(gains, found[2][0][truth][:, :, R], alone[truth])


def _settled(versions: Sequence[recursion.Version]) -> tuple[np.ndarray, np.ndarray]:
    """σ_r of RLS 2 from the range alone after LONG scans, (B,): the true one and the believed one."""
    plain = list(dict.fromkeys((form, variance, START_NAMES[0]) for form, variance, _ in versions))
    place = {one[:2]: i for i, one in enumerate(plain)}
    long = recursion.errors(plain, 1, np.array(RADARS[2][:2], dtype=float), RADARS[2][2], LONG)
    of = [place[one[:2]] for one in versions]
    return long.true[of, -1, R], long.believed[of, -1, R]


def _scans(radar: int) -> int:
    """The longest run of a radar."""
    return SCANS[-1] if radar in SLOW else 2 * SCANS[-1] - 1


SLOW = tuple(n for n, radar in RADARS.items() if radar[2] == 10)


def _last(span: str) -> dict[int, np.ndarray]:
    """The place of the last scan by radar, (S,), for every number of scans of the slow radars."""
    scans = np.array(SCANS) - 1
    return {n: scans if n in SLOW or span == "same scans" else 2 * scans for n in RADARS}


def _numbers(of: _Chunk, last: dict[int, np.ndarray]) -> np.ndarray:
    """The printed numbers (n, B, S) of a chunk for runs that end at these places (S,)."""
    g = of.gains
    first = {n: _first(g[n][:, :, V])[:, None] for n in (2, 3)}
    one_a = _so_far(np.fmax, g[1][:, 4:, A])[:, np.maximum(last[1] - 4, 0)]
    velocity = [_so_far(np.fmax, g[n][:, :, V])[:, last[n]] for n in (3, 4, 5)]
    early = {n: np.nanmax(g[n][:, :5, A], axis=1)[:, None] for n in (4, 5)}
    peak = {n: _when_largest(g[n][:, :, R])[:, last[n]] for n in (1, 2, 3)}
    time = {n: peak[n] * RADARS[n][2] for n in (2, 3)}
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = time[3] / time[2]
    largest = {n: _so_far(np.fmax, g[n][:, :, R])[:, last[n]] for n in RADARS}
    rows = [
        *(_so_far(np.fmin, g[1][:, :, R])[:, last[1]], largest[1]),
        *(_so_far(np.fmin, g[1][:, :, V])[:, last[1]], _so_far(np.fmax, g[1][:, :, V])[:, last[1]]),
        *(one_a, g[1][:, 3, A][:, None], largest[3], largest[2], time[3], time[2]),
        *(g[n][:, :, R][:, last[n]] for n in (2, 3)),
        *(first[2], first[3], *(g[n][:, :, V][:, last[n]] for n in (2, 3))),
        *(_first(g[n][:, :, A])[:, None] for n in (2, 3)),
        *(_first_gone(g[n][:, :, A], last[n]) * RADARS[n][2] for n in (2, 3)),
        *(largest[4], largest[5], np.fmax.reduce(velocity), early[4], early[5], ratio),
        *(_settling(of.sigma, of.settled, last[2]), largest[1], peak[1] + 1),
        np.cumsum(g[2][:, :, A] < 0, axis=1)[:, last[2]],
    ]
    shape = np.broadcast_shapes(*(row.shape for row in rows))
    return np.array([np.broadcast_to(row, shape) for row in rows], dtype=np.float32)


def _so_far(extreme: np.ufunc, values: np.ndarray) -> np.ndarray:
    """The extreme of values (B, K) up to each scan; not-a-number counts for nothing."""
    return extreme.accumulate(values, axis=1)


def _first(values: np.ndarray) -> np.ndarray:
    """The first value (B,) that there is."""
    return values[np.arange(len(values)), np.argmax(np.isfinite(values), axis=1)]


def _when_largest(values: np.ndarray) -> np.ndarray:
    """The place of the largest value up to each scan, (B, K)."""
    top = _so_far(np.fmax, values)
    return np.maximum.accumulate(np.where(values == top, np.arange(values.shape[1]), 0) * _rises(top), axis=1)


def _rises(top: np.ndarray) -> np.ndarray:
    """Where a running maximum (B, K) is a new one."""
    return np.diff(np.nan_to_num(top, nan=LOWEST), axis=1, prepend=LOWEST) > 0


def _first_gone(values: np.ndarray, last: np.ndarray) -> np.ndarray:
    """The place of the first value that is zero or less, (B, S); infinite where there is none up to the last."""
    gone = values <= 0
    place = np.where(gone.any(axis=1), np.argmax(gone, axis=1), INFINITE)[:, None]
    return np.where(place <= last, place, INFINITE)


def _settling(sigma: np.ndarray, settled: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Scans from the first to the one from which σ (B, K) stays near its steady value to the last, (B, S)."""
    wrong = ~(abs(sigma / settled[:, None] - 1) <= TOLERANCE)
    after = np.maximum.accumulate(np.where(wrong, np.arange(sigma.shape[1]) + 1, 0), axis=1)[:, last]
    return np.where(after <= last, after, INFINITE)


def numbers(versions: Sequence[recursion.Version], span: str = SPANS[0]) -> np.ndarray:
    """The printed numbers (n, B, truths, scans) of versions."""
    last = _last(span)
    return np.stack([_numbers(of, last) for of in _chunks(versions)], axis=2)


def search() -> Search:
    """The printed numbers under every combination of the choices, and their windows in each choice alone."""
    lasts = [_last(span) for span in SPANS]
    versions = list(itertools.product(FORMS, VARIANCES, START_NAMES))
    values = np.empty((len(PRINTED), len(versions), len(TRUTHS), len(SCANS), len(SPANS)), dtype=np.float32)
    for truth, of in enumerate(_chunks(versions)):
        for span, last in enumerate(lasts):
            values[:, :, truth, :, span] = _numbers(of, last)
    values = values.reshape(len(PRINTED), len(FORMS), len(VARIANCES), len(START_NAMES), *values.shape[2:])
    strict, granular = (_inside(values, [getattr(one, rule) for one in PRINTED]) for rule in ("strict", "granular"))
    axes: dict[str, tuple[str, ...]] = {
        **{"process_noise": FORMS, "manoeuvre_variance": tuple(f"{v:g}" for v in VARIANCES), "start": START_NAMES},
        **{"truth": TRUTHS, "scans": tuple(str(n) for n in SCANS), "span": SPANS},
    }
    return Search("P1", PRINTED, axes, SHIPPED, strict, granular, values, {"manoeuvre_variance": _fine()}, READ_AS)


def _inside(values: np.ndarray, ends: Sequence[tuple[float, float]]) -> np.ndarray:
    low, high = (
        np.array(part, dtype=np.float32).reshape(-1, *(1,) * (values.ndim - 1)) for part in zip(*ends, strict=True)
    )
    return (values >= low) & (values <= high)


def _fine() -> Fine:
    """The windows in D_M, 200 values a decade."""
    values = numbers([(FORMS[0], variance, START_NAMES[0]) for variance in FINE])
    strict = _inside(values, [one.strict for one in PRINTED])
    return Fine(FINE.tolist(), strict[:, :, 0, SCANS.index(int(SHIPPED["scans"]))])
