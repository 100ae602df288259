"""Kernels of detectors and of interacting models."""
