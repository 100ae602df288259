"""Questions to a design: solve for a key, tune a filter, and the sensitivity to each key."""
