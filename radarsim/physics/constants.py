"""Physical constants that more than one study uses."""

STANDARD_GRAVITY_MPS2 = 9.80665  # ISO 80000-3
