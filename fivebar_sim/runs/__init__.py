"""Run directories: written, read back, their recording opened."""
