"""What a controller is, the servo that it drives, and what it sees."""

from fivebar_sim.control.interface import (
    Feedback,
    Observation,
    Reference,
    Setpoints,
    find,
    known,
    name_of,
)

__all__ = ["Feedback", "Observation", "Reference", "Setpoints", "find", "known", "name_of"]
