"""Delays in timesteps: servos and sensors keep the part of one in which a delay ends."""

from __future__ import annotations


def in_steps(delay: float, timestep: float, steps: int) -> tuple[int, float]:
    """Return the whole timesteps in a delay, at most `steps`, and the part of one beyond.

    Args:
        delay: [s], at least 0.
        timestep: h [s].
        steps: Timesteps in the run: a longer delay is as good as one of all of them.
    """
    late = min(delay / timestep, steps)
    # Decimals are rounded as floats: 0.003 / 0.001 is 3 to a part in a million.
    if abs(late - round(late)) < 1e-6:
        return round(late), 0.0
    return int(late), late - int(late)
