"""The task to walk on a treadmill."""

from __future__ import annotations

import math
from typing import ClassVar

from fivebar_sim import paths
from fivebar_sim.arrays import Array
from fivebar_sim.errors import ConfigError
from fivebar_sim.paths.gait import GRAVITY
from fivebar_sim.scenario.scenes import Scene, Treadmill
from fivebar_sim.tasks.base import Grounded, Part, closeness, effort, phase
from fivebar_sim.tasks.motion import Motion


class Gait(Grounded, frozen=True, tag="gait"):
    """Follow the foot path of a gait, over a belt that runs at its stance speed v.

        tracking = exp(-|F - F*|^2 / (0.1 size)^2),   effort = mean |tau|^2
        slip = (F_dot_x + v)^2 where the foot touches the belt, else 0

    Nothing else carries the trunk: the rail ends at half the height of touch-down, far below any
    gait. The default path is a run below the rest pose: stride 0.4 size, lift 0.15 size, five
    strides a second for the classic leg and fewer for a longer one, as of a pendulum.
    """

    WEIGHTS: ClassVar[dict[str, float]] = {"tracking": 1.0, "slip": -1.0, "effort": -0.1}
    TARGETS: ClassVar[dict[str, Part]] = {
        "target": Part(2, "m"),
        "target_dot": Part(2, "m/s"),
        "phase": Part(2, ""),
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.path is not None and not isinstance(self.path, paths.Gait):
            kind = self.path.__struct_config__.tag
            raise ConfigError(f"the path of task 'gait' must be of kind 'gait', got {kind!r}")

    @property
    def scene(self) -> Scene:
        """The treadmill."""
        path = self.foot_path
        leg = self.leg
        return Treadmill(
            mass=self.mass,
            friction=self.friction,
            drop=self.drop,
            speed=path.stance_speed,
            stop=0.5 * (leg.foot_radius - path.centre[1]),
        )

    @property
    def foot_path(self) -> paths.Gait:
        """The path, or the default run."""
        if self.path is not None:
            assert isinstance(self.path, paths.Gait)
            return self.path

        x, z = self.home.tolist()
        size = self.leg.size
        return paths.Gait(
            centre=(x, z - 0.08 * size),
            stride=0.4 * size,
            lift=0.15 * size,
            frequency=0.5 * math.sqrt(GRAVITY / size),
            duty=0.7,
            running=True,
            ramp=0.1,
        )

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
        # The belt runs towards -x, so a foot at rest on it has minus the stance speed.
        slip = now.foot_dot[:, 0] + self.foot_path.stance_speed
        return {
            "tracking": closeness(now.foot - targets[:, :2], 0.1 * self.leg.size),
            "slip": slip**2 * now.contact,
            "effort": effort(now),
        }
