"""Columns that earlier versions named otherwise, so that results which were written with the old names can be read.

By study, table, and old name. An estimate `x` stands for its `exact_x` and the ends `x_lo`, `x_hi` of its interval,
too; where these ends had a stem of their own, that follows after `|`."""

from collections.abc import Iterator, Mapping

ENDS = ("_lo", "_hi")
RARE = {"rate": "event_rate", "plain": "n_plain"}
RENAMED: Mapping[str, Mapping[str, Mapping[str, str]]] = {
    "range_doppler": {"steady": {"last_sigma|last": "last_sigma"}},
    "sonar": {
        "classes": {"called_manoeuvring": "called_manoeuvring_share", "error_probability|": "error_probability"},
        "conversion": {"bias_m|bias": "bias_m"},
        "delays": {"probability|": "probability", "independent": "independent_probability"},
        "detections": {"probability|": "probability"},
        "gates": {"inside": "in_gate_share", "false_in_gate|false": "false_in_gate"},
        "modes": {"probability|": "probability"},
        "plots": {
            "what": "quantity",
            "bought_percent": "reduction_percent",
            "formula_bought_percent": "formula_reduction_percent",
        },
        "rare": RARE,
        "smoothing_gains": {
            "A": "position_gain",
            "A_formula": "position_gain_formula",
            "B": "velocity_gain",
            "B_formula": "velocity_gain_formula",
        },
        "track_classes": {
            "true_called_false|true": "true_called_false_share",
            "false_called_true|false": "false_called_true_share",
            "bound": "false_called_true_bound",
        },
        "tracking": {
            "m": "confirm_plots",
            "of": "confirm_scans",
            "confirmed": "confirmed_share",
            "time_to_confirm_s|time": "time_to_confirm_s",
            "kept_at_end|kept": "kept_at_end_share",
            "lost": "n_lost",
            "dropped": "n_dropped",
            "ends_per_hour|ends": "ends_per_hour",
            "life_s|life": "life_s",
            "wrong_share|wrong": "wrong_share",
            "false_confirmed": "false_confirmed_share",
            "false_tracks_per_hour|false": "false_tracks_per_hour",
        },
        "tracks": {
            "confirmed": "confirmed_share",
            "kept": "kept_share",
            "tentative": "n_tentative",
            "lost": "n_lost",
            "dropped": "n_dropped",
            "tentative_dropped": "n_tentative_dropped",
        },
    },
    "discriminator": {
        "bounds": {"potential_sigma": "crb", "potential_sigma_sum": "crb_sum"},
        "curves": {"posterior_sigma": "posterior_crb", "exact_sigma": "bound"},
        "locks": {
            "posterior_rate": "posterior_lock_rate",
            "posterior_rate_3sigma": "posterior_lock_rate_3sigma",
            "always_rate_3sigma|always": "unbroken_lock_rate_3sigma",
            "always_posterior_rate_3sigma|always_posterior": "unbroken_posterior_lock_rate_3sigma",
        },
        "motion": {"at": "burst_point"},
        "rare": RARE,
        "residuals": {"posterior_sigma": "posterior_crb"},
    },
    "ambiguous_doppler": {
        "folds": {"beyond": "beyond_half_interval_share"},
        "gains": {"above_oracle_percent|above_oracle": "excess_over_oracle_percent"},
        "rare": RARE,
    },
    "pulses_to_tracks": {
        "estimates": {"bound": "crb"},
        "idealisations": {"ideal": "idealisation"},
        "locks": {"taken": "used_share", "wrong_fold": "wrong_fold_share"},
    },
}
COMMON_TABLES = {"claims": {"what": "quantity", "why": "reason", "number": "variants_of"}}
ONE_FILE_STUDIES = {"last": {"last_sigma|last": "last_sigma"}}


def with_current_columns(study: str, table: str, content: bytes) -> bytes:
    """The CSV of a study's table with the present names of its columns."""
    header, line_end, rows = content.partition(b"\n")
    names = header.decode("utf-8", "replace").split(",")
    renamed = COMMON_TABLES.get(table) or RENAMED.get(study, ONE_FILE_STUDIES).get(table, {})
    current = {old: new for name, new in renamed.items() for old, new in _with_ends(name, new, names)}
    if not current.keys() & {*names}:
        return content
    return ",".join(current.get(name, name) for name in names).encode() + line_end + rows


def _with_ends(old: str, new: str, names: list[str]) -> Iterator[tuple[str, str]]:
    """The old and new names of an estimate's columns, if a table has it under its old name and ends."""
    value, has_stem, stem = old.partition("|")
    ends = [f"{stem if has_stem else value}{end}".removeprefix("_") for end in ENDS]
    if value in names and (not has_stem or ends[0] in names):
        yield value, new
        yield from zip(ends, (f"{new}{end}" for end in ENDS), strict=True)
        yield (f"exact_{value}" if not has_stem or stem else "exact"), f"exact_{new}"
