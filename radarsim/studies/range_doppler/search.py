"""Which choices give most of the numbers that P1 prints: all of them by the exact recursion, half a million at once.

A version is a form of the manoeuvre covariance, a D_M and a start; each is looked at with its true
errors on a quadratic and those on a truth that moves as the filter believes, after 10 to 40 scans of the slow radars,
and with as long a run of the fast ones or as many scans.

Exact errors of many versions of the paper's filters at once: its own recursion, eqs. (8) and (12), on arrays.

A version is a form and size of the manoeuvre covariance and a way to start; B of them run side by side. Packed
covariances are the paper's b, c, e, d, f, g. The two measurements of a scan are taken one after the other, which for
independent errors is the same as both at once."""

import itertools
from collections.abc import Iterator, Sequence
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from radarsim.kernels.algebra import CORRECT, NO_NOISE, TAKE, constant_acceleration, pack, predicted_covariance
from radarsim.physics import acceleration_step_covariance, manoeuvre_covariance, transition, white_jerk_covariance
from radarsim.report.claims.over import Fine, Printed, Search
from radarsim.studies.range_doppler.filters import least_squares_start, observation
from radarsim.studies.range_doppler.measures import RADARS
from radarsim.threads import mapping

# ---- versions --------------------------------------------------------------------------------------------------------
Form = Literal["random_jerk", "white_jerk", "white_jerk_rate", "acceleration_step", "normalised"]
Start = Literal[
    "weighted", "unweighted", "process_noise", "first_differences", "three_and_three", "four_and_four", "five_and_five"
]
FORMS: tuple[Form, ...] = get_args(Form)
START_NAMES: tuple[Start, ...] = get_args(Start)
Version = tuple[Form, float, Start]  # form of Q, D_M, start
START_SCANS = {"three_and_three": (3, 3), "four_and_four": (4, 4), "five_and_five": (5, 5)}  # range only, with velocity
USUAL_SCANS = (3, 2)


def covariance_of(form: Form, variance: float, sigma_range_m: float, dt: float) -> np.ndarray:
    """Q (3, 3) of one scan, by the meaning of the number D_M.

    random_jerk: eq. (6), the variance of a jerk that is constant over the scan, (m/s³)². white_jerk: the spectral
    density of a white jerk, m²/s⁵. white_jerk_rate: D_M Δt in place of that density. acceleration_step: the variance of
    a step of acceleration, (m/s²)². normalised: C_M of eq. (5), so that D_M is the number times σ_r²."""
    if form == "random_jerk":
        return manoeuvre_covariance(variance, dt)
    if form == "normalised":
        return manoeuvre_covariance(variance * sigma_range_m**2, dt)
    if form == "acceleration_step":
        return acceleration_step_covariance(variance / dt**2, dt)
    return white_jerk_covariance(variance if form == "white_jerk_rate" else variance / dt, dt)


