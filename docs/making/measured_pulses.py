"""Numbers of docs/pulses_to_tracks.md."""

from making.numbers import Results
from making.pick import bounded, rows

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
        bound = rows(results, "pulses_snr", "estimates", case=case.partition(" ")[2], filter="ideal").iloc[0]["bound"]
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
        bound = rows(results, "pulses_energy", "estimates", case=case.partition(" ")[2], filter="ideal").iloc[0][
            "bound"
        ]
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


MEASURED = {
    "pulses_filters": filters,
    "pulses_threshold": threshold,
    "pulses_energy": energy,
    "pulses_forecast": forecast,
    "pulses_acceleration": acceleration,
}
