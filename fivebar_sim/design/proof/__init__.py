"""Designs proven by simulation: the best of a search run in MuJoCo, on the same motions."""
