"""Numbers of docs/pulses_to_tracks.md."""

import math

from making.numbers import Results
from making.result_rows import bounded, select_rows
from radarsim.api.configs import load

SIGMA_V = (5, 15, 15, 1, 1)  # of P1's radars, m/s
SHOWN_SNR = (-4, -2, 0, 2, 4, 6, 10, 14)


def worst(results: Results, stem: str, case: str, name: str) -> str:
    """The least share of bursts that lock over the scans, %."""
    locks = select_rows(results, stem, "locks", filter=name)
    locks = locks[locks["case"] == case]
    row = locks.loc[locks["lock_rate"].idxmin()]
    if row["lock_rate"] == 1:
        return f"100 (≥ {100 * row['lock_lo']:.4g})"
    return bounded(row, "lock_rate", "lock", 100)


def sigma_over_ideal(results: Results, stem: str, case: str, name: str, component: str = "r") -> str:
    """σ at the last scan over its idealisation's."""
    idealisations = select_rows(results, stem, "idealisations", filter=name, component=component)
    return bounded(idealisations[idealisations["case"] == case].iloc[-1], "over_ideal")


def sigma(results: Results, stem: str, case: str, name: str, component: str) -> str:
    """σ at the last scan, exact where it is known."""
    curves = select_rows(results, stem, "curves", filter=name, component=component)
    row = curves[curves["case"] == case].iloc[-1]
    return f"{row['exact_sigma']:.4g}" if row["exact_sigma"] == row["exact_sigma"] else bounded(row, "sigma")


def bound_of(results: Results, stem: str, case: str) -> float:
    """The Cramér–Rao bound of the velocity from the first burst of a case, m/s."""
    estimates = select_rows(results, stem, "estimates", case=case.partition(" ")[2], filter="ideal")
    return float(estimates.iloc[0]["crb"])


def filters(results: Results) -> list[tuple]:
    """RLS 4's filters: locks, σ over the idealisation's, passes."""
    table_rows = [
        ("filter", "locked at the worst scan, %", "σ_r over ideal at 140 s", "σ_V over ideal", "passes a burst")
    ]
    for name in ("sequence", "cured", "spectrum", "cured, gated", "cured, mixture"):
        ratios = [sigma_over_ideal(results, "pulses", "pulses", name, component) for component in ("r", "Vr")]
        passes = select_rows(results, "pulses", "passes", filter=name).iloc[0]["passes"]
        table_rows.append((name, worst(results, "pulses", "pulses", name), *ratios, f"{passes:.1f}"))
    return table_rows


def threshold(results: Results) -> list[tuple]:
    """Locks and σ of range against the signal-to-noise ratio."""
    heads = ("SNR of a pulse, dB", "CRB of V, m/s", "cured: locked, %", "spectrum: locked, %")
    table_rows: list[tuple] = [
        (*heads, *(f"σ_r over ideal: {name}" for name in ("cured", "spectrum", "spectrum, mixture")))
    ]
    for snr in SHOWN_SNR:
        case = f"pulses_snr burst.snr_db={snr}"
        bound = bound_of(results, "pulses_snr", case)
        locked = [worst(results, "pulses_snr", case, name) for name in ("cured", "spectrum")]
        ratios = [
            sigma_over_ideal(results, "pulses_snr", case, name) for name in ("cured", "spectrum", "spectrum, mixture")
        ]
        table_rows.append((snr, f"{bound:.3g}", *locked, *ratios))
    return table_rows


def energy(results: Results) -> list[tuple]:
    """The same pulses a second in bursts more or less often."""
    table_rows: list[tuple] = [
        (
            "scan period, s",
            "pulses",
            "bound of V, m/s",
            "σ_r at the end: ideal, m",
            "spectrum, m",
            "σ_V: ideal, m/s",
            "spectrum",
        )
    ]
    for period in (2.5, 5, 10, 20):
        case = f"pulses_energy radar.scan_period_s={period}"
        bound = bound_of(results, "pulses_energy", case)
        last = [
            sigma(results, "pulses_energy", case, name, component)
            for component in ("r", "Vr")
            for name in ("ideal", "spectrum")
        ]
        table_rows.append((period, round(3.2 * period), f"{bound:.3g}", *last))
    return table_rows


def forecast(results: Results) -> list[tuple]:
    """Where the cured sequence starts."""
    table_rows: list[tuple] = [("forecast", "locked at the worst scan, %", "σ_r over ideal at 140 s", "σ_V over ideal")]
    for name in ("track", "fixed 30 m/s", "fixed 10 m/s", "fixed 3 m/s"):
        stem = "pulses_forecast"
        table_rows.append(
            (
                name,
                worst(results, stem, stem, name),
                *(sigma_over_ideal(results, stem, stem, name, c) for c in ("r", "Vr")),
            )
        )
    return table_rows


