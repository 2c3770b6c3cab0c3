"""A log laid over a run: aligned in time, the difference measured, limits on it, a page."""
