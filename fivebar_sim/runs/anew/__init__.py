"""Measures a run anew from its record alone, where its metrics.json is gone."""