def acceleration(results: Results) -> list[tuple]:
    """σ of the acceleration at its worst over the scans, with the burst's acceleration and without."""
    stem = "pulses_acceleration"
    names = ("r+V", "r+V+a", "r+V, random jerk", "r+V+a, random jerk")
    table_rows: list[tuple] = [("largest σ of", "target", *names)]
    for target in ("polynomial", "turn", "acceleration_start"):
        for component, words in (("ar", "acceleration, m/s²"), ("r", "range, m")):
            cells = []
            for name in names:
                curve = select_rows(results, stem, "curves", case=f"target={target}", filter=name, component=component)
                curve = curve[curve["k"] > 2]
                cells.append(bounded(curve.loc[curve["sigma"].idxmax()], "sigma"))
            table_rows.append((words, target.replace("acceleration_start", "brake"), *cells))
    return table_rows


def tracks(results: Results) -> str:
    """How many tracks the table of the measured acceleration rests on."""
    return str(select_rows(results, "pulses_acceleration", "curves")["n"].iloc[0])


def accuracy(results: Results) -> str:
    """The Cramér–Rao bound of velocity in the long bursts, mm/s."""
    return f"{1e3 * select_rows(results, 'pulses_acceleration', 'estimates', component='Vr').iloc[0]['crb']:.2g}"


def radars(results: Results) -> list[tuple]:
    """A burst of each radar of P1 whose Cramér–Rao bound is its σ_V, and what the track makes of it."""
    table_rows: list[tuple] = [
        (
            *("radar", "λ, m", "σ_V, m/s", "T √E, ms", "T at 15 dB, ms", "pulses at 1 kHz"),
            *("simulated: F, kHz", "locked, %", "σ_r over ideal", "σ_V over ideal"),
        )
    ]
    for n, sigma in enumerate(SIGMA_V, start=1):
        case = f"pulses_rls{n}"
        spec = load(case).cases[0].spec
        duration_times_root_energy = math.sqrt(6) * spec.radar.wavelength_m / (4 * math.pi * sigma)
        max_duration = duration_times_root_energy / math.sqrt(10**1.5)
        burst_cells = (
            f"{1e3 * duration_times_root_energy:.3g}",
            f"{1e3 * max_duration:.2g}",
            math.floor(1e3 * max_duration) or "none",
        )
        ratios = [sigma_over_ideal(results, "pulses_radars", case, "spectrum", component) for component in ("r", "Vr")]
        locked = worst(results, "pulses_radars", case, "spectrum")
        rate = f"{spec.burst.repetition_rate_hz / 1e3:.3g}"
        table_rows.append((f"RLS {n}", f"{spec.radar.wavelength_m:g}", sigma, *burst_cells, rate, locked, *ratios))
    return table_rows


def folds(results: Results) -> list[tuple]:
    """Folds by hypotheses at 1 kHz: how often they are right, and σ over the idealisation's."""
    table_rows: list[tuple] = [
        (
            "SNR of a pulse, dB",
            "filter",
            "no wrong fold at k = 3 / 5 / 15, %",
            "σ_r over ideal at 140 s",
            "σ_V over ideal",
        )
    ]
    for snr in (0, 5.24):
        case = f"pulses_folds burst.snr_db={snr}"
        for name in ("nearest", "hypotheses", "hypotheses, mixture"):
            shares = results.table("pulses_folds", "folds")
            shares = shares[(shares["case"] == case) & (shares["filter"] == name)].set_index("k")["right"]
            right = " / ".join(f"{100 * shares[k]:.3g}" for k in (3, 5, 15)) if len(shares) else ""
            ratios = [sigma_over_ideal(results, "pulses_folds", case, name, component) for component in ("r", "Vr")]
            table_rows.append((snr, name, right, *ratios))
    return table_rows


def jerk(results: Results) -> str:
    """What a jerk of 20 m/s³ puts into the velocity of the long bursts, j T_p² (3N² − 7)/120, beside their bound."""
    spec = load("pulses_acceleration").cases[0].spec
    off = 20 * (3 * spec.pulses**2 - 7) / 120 / spec.burst.repetition_rate_hz**2
    return f"{1e3 * off:.2g} mm/s beside a bound of {accuracy(results)} mm/s"


MEASURED = {
    "pulses_tracks": tracks,
    "pulses_accuracy": accuracy,
    "pulses_radars": radars,
    "pulses_folds": folds,
    "pulses_jerk": jerk,
    "pulses_filters": filters,
    "pulses_threshold": threshold,
    "pulses_energy": energy,
    "pulses_forecast": forecast,
    "pulses_acceleration": acceleration,
}
