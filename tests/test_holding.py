"""Limits that hold the leg, and limits that cannot: just above and just below what it takes."""

from __future__ import annotations

import numpy as np
import pytest

from fivebar_sim import dynamics, kinematics, rollout
from fivebar_sim.arrays import Array
from fivebar_sim.errors import ConfigError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.scenario import Scenario

LEG = FiveBar.load("classic")
ELLIPSE = ("path.frequency=4", "path.ramp=0.1", "duration=0.6")


def hold(x: float) -> tuple[str, ...]:
    return (
        f"path={{kind='step', start=[{x}, -0.07], stop=[{x}, -0.07], lift=0, seconds=0.2}}",
        "duration=0.6",
    )


def scenario(*settings: str) -> Scenario:
    return Scenario.load("classic-ellipse", ["limits={}", *settings])


def accepted(limit: float, *settings: str) -> bool:
    try:
        rollout.plan(scenario(*settings, f"servo.limit={limit}"))
    except ConfigError as error:
        if not str(error).startswith("servo.limit cannot hold the leg at t = "):
            raise
        return False
    return True


def holds_from(needed: float, *settings: str, rel: float = 2e-6) -> bool:
    """Return whether a limit is accepted from one on [N m], to a part rel of it."""
    above = accepted((1.0 + rel) * needed, *settings)
    return above and not accepted((1.0 - rel) * needed, *settings)


def weight(trunk: float) -> float:
    return 9.81 * (trunk + sum(link.mass for link in LEG.links))


def standing(x: float, trunk: float, friction: float) -> float:
    """Return the least greater torque that holds the trunk, over all pulls of the floor [N m]."""
    theta = kinematics.inverse(LEG, [x, -0.07])
    most = friction * weight(trunk)
    pulls: Array = np.linspace(-most, most, 20_001)
    force = np.stack([pulls, np.full_like(pulls, weight(trunk))], axis=-1)
    torques = dynamics.inverse(LEG, theta, np.zeros(2), np.zeros(2), force)
    return float(np.abs(torques).max(axis=1).min())


# law


@pytest.mark.parametrize(
    ("settings", "payload"),
    [((), 0.0), (("scene={kind='payload', mass=0.2}",), 0.2), (("leg.mass=[0.1,0.1,0.1,0.1]",), 0)],
)
def test_in_the_air_the_worst_pose_is_held(settings: tuple[str, ...], payload: float) -> None:
    asked = scenario(*ELLIPSE, *settings)
    theta = kinematics.inverse(asked.leg, asked.foot_path)
    torque = dynamics.inverse(asked.leg, theta, np.zeros(2), np.zeros(2), payload=payload)
    assert holds_from(float(np.abs(torque).max()), *ELLIPSE, *settings)


@pytest.mark.parametrize("friction", [0.0, 0.1, 1.0])
@pytest.mark.parametrize("x", [-0.02, 0.0, 0.01, 0.03])
def test_on_the_ground_friction_helps_to_stand(x: float, friction: float) -> None:
    scene = f"scene={{kind='rail', mass=0.4, friction={friction}}}"
    # the grid of pulls is as fine as this
    assert holds_from(standing(x, 0.4, friction), scene, *hold(x), rel=2e-4)


def test_gear_friction_holds_with_the_motors() -> None:
    alone = standing(0.0, 0.5, 1.0)
    assert holds_from(alone, "scene=rail", *hold(0.0), rel=2e-4)
    assert holds_from(alone - 0.03, "scene=rail", *hold(0.0), "servo.friction=0.03", rel=3e-4)


def test_no_limit_holds_everything_and_no_weight_needs_none() -> None:
    rollout.plan(scenario("scene={kind='rail', mass=500}", *hold(0.0)))
    for scene in ("air", "rail"):
        assert accepted(1e-9, f"scene={scene}", "leg.gravity=[0, 0]", *hold(0.0))


# oracle


@pytest.mark.parametrize("x", [0.0, 0.02])
def test_simulated_leg_stands_above_the_limit_and_falls_below_it(x: float) -> None:
    """With 2 % more than it takes the trunk stays up; with 10 % less, unchecked, it comes down."""
    # Fed forward, so that the leg stands from the start: one that falls onto its springs needs more
    # than its weight to be stopped.
    gains = ["servo.kp=50", "servo.kd=0.2", "controller.feedforward=torque"]
    settings = ["scene=rail", *hold(x), "duration=2.0", *gains]
    needed = standing(x, 0.5, 1.0)
    heights = []
    for limit in (1.02 * needed, 0.9 * needed):
        plan = rollout.plan(scenario(*settings))
        weak = scenario(*settings, f"servo.limit={limit}")
        again = rollout.plan(scenario(*settings, "servo.limit=9"))
        model = again.model
        for name in "AE":
            model.actuator(name).forcerange[:] = -limit, limit
        result = rollout.execute(plan._replace(scenario=weak, model=model))
        heights.append(result.record["hip_z"][-1])
    # Aside, the least torque needs one pull of the floor alone. A foot that sticks finds it by
    # giving way: the motor on its limit turns until the pull is there, 5 mm lower.
    assert heights[0] == pytest.approx(0.07 + LEG.foot_radius, abs=6e-3)
    assert heights[1] < heights[0] - 8e-3


# refusal


def test_refusal_says_where_and_what_it_takes() -> None:
    with pytest.raises(ConfigError) as caught:
        rollout.plan(scenario("scene=rail", *hold(0.0), "servo.limit=0.1"))
    needed = standing(0.0, 0.5, 1.0)
    assert str(caught.value) in {
        f"servo.limit cannot hold the leg at t = 0 s: motor {name} must give at least "
        f"{needed:.4g} N m there at rest, got a limit of 0.1 N m"
        for name in "AE"
    }
