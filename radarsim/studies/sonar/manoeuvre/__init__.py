"""P3: detection of manoeuvres, filters that respond to them, uses of a track."""
