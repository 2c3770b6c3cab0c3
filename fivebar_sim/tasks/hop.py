"""The task to hop on the spot."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.checks import check_number
from fivebar_sim.paths import FootPath
from fivebar_sim.paths.base import FASTEST
from fivebar_sim.scenario.scenes import Rail, Scene
from fivebar_sim.tasks.base import Grounded, Part, clock_hand, effort
from fivebar_sim.tasks.motion import Motion
from fivebar_sim.tasks.stand import hold


class Hop(Grounded, frozen=True, tag="hop"):
    """Hop on the rail: bring the foot high above the floor, again and again.

        flight = min(height / target, 1) where the foot is above the floor, else 0
        effort = mean |tau|^2

    The phase is that of a clock which the agent may hop by. The default path holds the foot in a
    crouch, 0.16 size above the rest pose.

    Attributes:
        target: Height of the foot's ball above the floor that earns the full reward [m]; None for
            0.3 size.
        frequency: Frequency of the clock [Hz].
    """

    WEIGHTS: ClassVar[dict[str, float]] = {"flight": 1.0, "effort": -0.5}
    TARGETS: ClassVar[dict[str, Part]] = {"target": Part(1, "m"), "phase": Part(2, "")}

    target: float | None = None
    frequency: float = 2.0

    def __post_init__(self) -> None:
        super().__post_init__()
        check_number("frequency", self.frequency, "Hz", low=0.0, high=FASTEST, strict=True)
        if self.target is not None:
            size = self.leg.size
            check_number("target", self.target, "m", low=0.0, high=10.0 * size, strict=True)

    @property
    def scene(self) -> Scene:
        """The rail."""
        return Rail(mass=self.mass, friction=self.friction, drop=self.drop)

    @property
    def foot_path(self) -> FootPath:
        """The path, or the default crouch."""
        return self.path or hold(self.home + np.array([0.0, 0.16 * self.leg.size]))

    def targets(self) -> dict[str, Array]:
        """Return the target height and the clock's phase at each control step."""
        time = self.times
        target = 0.3 * self.leg.size if self.target is None else self.target
        phase = clock_hand(time * self.frequency)
        return {"target": np.full((len(time), 1), target), "phase": phase}

    def terms(self, now: Motion, targets: Array) -> dict[str, Array]:
        """Return the reward terms, (n,) each."""
        return {
            # A sunken foot has a height below 0: it is on the floor and earns nothing.
            "flight": np.clip(now.height / targets[:, 0], 0.0, 1.0),
            "effort": effort(now),
        }
