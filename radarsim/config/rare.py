"""Keys of rare events that several studies share: realisations drawn where an event is frequent, weighted back."""

from radarsim.config.fields import Model

# α_0, of the realisations that are drawn as they are: no weight is over ten, and the rare part keeps nine tenths.
PLAIN_SHARE = 0.1


class RareEvent(Model):
    """An event that is rare: realisations shifted towards it, and weights that make up for it."""

    @property
    def aimed_at(self) -> str | None:
        """The name of the filter or estimator whose event is sought; None where it is sought for all."""
        return None
