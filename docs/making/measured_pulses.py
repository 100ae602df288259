"""Numbers of docs/pulses_to_tracks.md."""

import math

from making.numbers import Results
from making.pick import bounded, rows
from radarsim.app.configs import load

SIGMA_V = (5, 15, 15, 1, 1)  # of P1's radars, m/s
SHOWN_SNR = (-4, -2, 0, 2, 4, 6, 10, 14)


def worst(results: Results, stem: str, case: str, name: str) -> str:
    """The least share of bursts that lock over the scans, %."""
    found = rows(results, stem, "locks", filter=name)
    found = found[found["case"] == case]
    row = found.loc[found["lock_rate"].idxmin()]
    if row["lock_rate"] == 1:
        return f"100 (≥ {100 * row['lock_lo']:.4g})"
    return bounded(row, "lock_rate", "lock", 100)


def over(results: Results, stem: str, case: str, name: str, component: str = "r") -> str:
    """σ at the last scan over its idealisation's."""
    found = rows(results, stem, "idealisations", filter=name, component=component)
    return bounded(found[found["case"] == case].iloc[-1], "over_ideal")


def sigma(results: Results, stem: str, case: str, name: str, component: str) -> str:
    """σ at the last scan, exact where it is known."""
    found = rows(results, stem, "curves", filter=name, component=component)
    row = found[found["case"] == case].iloc[-1]
    return f"{row['exact_sigma']:.4g}" if row["exact_sigma"] == row["exact_sigma"] else bounded(row, "sigma")


def bound_of(results: Results, stem: str, case: str) -> float:
    """The Fisher bound of the velocity from the first burst of a case, m/s."""
    found = rows(results, stem, "estimates", case=case.partition(" ")[2], filter="ideal")
    return float(found.iloc[0]["bound"])


def filters(results: Results) -> list[tuple]:
    """RLS 4's filters: locks, σ over the idealisation's, passes."""
    made = [("filter", "locked at the worst scan, %", "σ_r over ideal at 140 s", "σ_V over ideal", "passes a burst")]
    for name in ("sequence", "cured", "spectrum", "cured, gated", "cured, mixture"):
        last = [over(results, "pulses", "pulses", name, component) for component in ("r", "Vr")]
        passes = rows(results, "pulses", "passes", filter=name).iloc[0]["passes"]
        made.append((name, worst(results, "pulses", "pulses", name), *last, f"{passes:.1f}"))
    return made


def threshold(results: Results) -> list[tuple]:
    """Locks and σ of range against the signal-to-noise ratio."""
    heads = ("SNR of a pulse, dB", "Fisher bound of V, m/s", "cured: locked, %", "spectrum: locked, %")
    made: list[tuple] = [(*heads, *(f"σ_r over ideal: {name}" for name in ("cured", "spectrum", "spectrum, mixture")))]
    for snr in SHOWN_SNR:
        case = f"pulses_snr burst.snr_db={snr}"
        bound = bound_of(results, "pulses_snr", case)
        locked = [worst(results, "pulses_snr", case, name) for name in ("cured", "spectrum")]
        last = [over(results, "pulses_snr", case, name) for name in ("cured", "spectrum", "spectrum, mixture")]
        made.append((snr, f"{bound:.3g}", *locked, *last))
    return made


def energy(results: Results) -> list[tuple]:
    """The same pulses a second in bursts more or less often."""
    made: list[tuple] = [
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
        made.append((period, round(3.2 * period), f"{bound:.3g}", *last))
    return made


def forecast(results: Results) -> list[tuple]:
    """Where the cured sequence starts."""
    made: list[tuple] = [("forecast", "locked at the worst scan, %", "σ_r over ideal at 140 s", "σ_V over ideal")]
    for name in ("track", "fixed 30 m/s", "fixed 10 m/s", "fixed 3 m/s"):
        stem = "pulses_forecast"
        made.append(
            (name, worst(results, stem, stem, name), *(over(results, stem, stem, name, c) for c in ("r", "Vr")))
        )
    return made


def acceleration(results: Results) -> list[tuple]:
    """σ of the acceleration at its worst over the scans, with the burst's acceleration and without."""
    stem = "pulses_acceleration"
    names = ("r+V", "r+V+a", "r+V, random jerk", "r+V+a, random jerk")
    made: list[tuple] = [("largest σ of", "target", *names)]
    for target in ("polynomial", "turn", "acceleration_start"):
        for component, words in (("ar", "acceleration, m/s²"), ("r", "range, m")):
            cells = []
            for name in names:
                found = rows(results, stem, "curves", case=f"target={target}", filter=name, component=component)
                found = found[found["k"] > 2]
                cells.append(bounded(found.loc[found["sigma"].idxmax()], "sigma"))
            made.append((words, target.replace("acceleration_start", "brake"), *cells))
    return made


def tracks(results: Results) -> str:
    """How many tracks the table of the measured acceleration rests on."""
    return str(rows(results, "pulses_acceleration", "curves")["n"].iloc[0])


def accuracy(results: Results) -> str:
    """The Fisher bound of velocity in the long bursts, mm/s."""
    return f"{1e3 * rows(results, 'pulses_acceleration', 'estimates', component='Vr').iloc[0]['bound']:.2g}"


def radars(results: Results) -> list[tuple]:
    """A burst of each radar of P1 whose Fisher bound is its σ_V, and what the track makes of it."""
    made: list[tuple] = [
        (
            *("radar", "λ, m", "σ_V, m/s", "T √E, ms", "T at 15 dB, ms", "pulses at 1 kHz"),
            *("simulated: F, kHz", "locked, %", "σ_r over ideal", "σ_V over ideal"),
        )
    ]
    for n, sigma in enumerate(SIGMA_V, start=1):
        case = f"pulses_rls{n}"
        spec = load(case).cases[0].spec
        whole = math.sqrt(6) * spec.radar.wavelength_m / (4 * math.pi * sigma)
        longest = whole / math.sqrt(10**1.5)
        needed = (f"{1e3 * whole:.3g}", f"{1e3 * longest:.2g}", math.floor(1e3 * longest) or "none")
        last = [over(results, "pulses_radars", case, "spectrum", component) for component in ("r", "Vr")]
        locked = worst(results, "pulses_radars", case, "spectrum")
        rate = f"{spec.burst.repetition_rate_hz / 1e3:.3g}"
        made.append((f"RLS {n}", f"{spec.radar.wavelength_m:g}", sigma, *needed, rate, locked, *last))
    return made


def folds(results: Results) -> list[tuple]:
    """Folds by hypotheses at 1 kHz: how often they are right, and σ over the idealisation's."""
    made: list[tuple] = [
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
            found = results.table("pulses_folds", "folds")
            found = found[(found["case"] == case) & (found["filter"] == name)].set_index("k")["right"]
            right = " / ".join(f"{100 * found[k]:.3g}" for k in (3, 5, 15)) if len(found) else ""
            last = [over(results, "pulses_folds", case, name, component) for component in ("r", "Vr")]
            made.append((snr, name, right, *last))
    return made


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
