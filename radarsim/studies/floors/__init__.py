"""Errors below which no estimator gets: Cramér-Rao bounds, posterior and of unbiased estimators."""
