"""P3's kernels that the three parts of the sonar share."""
