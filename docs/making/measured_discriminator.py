"""Numbers of docs/discriminator.md."""

from collections.abc import Callable

from making.numbers import Results
from making.result_rows import bounded, claim_value, select_rows

PAPER, MAPS, RIVAL = "discriminator_paper", "discriminator_maps", "discriminator_rival"
COMPUTED, PRINTED = "discriminator", "discriminator_as_printed"
CROSSING = "discriminator_crossing"
NOISES = (2.25, 4.5, 9, 13.5, 18)
REGION = ((0.5625, 1.125, 2.25, 4.5, 9, 18), (0.03, 0.1, 0.3, 1, 3, 10))


def last(results: Results, stem: str, case: str, name: str, table: str = "locks"):
    """The last window of a method."""
    matching = select_rows(results, stem, table, filter=name)
    return matching[matching["case"] == case].iloc[-1]


def lock(stem: str, case: str, name: str) -> Callable[[Results], str]:
    """The share of bursts locked at the last window, %."""

    def text(results: Results) -> str:
        row = last(results, stem, case, name)
        return f"{percent(row)} %"

    return text


def percent(row) -> str:
    """A share of bursts in per cent with its interval; of all or none only the bound that there is."""
    if row["lock_rate"] == 1:
        return f"100 (≥ {100 * row['lock_lo']:.4g})"
    if row["lock_rate"] == 0:
        return f"0 (≤ {100 * row['lock_hi']:.2g})"
    return bounded(row, "lock_rate", "lock", 100)


def lost(stem: str, case: str, name: str) -> Callable[[Results], str]:
    """How many bursts are lost, of how many."""

    def text(results: Results) -> str:
        row = last(results, stem, case, name)
        return f"{row['n'] - round(row['lock_rate'] * row['n'])} of {row['n']}"

    return text


def always(case: str, name: str) -> Callable[[Results], str]:
    """The share of bursts with all errors within three spreads, prior included, at all windows, %."""

    def text(results: Results) -> str:
        return f"{bounded(last(results, PAPER, case, name), 'unbroken_posterior_lock_rate_3sigma', scale=100)} %"

    return text


def passes(case: str, name: str) -> Callable[[Results], str]:
    """Passes over a window's data."""

    def text(results: Results) -> str:
        return f"{last(results, PAPER, case, name, 'passes')['passes']:.0f}"

    return text


def efficiency(stem: str, case: str, column: str, figures: int, *names: str) -> Callable[[Results], str]:
    """From the least to the largest ratio of σ to the Cramér–Rao bound among the components, last window."""

    def text(results: Results) -> str:
        ratios = []
        for name in names:
            table = select_rows(results, stem, "curves", filter=name)
            last_window = table[table["case"] == case].groupby("component").tail(1)
            ratios += list(last_window[column] / last_window["bound"])
        return " … ".join(f"{float(f'{ratio:.{figures}g}'):g}" for ratio in (min(ratios), max(ratios)))

    return text


def noise(results: Results) -> list[tuple]:
    """Lock of the three sequences by noise, with the energy ratio of their first window."""
    names = ("sequence", "dense", "cured")
    table_rows: list[tuple] = [("σ²", "μ(T₀)", *(f"{name}, %" for name in names))]
    for variance in (0.5625, 1.125, 2.25, 4.5, 9, 18, 36, 72):
        case = f"discriminator_pair burst.noise_variance={variance:g}"
        first = select_rows(results, MAPS, "locks", filter="cured")
        energy = first[first["case"] == case].iloc[0]["energy_ratio"]
        locks = (percent(last(results, MAPS, case, name)) for name in names)
        table_rows.append((f"{variance:g}", f"{energy:.3g}", *locks))
    return table_rows


def forecast(results: Results) -> list[tuple]:
    """Lock by how much worse the forecast is than believed."""
    names = ("sequence", "dense", "cured")
    table_rows: list[tuple] = [("errors over those assumed", *(f"{name}, %" for name in names))]
    for scale in (0.25, 0.5, 1, 1.5, 2, 3, 4):
        case = f"discriminator_pair prior.error_scale={scale:g}"
        table_rows.append((f"{scale:g}", *(percent(last(results, MAPS, case, name)) for name in names)))
    return table_rows


def region(results: Results) -> list[tuple]:
    """Lock of the cured sequence over noise and width of the forecast."""
    variances, scales = REGION
    table_rows: list[tuple] = [("forecast's σ ×", *(f"σ² = {variance:g}" for variance in variances))]
    for scale in scales:
        cases = (
            f"discriminator_pair burst.noise_variance={variance:g} prior.scale={scale:g}" for variance in variances
        )
        shares = (last(results, "discriminator_region", case, "cured")["lock_rate"] for case in cases)
        table_rows.append((f"{scale:g}", *(f"{100 * share:.1f}" for share in shares)))
    return table_rows


