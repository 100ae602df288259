"""Keys of a config fitted to recorded tracks by maximum likelihood: `radarsim fit`."""