def started(start: Start, observes: int, sigma: np.ndarray, dt: float, Q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Covariances (B, 3, 3) of B starts, believed and true, at the last of the scans that make them.

    observes is 1 (range) or 2 (and velocity); sigma (2,); Q (B, 3, 3) of a scan, which only `process_noise` uses: the
    others believe what is true of a target that does not manoeuvre while they start."""
    scans = first_scan(start, observes)
    if start == "process_noise":
        weights, believed = _start_with_process_noise(observes, scans, sigma, dt, Q)
        return believed, np.einsum("...ijk,j,...ljk->...il", weights, sigma**2, weights)
    if start == "first_differences":
        weights = _first_differences(observes, dt)
    else:
        weights, _ = least_squares_start(observes, scans, np.ones(2) if start == "unweighted" else sigma, dt)
    true = np.einsum("ijk,j,ljk->il", weights, sigma**2, weights)
    every = np.broadcast_to(true, (len(Q), 3, 3))
    return every, every


def first_scan(start: Start, observes: int) -> int:
    """The scan, from 1, of the first estimate of a filter."""
    return START_SCANS.get(start, USUAL_SCANS)[observes - 1]


def _first_differences(observes: int, dt: float) -> np.ndarray:
    """Weights (3, 2, scans): the last plot, and differences of the plots for what is not measured."""
    if observes == 1:
        weights = np.zeros((3, 2, 3))
        weights[0, 0, 2] = 1.0
        weights[1, 0] = np.array([0.0, -1.0, 1.0]) / dt
        weights[2, 0] = np.array([1.0, -2.0, 1.0]) / dt**2
        return weights
    weights = np.zeros((3, 2, 2))
    weights[0, 0, 1] = weights[1, 1, 1] = 1.0
    weights[2, 1] = np.array([-1.0, 1.0]) / dt
    return weights


def _start_with_process_noise(
    observes: int, scans: int, sigma: np.ndarray, dt: float, Q: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Generalised least squares on a state that the noise Q (B, 3, 3) moves: weights (B, 3, 2, scans), covariances. The
    state at scan n − j is F⁻ʲ x less what the j last steps added, carried back."""
    unit = np.array([1.0, 1.0 / dt, 1.0 / dt**2])  # one size for all columns
    H, back = observation(observes), np.linalg.inv(transition(dt))
    powers = [H @ np.linalg.matrix_power(back, j) for j in range(scans)]
    A = np.concatenate([powers[scans - 1 - k] for k in range(scans)]) * unit
    size = scans * observes
    C = np.zeros((len(Q), size, size)) + np.diag(np.tile(sigma[:observes] ** 2, scans))
    for i in range(1, scans):  # the push between scans i and i + 1 lies behind all earlier plots
        carried = np.concatenate([powers[i + 1 - k] for k in range(1, i + 1)])
        C[:, : len(carried), : len(carried)] += carried @ Q @ carried.T
    root = np.linalg.cholesky(C)
    solution = unit[:, None] * np.linalg.pinv(np.linalg.solve(root, np.broadcast_to(A, (len(Q), *A.shape))))
    rows = solution @ np.linalg.inv(root)
    weights = np.zeros((len(Q), 3, 2, scans))
    weights[:, :, :observes] = rows.reshape(-1, 3, scans, observes).transpose(0, 1, 3, 2)
    return weights, solution @ solution.transpose(0, 2, 1)


class Errors(NamedTuple):
    """σ of B versions over K scans, (B, K, 3): the true one on a quadratic truth, and the believed one. Not-a-number
    where there is no estimate. The believed one is the true one on a truth that moves as the filter believes, once it
    has started."""

    true: np.ndarray
    believed: np.ndarray


def errors(
    versions: Sequence[Version], observes: int, sigma: np.ndarray, dt: float, scans: int, Q: np.ndarray | None = None
) -> Errors:
    """σ of B versions by the exact recursion, of filters that observe the range (1) or range and velocity (2).

    sigma (2,); Q (B, 3, 3) as `covariances` gives it, where it is at hand."""
    Q = covariances(versions, sigma[0], dt) if Q is None else Q
    names = [start for _, _, start in versions]
    first = np.array([first_scan(name, observes) for name in names])
    P, S = _starts(names, observes, sigma, dt, Q)
    true, believed = np.full((2, scans, 3, len(versions)), np.nan)
    for begin in np.unique(first):
        of = np.flatnonzero(first == begin)
        found = _recursion(P[of], S[of], Q[of], observes, sigma, dt, scans - begin)
        for sigmas, own in zip((true, believed), found, strict=True):
            sigmas[: begin - 1, :observes, of] = sigma[:observes, None]
            sigmas[begin - 1 :, :, of] = own
    return Errors(true.transpose(2, 0, 1), believed.transpose(2, 0, 1))


def covariances(versions: Sequence[Version], sigma_range_m: float, dt: float) -> np.ndarray:
    """Q (B, 3, 3) of versions."""
    unit = {form: covariance_of(form, 1.0, sigma_range_m, dt) for form in FORMS}
    return np.array([variance * unit[form] for form, variance, _ in versions])


def _starts(
    names: Sequence[Start], observes: int, sigma: np.ndarray, dt: float, Q: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    believed, true = np.empty((2, len(names), 3, 3))
    for name in START_NAMES:
        if (of := np.flatnonzero([one == name for one in names])).size:
            believed[of], true[of] = started(name, observes, sigma, dt, Q[of])
    return believed, true


def _recursion(
    P: Any, S: Any, Q: np.ndarray, observes: int, sigma: np.ndarray, dt: float, steps: int
) -> tuple[np.ndarray, np.ndarray]:
    """True and believed σ, (steps + 1, 3, B), from the covariances believed P and true S at the start on."""
    P, S, q, F = pack(P), pack(S), pack(Q), constant_acceleration(dt)
    true, believed = np.empty((2, steps + 1, 3, len(Q)))
    for k in range(steps + 1):
        if k:
            P, S = predicted_covariance(P, F, q), predicted_covariance(S, F, NO_NOISE)
            for m in range(observes):
                P, gain, _ = TAKE[m](P, sigma[m] ** 2, 1.0)
                S = CORRECT[m](S, sigma[m] ** 2, gain)
        for to, of in ((true, S), (believed, P)):
            np.sqrt([of[0], of[3], of[5]], out=to[k])
        if k % LOOK == LOOK - 1 and _steady(true[k - 1 : k + 1]) and _steady(believed[k - 1 : k + 1]):
            true[k:], believed[k:] = true[k], believed[k]
            break
    return true, believed


LOOK = 16  # scans between looks whether all σ have settled
SETTLED = 1e-14  # relative change of a scan: some roundings


def _steady(sigma: np.ndarray) -> bool:
    """Whether σ of two scans (2, …) are the same but for rounding."""
    return bool((abs(sigma[1] - sigma[0]) <= SETTLED * sigma[1]).all())


def both(radar: tuple[float, float, float], versions: Sequence[Version], scans: int) -> tuple[Errors, Errors]:
    """Errors of range only, and of range and velocity, of versions on a radar (σ_r, σ_V, Δt)."""
    sigma, dt = np.array(radar[:2], dtype=float), float(radar[2])
    Q = covariances(versions, sigma[0], dt)
    return errors(versions, 1, sigma, dt, scans, Q), errors(versions, 2, sigma, dt, scans, Q)


def gain(base: np.ndarray, own: np.ndarray) -> np.ndarray:
    """Relative gain (17) in % of own σ over base, that of range only: arrays of any shape."""
    return 100 * (base - own) / base


# ---- search ----------------------------------------------------------------------------------------------------------
VARIANCES = tuple(float(f"{v:.4g}") for v in np.logspace(-5, 1, 121))  # twenty a decade, with the paper's 10⁻³
FINE = np.logspace(-5, 1, 1201)  # of the windows in D_M
TRUTHS = ("quadratic", "as believed")
SCANS = tuple(range(10, 41))
SPANS = ("same time", "same scans")  # of the fast radars
SHIPPED = {
    **{"process_noise": FORMS[0], "manoeuvre_variance": "0.001", "start": START_NAMES[0]},
    **{"truth": TRUTHS[0], "scans": "15", "span": SPANS[0]},
}
ASKS = {"scans": "how many scans there are", "span": "how long fast radars are observed"}
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


def _chunks(versions: Sequence[Version]) -> Iterator[_Chunk]:
    """By truth, in the order of TRUTHS."""
    with mapping() as mapped:  # NumPy computes outside the interpreter's lock
        found = dict(zip(RADARS, mapped(lambda n: both(RADARS[n], versions, _scans(n)), RADARS), strict=True))
    begins = np.array([first_scan(start, 2) for _, _, start in versions])
    alone = _settled(versions)
    for truth in range(len(TRUTHS)):
        gains = {}
        for n, (base, own) in found.items():
            gains[n] = gain(base[truth], own[truth])
            gains[n][np.arange(gains[n].shape[1]) + 1 < begins[:, None]] = np.nan  # both are the plot
        yield _Chunk(gains, found[2][0][truth][:, :, R], alone[truth])


def _settled(versions: Sequence[Version]) -> tuple[np.ndarray, np.ndarray]:
    """σ_r of RLS 2 from the range alone after LONG scans, (B,): the true one and the believed one."""
    plain = list(dict.fromkeys((form, variance, START_NAMES[0]) for form, variance, _ in versions))
    place = {one[:2]: i for i, one in enumerate(plain)}
    long = errors(plain, 1, np.array(RADARS[2][:2], dtype=float), RADARS[2][2], LONG)
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


def numbers(versions: Sequence[Version], span: str = SPANS[0]) -> np.ndarray:
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
    return Search(PRINTED, axes, SHIPPED, strict, granular, values, {"manoeuvre_variance": _fine()}, READ_AS, ASKS)


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
