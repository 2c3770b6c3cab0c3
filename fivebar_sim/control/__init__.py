"""The interface of controllers, the servos that they drive, and what their sensors show."""

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
