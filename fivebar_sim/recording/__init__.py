"""Recordings for Rerun: written to files, shown live during a run, served to a browser."""
