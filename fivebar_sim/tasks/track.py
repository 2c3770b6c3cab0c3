"""The task to follow a foot path in the air."""

from __future__ import annotations

from typing import ClassVar

from fivebar_sim.arrays import Array
from fivebar_sim.paths import Ellipse, FootPath
from fivebar_sim.scenario.scenes import Air, Scene
from fivebar_sim.tasks.base import Part, Task, closeness, effort, phase
from fivebar_sim.tasks.motion import Motion


class Track(Task, frozen=True, tag="track"):
    """Follow a periodic foot path; the hip is fixed in the air.

        tracking = exp(-|F - F*|^2 / (0.05 size)^2),   effort = mean |tau|^2

    The default path is an ellipse about the rest pose, 0.4 size by 0.16 size, twice a second: that
    of the scenario classic-ellipse, half a millimetre higher.
    """

    WEIGHTS: ClassVar[dict[str, float]] = {"tracking": 1.0, "effort": -0.1}
    TARGETS: ClassVar[dict[str, Part]] = {
        "target": Part(2, "m"),
        "target_dot": Part(2, "m/s"),
        "phase": Part(2, ""),
    }

    @property
    def scene(self) -> Scene:
        """Air."""
        return Air()

    @property
    def foot_path(self) -> FootPath:
        """The path, or the default ellipse."""
        if self.path is not None:
            return self.path
        x, z = self.home.tolist()
        size = self.leg.size
        return Ellipse(centre=(x, z), radii=(0.2 * size, 0.08 * size), frequency=2.0)

    def targets(self) -> dict[str, Array]:
        """Return target, its rate, and the phase at each control step."""
        time = self.times
        path = self.foot_path
        wanted = path.at(time)
        return {
            "target": wanted.position,
            "target_dot": wanted.velocity,
            "phase": phase(path, time),
        }

    def terms(self, now: Motion, targets: Array) -> dict[str, Array]:
        """Return the reward terms, (n,) each."""
        return {
            "tracking": closeness(now.foot - targets[:, :2], 0.05 * self.leg.size),
            "effort": effort(now),
        }
