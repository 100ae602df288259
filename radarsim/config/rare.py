"""Keys of rare events that several studies share: realisations drawn where an event is frequent, weighted back."""

from typing import Annotated

from pydantic import Field, Strict

from radarsim.config.fields import Model


class RareEvent(Model):
    """An event that is rare: realisations shifted towards it, and weights that make up for it."""

    plain_share: Annotated[float, Strict(), Field(ge=0.01, le=0.9)] = Field(
        0.1,
        title="share of plain realisations",
        json_schema_extra={"symbol": "α_0"},
        description="share of the realisations that are drawn as they are, no unit; no weight is over one divided by "
        "it",
    )

    @property
    def aimed_at(self) -> str | None:
        """The name of the filter or estimator whose event is sought; None where it is sought for all."""
        return None
