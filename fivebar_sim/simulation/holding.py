"""Whether servos with a torque limit can hold the leg at all; checked before the simulation."""

from __future__ import annotations

import numpy as np

from fivebar_sim import dynamics, units
from fivebar_sim.arrays import Array, largest_of_rows
from fivebar_sim.errors import ConfigError
from fivebar_sim.metrics.columns import MOTORS
from fivebar_sim.motion import Motion
from fivebar_sim.scenario import Scenario
from fivebar_sim.scenario.scenes import Ground


def check(scenario: Scenario, wanted: Motion) -> None:
    """Raise unless the torque limit can hold the leg at rest in every pose of its motion.

    In the air the motors hold the weight of leg and payload, and the force on the foot. On the
    ground they hold the trunk's weight too, at the start, less what the floor's friction can take
    off them. The gears' friction helps to hold.

    Raises:
        ConfigError: The limit is too small; says when, and which torque is needed.
    """
    limit = scenario.servo.limit
    if limit is None:
        return

    torque = _holding(scenario, wanted)
    # A joint at rest sticks: its friction carries that much of the torque.
    worst = largest_of_rows(np.abs(torque)) - scenario.servo.dry
    k = int(np.argmax(worst))
    if worst[k] > limit:
        name = MOTORS[int(np.argmax(np.abs(torque[k])))]
        raise ConfigError(
            f"servo.limit cannot hold the leg at t = {wanted.time[k]:g} s: motor {name} must give "
            f"at least {units.text(worst[k], 'N m')} there at rest, got a limit of "
            f"{units.text(limit, 'N m')}"
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
    # Only at the start: how hard the foot presses later is known only after the run.
    alone = dynamics.inverse(leg, theta[:1], rest, rest, (0.0, weight))
    pull = dynamics.statics(leg, theta[:1], (1.0, 0.0))
    return _relieve(alone, pull, scene.friction * weight)


def _relieve(alone: Array, pull: Array, most: float) -> Array:
    """Return alone + f pull with |f| <= most, where the larger of both torques is smallest.

    There both torques are of equal size, or one of them is 0, or |f| = most.

    Args:
        alone: Torques of A and E without a force along x [N m], (1, 2).
        pull: Change of the torques per newton of that force [N m/N], (1, 2).
        most: Largest friction force between foot and floor [N].
    """
    a, e = alone[0]
    da, de = pull[0]
    # The largest |torque| is piecewise linear in f, so its minimum is at a kink or at an end.
    value = np.array([a, e, a - e, a + e])
    slope = np.array([da, de, da - de, da + de])
    # Gravity may be turned round: then nothing presses the foot on the floor.
    most = max(most, 0.0)
    # A line without slope has no kink: f = 0 stands in for it.
    zeros = -value / np.where(slope == 0.0, np.inf, slope)
    forces = np.clip([*zeros, -most, most], -most, most)
    torques = alone + forces[:, None] * pull
    return torques[[np.argmin(np.abs(torques).max(axis=1))]]
