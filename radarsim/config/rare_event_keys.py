"""Keys of rare events: realisations drawn where an event is frequent, and weighted back."""

from radarsim.config.model import Model

# α_0, the share of realisations that are drawn without a shift: so no weight exceeds ten, and nine tenths are shifted.
PLAIN_SHARE = 0.1


class RareEvent(Model):
    """An event that is rare: realisations shifted towards it, and weights that make up for it."""

    @property
    def aimed_at(self) -> str | None:
        """The filter or estimator whose event is sought; None if that of all is."""
        return None