def rival(results: Results) -> list[tuple]:
    """Lock of the classical way and of the sequences on the same samples."""
    names = ("ridge", "sequence", "cured")
    table_rows: list[tuple] = [("σ²", "ridge, locked %", "paper's sequence", "cured sequence")]
    for variance in NOISES:
        case = f"{RIVAL} burst.noise_variance={variance:g}"
        table_rows.append((f"{variance:g}", *(percent(last(results, RIVAL, case, name)) for name in names)))
    return table_rows


def motion(results: Results) -> list[tuple]:
    """What the Cramér–Rao bounds mean in velocity and acceleration, by band."""
    heads = ("velocity at the start, m/s", "at the middle", "acceleration at the start, m/s²", "at the middle")
    table_rows: list[tuple] = [("band", "λ, m", *heads)]
    table = select_rows(results, PAPER, "motion")
    table = table[table["case"] == COMPUTED]
    for wavelength, rows_of_band in table.groupby("wavelength_m"):
        spots = [rows_of_band[rows_of_band["burst_point"] == moment].iloc[0] for moment in ("beginning", "middle")]
        cells = (
            f"{spot[f'sigma_{quantity}']:.2g}" for quantity in ("velocity_mps", "acceleration_mps2") for spot in spots
        )
        table_rows.append((rows_of_band["band"].iloc[0], f"{wavelength:g}", *cells))
    return table_rows


def model_error(column: str) -> Callable[[Results], str]:
    """What a cubic frequency leaves of the text's velocities."""

    def text(results: Results) -> str:
        return f"{select_rows(results, 'discriminator_profile', 'bounds').iloc[0][column]:.3g}"

    return text


def wide(results: Results) -> str:
    """σ of f₀ of the first window alone over the Cramér–Rao bound of the burst (P4.7)."""
    part_name = "RMS error of f0 of the first window over the Cramér–Rao bound of the burst (σ² = 2.25, c = 1)"
    return claim_value(PAPER, "P4.7", part_name, "")(results)


def costs(name: str, scale: float) -> Callable[[Results], str]:
    """Points of lock that a worse forecast costs (P4.10)."""

    def text(results: Results) -> str:
        case = "discriminator_pair prior.error_scale"
        worse, right = (last(results, MAPS, f"{case}={error_scale:g}", name)["lock_rate"] for error_scale in (scale, 1))
        return f"{100 * (right - worse):.0f}"

    return text


TAILS = "discriminator_tails lock_probability"
MEASURED = {
    "doppler_sequence": lock(PAPER, COMPUTED, "sequence"),
    "doppler_ten_steps": lock(PAPER, COMPUTED, "sequence 10 steps"),
    "doppler_five_steps": lock(PAPER, COMPUTED, "sequence 5 steps"),
    "doppler_half": lock(MAPS, f"{TAILS}=0.99", "Gaussian, c = 0.5"),
    "doppler_from_truth": lost(PAPER, COMPUTED, "narrow from truth"),
    "doppler_dense_lost": lost(PAPER, COMPUTED, "dense"),
    "doppler_cured_lost": lost(PAPER, COMPUTED, "cured"),
    "doppler_sequence_passes": passes(COMPUTED, "sequence"),
    "doppler_dense_passes": passes(COMPUTED, "dense"),
    "doppler_cured_passes": passes(COMPUTED, "cured"),
    "doppler_exact_tail": lock(PAPER, COMPUTED, "exact tail"),
    "doppler_exact_tail_999": lock(MAPS, f"{TAILS}=0.999", "exact tail"),
    "doppler_printed": lock(PAPER, PRINTED, "sequence"),
    "doppler_printed_dense": lock(PAPER, PRINTED, "dense"),
    "doppler_printed_cured": lock(PAPER, PRINTED, "cured"),
    "doppler_efficiency": efficiency(PAPER, COMPUTED, "sigma", 4, "sequence"),
    "doppler_efficiency_printed": efficiency(PAPER, PRINTED, "sigma", 4, "sequence"),
    "doppler_efficiency_all": efficiency(PAPER, COMPUTED, "sigma_all", 2, "sequence"),
    "doppler_always": always(COMPUTED, "sequence"),
    "doppler_always_printed": always(PRINTED, "sequence"),
    "doppler_always_cured": always(COMPUTED, "cured"),
    "doppler_narrow": lock(PAPER, COMPUTED, "narrow"),
    "doppler_wide": wide,
    "doppler_noise": noise,
    "doppler_forecast": forecast,
    "doppler_forecast_twice": costs("sequence", 2),
    "doppler_forecast_four": costs("sequence", 4),
    "doppler_region": region,
    "doppler_motion": motion,
    "doppler_rival": rival,
    "doppler_profile_hz": model_error("model_error_hz"),
    "doppler_profile_turns": model_error("model_error_turns"),
    "doppler_profile": lost("discriminator_profile", "discriminator_profile", "sequence"),
    "doppler_crossing": lock(CROSSING, CROSSING, "sequence"),
    "doppler_crossing_dense": lock(CROSSING, CROSSING, "dense"),
    "doppler_crossing_cured": lock(CROSSING, CROSSING, "cured"),
    "doppler_crossing_efficiency": efficiency(CROSSING, CROSSING, "sigma", 4, "sequence", "dense", "cured"),
}
