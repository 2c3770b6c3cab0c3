"""Runs against their limits and baselines."""
