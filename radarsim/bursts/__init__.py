"""A coherent burst and the estimator of its Doppler frequency: what the studies that use bursts share (P4)."""
