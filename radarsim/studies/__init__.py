"""Studies, one folder for each paper; their interface, their registry, and the identity of their results."""
