"""Recordings for Rerun: written, shown while a run goes on, served to a browser."""
