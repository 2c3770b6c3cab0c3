"""The task to land and stand at a height."""

from __future__ import annotations

from typing import ClassVar

from fivebar_sim.arrays import Array
from fivebar_sim.paths import FootPath, Step
from fivebar_sim.scenario.scenes import Rail, Scene
from fivebar_sim.tasks.base import Grounded, Part, closeness, effort
from fivebar_sim.tasks.motion import Motion


class Stand(Grounded, frozen=True, tag="stand"):
    """Hold the hip still at the height h* of the path's end, on the rail, after a drop.

        height = exp(-(hip_z - h*)^2 / (0.05 size)^2),   still = hip_dot_z^2
        effort = mean |tau|^2

    The default path holds the foot in the rest pose.
    """

    WEIGHTS: ClassVar[dict[str, float]] = {"height": 1.0, "still": -1.0, "effort": -0.1}
    TARGETS: ClassVar[dict[str, Part]] = {"target": Part(1, "m")}

    drop: float = 0.01

    @property
    def scene(self) -> Scene:
        """The rail."""
        return Rail(mass=self.mass, friction=self.friction, drop=self.drop)

    @property
    def foot_path(self) -> FootPath:
        """The path, or the default hold."""
        return self.path or hold(self.home)

    def targets(self) -> dict[str, Array]:
        """Return the hip's height h* at each control step."""
        # With the ball on the floor the hip is as high as the foot is deep, plus the ball's radius.
        foot = self.foot_path.at(self.times).position
        return {"target": self.leg.foot_radius - foot[:, 1:]}

    def terms(self, now: Motion, targets: Array) -> dict[str, Array]:
        """Return the reward terms, (n,) each."""
        return {
            "height": closeness(now.hip[:, :1] - targets, 0.05 * self.leg.size),
            "still": now.hip[:, 1] ** 2,
            "effort": effort(now),
        }


def hold(foot: Array) -> Step:
    """Return the path that holds the foot at a point (2,) [m]."""
    x, z = foot.tolist()
    # A step of no length; past its second it stays held, so any time will do.
    return Step(start=(x, z), stop=(x, z), lift=0.0, seconds=1.0)
