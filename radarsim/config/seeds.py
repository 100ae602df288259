"""Seeds for other purposes than judging, which follow from the seed of a run."""

import hashlib

TRAINING, OTHER_NOISE = "training", "other noise"
SEED_BITS = 64  # of a seed in a config


def other_seed(seed: int, purpose: str) -> int:
    """The seed for a purpose: another one than that of the run by construction, and none that anybody chooses."""
    word = int.from_bytes(hashlib.sha256(f"{seed}:{purpose}".encode()).digest()[:8], "big") % 2**SEED_BITS
    return word if word != seed else word ^ 1
