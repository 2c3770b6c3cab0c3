"""Robots in Rerun: the recording of a run, and a run while it is simulated."""
