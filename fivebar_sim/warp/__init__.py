"""Legs on a device: the same models and plans, stepped by MuJoCo Warp in single precision.

Nothing here is imported before a device is asked for: Warp is an extra, and slow to import.
"""
