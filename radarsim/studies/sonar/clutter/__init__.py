"""P3: tracks among false plots."""
