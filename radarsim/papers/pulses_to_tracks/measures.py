"""What is measured for the claims on the chain, from the tables."""

from radarsim.papers.authoring import Estimate, ratio
from radarsim.papers.authoring import Evidence as GeneralEvidence


class Evidence(GeneralEvidence):
    """Finds the shipped experiments' cases by their names."""

    def over_ideal(self, key: str, name: str, component: str) -> Estimate:
        """σ of a filter at the last scan over the exact σ of its idealisation."""
        result = self.case(key)
        row = self.row("idealisations", case=result.name, filter=name, component=component, k=int(result.axes.k[-1]))
        return Estimate(*(float(row[column]) for column in ("over_ideal", "over_ideal_lo", "over_ideal_hi")))


def last_to_last(evidence: Evidence, key: str, name: str, base: str, component: str) -> Estimate:
    """σ at the last scan, of a filter over that of another."""
    return ratio(evidence.curve(key, name, component).last(), evidence.curve(key, base, component).last())
