"""Whether servos with a torque limit can hold the leg at all, before anything is simulated."""

from __future__ import annotations

import numpy as np

from fivebar_sim import dynamics
from fivebar_sim.arrays import Array
from fivebar_sim.errors import ConfigError
from fivebar_sim.motion import Motion
from fivebar_sim.scenario import Scenario
from fivebar_sim.scenario.scenes import Ground


def check(scenario: Scenario, wanted: Motion) -> None:
    """Raise unless the torque limit holds the leg at rest in every pose of its motion.

    In the air that is the weight of leg and payload, and the force on it; on the ground, at the
    start, the trunk's, with what the floor's friction can take off the motors. The gears' friction
    holds with the motors.

    Raises:
        ConfigError: The limit is too small; says where and what it takes.
    """
    limit = scenario.servo.limit
    if limit is None:
        return

    torque = _holding(scenario, wanted)
    worst = np.abs(torque).max(axis=1) - scenario.servo.friction
    k = int(np.argmax(worst))
    if worst[k] > limit:
        name = "AE"[int(np.argmax(np.abs(torque[k])))]
        raise ConfigError(
            f"servo.limit cannot hold the leg at t = {wanted.time[k]:g} s: motor {name} must give "
            f"at least {worst[k]:.4g} N m there at rest, got a limit of {limit:g} N m"
        )


def _holding(scenario: Scenario, wanted: Motion) -> Array:
    """Return the torques that hold the poses of a motion [N m], (N + 1, 2)."""
    leg = scenario.leg
    theta = wanted.q[:, ::2]
    scene = scenario.scene
    rest = np.zeros(2)
    if not isinstance(scene, Ground):
        return dynamics.inverse(leg, theta, rest, rest, wanted.force, payload=wanted.payload)
    weight = (scene.mass + sum(link.mass for link in leg.links)) * -leg.gravity[1]
    alone = dynamics.inverse(leg, theta[:1], rest, rest, (0.0, weight))
    return _eased(alone, dynamics.statics(leg, theta[:1], (1.0, 0.0)), scene.friction * weight)


def _eased(alone: Array, pull: Array, most: float) -> Array:
    """Return the torques whose greater one is least, of alone + f pull with |f| <= most.

    That is where both are of one size, one of them is 0, or f is as great as it gets.

    Args:
        alone: Torques of A and E without a force along x [N m], (1, 2).
        pull: What they change by with each newton of it [N m], (1, 2).
        most: Friction of foot and floor [N].
    """
    a, e = alone[0]
    da, de = pull[0]
    value = np.array([a, e, a - e, a + e])
    slope = np.array([da, de, da - de, da + de])
    most = max(most, 0.0)
    zeros = -value / np.where(slope == 0.0, np.inf, slope)
    forces = np.clip([*zeros, -most, most], -most, most)
    torques = alone + forces[:, None] * pull
    return torques[[np.argmin(np.abs(torques).max(axis=1))]]
