"""Numbers of docs/multimodel.md."""

from collections.abc import Callable

from making.numbers import Results, signed, with_bounds
from making.result_rows import claim_value

SIX = ("MMA2-122", "MMA2-11", "Kalman-1 20", "Kalman-1 5", "Kalman-2 20", "Kalman-2 1")
STAGES = ("start", "ballistic", "manoeuvre", "after")
HEIGHT, CLIMB = "height", "rate of climb"


def sigma(component: str) -> Callable[[Results], list[tuple]]:
    """σ of a component by stage and algorithm, the least of each stage in bold."""

    def table(results: Results) -> list[tuple]:
        stages = results.table("multimodel", "stages")
        component_rows = stages[stages["component"] == component].set_index(["stage", "filter"])
        table_rows: list[tuple] = [("stage", *SIX)]
        for stage in STAGES:
            lowest = min(SIX, key=lambda name: component_rows.loc[(stage, name), "sigma"])
            cells = (with_bounds(*component_rows.loc[(stage, name), ["sigma", "sigma_lo", "sigma_hi"]]) for name in SIX)
            table_rows.append(
                (stage, *(f"**{cell}**" if name == lowest else cell for name, cell in zip(SIX, cells, strict=True)))
            )
        return table_rows

    return table


def costs(results: Results) -> list[tuple]:
    """Operations of one update by family and rule, at 20 Hz and at 1 Hz."""
    table_rows: list[tuple] = [("family", "rule", "at 20 Hz", "at 1 Hz")]
    fast, slow = (
        results.table("multimodel_rules", "operations").query(f"stage == 'whole' and case == 'multimodel_{case}'")
        for case in ("families", "families_1hz")
    )
    for row in fast.itertuples():
        (operations_at_1_hz,) = slow[slow["filter"] == row.filter]["operations"]
        table_rows.append(
            (row.family, row.merge.replace("_", " "), f"{row.operations:.0f}", f"{operations_at_1_hz:.0f}")
        )
    return table_rows


def rival(stage: str, words: str) -> Callable[[Results], str]:
    """The paired gain of MMA2-122 over the best of the other five."""
    return claim_value("multimodel", "P2.1", f"gain over the best other one, {words}, aeroballistic, stage {stage}")


def largest(stem: str, claim: str, begins: str, sign: int = 0) -> Callable[[Results], str]:
    """The largest (sign 1), the least (-1) or the farthest from nought (0) among the parts of a claim that begin so."""

    def text(results: Results) -> str:
        table = results.table(stem, "claims")
        parts = table[(table["claim"] == claim) & table["quantity"].str.startswith(begins)]
        row = parts.loc[(sign * parts["measured"] if sign else parts["measured"].abs()).idxmax()]
        words, stage = row["quantity"].split(", ")[-2:]
        return f"{with_bounds(row['measured'], row['lo'], row['hi'])} % ({words}, {stage.removeprefix('stage ')})"

    return text


def combined(pure: str, stage: str) -> Callable[[Results], str]:
    """The gain in height of the combined rule over a pure one."""
    return claim_value("multimodel_rules", "P2.8", f"gain of combined over {pure}, 20 Hz, {HEIGHT}, stage {stage}")


def conversion(case: dict, base: dict, component: str = "y") -> Callable[[Results], str]:
    """By how much σ over the ballistic stage is larger than that of another case or filter, in per cent."""

    def value(results: Results, key: dict) -> float:
        stages = results.table("multimodel_covariance", "stages")
        matching = stages[(stages["stage"] == "ballistic") & (stages["component"] == component)]
        angle, kind = f"sigma_elevation_deg={key['angle']} ", f"conversion={key['conversion']}"
        matching = matching[
            (matching["case"] + " ").str.contains(angle) & (matching["case"] + " ").str.contains(f"{kind} ")
        ]
        (sigma,) = matching[matching["filter"] == key["filter"]]["sigma"]
        return sigma

    def text(results: Results) -> str:
        change = 100 * (value(results, case) / value(results, base) - 1)
        return signed(f"{change:.0f} %" if abs(change) > 10 else f"{change:.2g} %")

    return text


PLAIN = {"angle": "0.1", "conversion": "plain", "filter": "at the plot"}
COARSE = PLAIN | {"angle": "1"}
AHEAD = {"filter": "at the prediction"}
UNBIASED = {"conversion": "unbiased"}

MEASURED = {
    "multimodel_sigma_y": sigma("y"),
    "multimodel_sigma_vy": sigma("vy"),
    "multimodel_costs": costs,
    **{f"multimodel_rival_{stage}_y": rival(stage, HEIGHT) for stage in STAGES},
    **{f"multimodel_rival_{stage}_vy": rival(stage, CLIMB) for stage in STAGES},
    "multimodel_weak": claim_value("multimodel", "P2.5", "mean probability of model 1, aeroballistic, stage whole", ""),
    "multimodel_modified_most": largest("multimodel_rules", "P2.6", "gain of modified over combined, 20 Hz"),
    "multimodel_modified_manoeuvre_y": claim_value(
        "multimodel_rules", "P2.6", f"gain of modified, 1 Hz, {HEIGHT}, stage manoeuvre"
    ),
    "multimodel_modified_manoeuvre_vy": claim_value(
        "multimodel_rules", "P2.6", f"gain of modified, 1 Hz, {CLIMB}, stage manoeuvre"
    ),
    "multimodel_mma2_cost": claim_value("multimodel_rules", "P2.7", "operations of MMA2 / MMA3, 20 Hz", ""),
    "multimodel_mma2_worst": largest("multimodel_rules", "P2.7", "gain of MMA2 over MMA3, 20 Hz", -1),
    "multimodel_mma2_worst_1hz": largest("multimodel_rules", "P2.7", "gain of MMA2 over MMA3, 1 Hz", -1),
    "multimodel_mma1_best": largest("multimodel_rules", "P2.7", "gain of MMA1 over MMA3, 20 Hz", 1),
    **{f"multimodel_combined_moment_{stage}": combined("moment", stage) for stage in STAGES[1:]},
    "multimodel_combined_best_least": largest("multimodel_rules", "P2.8", "gain of combined over best", -1),
    "multimodel_combined_best_most": largest("multimodel_rules", "P2.8", "gain of combined over best", 1),
    "multimodel_modified_cost": claim_value(
        "multimodel_rules", "P2.10", "operations of modified / combined, 20 Hz", ""
    ),
    "multimodel_modified_cost_1hz": claim_value(
        "multimodel_rules", "P2.10", "operations of modified / combined, 1 Hz", ""
    ),
    "multimodel_often": largest("multimodel_transition", "P2.12", "gain of ten times as frequent changes"),
    "multimodel_rare": largest("multimodel_transition", "P2.12", "gain of ten times rarer changes"),
    "multimodel_ahead_y": conversion(PLAIN | AHEAD, PLAIN),
    "multimodel_ahead_vy": conversion(PLAIN | AHEAD, PLAIN, "vy"),
    "multimodel_unbiased": conversion(PLAIN | UNBIASED, PLAIN),
    "multimodel_unbiased_coarse": conversion(COARSE | UNBIASED, COARSE),
    "multimodel_ahead_coarse": conversion(COARSE | AHEAD, COARSE),
}
