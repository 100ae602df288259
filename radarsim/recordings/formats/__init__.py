"""File formats of recordings, from which plots or true positions are read: `radarsim import`."""
