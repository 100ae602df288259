"""What is measured for the claims on folded velocity, from the tables."""

from typing import TYPE_CHECKING, Literal

from radarsim.papers.authoring import Curve, Estimate, MissingEvidence, ratio
from radarsim.papers.authoring import Evidence as GeneralEvidence

if TYPE_CHECKING:
    import pandas as pd


class Evidence(GeneralEvidence):
    """Finds the shipped experiments' cases by their names."""

    def above_oracle(self, key: str, name: str) -> Curve:
        """By how much σ of the velocity is above that of unfolded velocity, %, by scan."""
        gains = self.tables["gains"]
        columns = tuple(f"excess_over_oracle_percent{end}" for end in ("", "_lo", "_hi"))
        return self._curve_of_rows(gains[gains["component"] == "Vr"], key, name, columns)

    def _curve_of_rows(self, table: "pd.DataFrame", key: str, name: str, columns: tuple[str, ...]) -> Curve:
        rows = table[(table["case"] == self.case(key).name) & (table["filter"] == name)]
        if not len(rows):
            raise MissingEvidence(key)
        k, t, value, lo, hi = (rows[column].to_numpy() for column in ("k", "t_s", *columns))
        return Curve(k, t, value, lo, hi)


def velocity_gain(evidence: Evidence, key: str, name: str, scan: int | Literal["last"]) -> Estimate:
    """Gain of a filter in σ of the velocity against range alone at a scan, %."""
    gains = evidence.gain(key, name, "Vr")
    return gains.at_scan(scan) if isinstance(scan, int) else gains.last()


def above_at_the_end(evidence: Evidence, key: str, name: str) -> Estimate:
    """σ of the velocity above that of unfolded velocity at the last scan, %."""
    return evidence.above_oracle(key, name).last()


def worst_to_worst(evidence: Evidence, key: str, name: str, single: str) -> Estimate:
    """The largest σ of range over the scans, of a combination over that of a single order."""
    return ratio(evidence.curve(key, name, "r").largest(), evidence.curve(key, single, "r").largest())
