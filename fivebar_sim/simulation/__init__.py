"""From a scenario to its record and metrics."""
