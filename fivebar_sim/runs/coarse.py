"""Warnings that a run's numbers owe something to its timestep, where no guard fails it for that."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fivebar_sim import motion
from fivebar_sim.arrays import Array
from fivebar_sim.control import Feedback
from fivebar_sim.metrics import tracking
from fivebar_sim.metrics.columns import MOTORS, motors
from fivebar_sim.metrics.guards import Guard
from fivebar_sim.scenario import Scenario
from fivebar_sim.scenario.scenes import Ground
from fivebar_sim.simulation import sampling

JOLTED = 0.05
"""Part of the largest torque that may last a single step before peaks are off by more than that."""

SPRUNG = 0.15
"""Part of the servos' damping that `discrete` may add to it."""

DAMPED = 0.5
"""The same of a feedback controller: what it holds for long is less sensitive to it."""

OPENED = 0.5
"""Part of the tracking error that the loop's gap may be."""

NOTHING = 1e-3
"""Part of the leg's size that no gap is worth a word below."""

FIRST = 10
"""Steps in which a run starts: what is held, and perhaps moves, sets in at once."""

CHECK = "`fivebar converge` tells by how much"


def warnings(scenario: Scenario, record: Mapping[str, Array], guards: list[Guard]) -> list[str]:
    """Return what a run's numbers owe to its timestep, for people; often nothing.

    A scenario with a table [converge] has been checked, and says so itself.

    Args:
        scenario: The scenario that was run.
        record: The columns of rollout.parquet.
        guards: The guards of the run: one that tripped says it already.
    """
    if scenario.converge:
        return []
    found = (
        _jolted(guards),
        _started(scenario, record),
        _opened(scenario, record),
        _sprung(scenario),
        _damped(scenario, record, guards),
    )
    return [each for each in found if each is not None]


def _jolted(guards: list[Guard]) -> str | None:
    """Return the warning that torques last a single step."""
    jolts = next((guard for guard in guards if guard.name == "jolts"), None)
    if jolts is None or not jolts.ok or not (jolts.value or 0.0) > JOLTED:
        return None
    part = 100.0 * (jolts.value or 0.0)
    return (
        f"torque peaks depend on the timestep: {part:.3g} % of the largest lasted one step; {CHECK}"
    )


def _started(scenario: Scenario, record: Mapping[str, Array]) -> str | None:
    """Return the warning that the largest torque is that of the start."""
    # A feedback controller holds each torque for a period: it has no step of its own.
    if isinstance(scenario.controller, Feedback):
        return None
    at = np.abs(motors(record, "torque")).argmax(axis=0)
    if not (at < FIRST).any():
        return None
    motor = MOTORS[int(at.argmin())]
    return (
        f"the largest torque of {motor} is that of the first {FIRST} steps, in which the run "
        f"starts: it depends on the timestep; {CHECK}"
    )


def _opened(scenario: Scenario, record: Mapping[str, Array]) -> str | None:
    """Return the warning that tracking is no better than the loop's gap."""
    window = scenario.window
    gap = tracking.gap_rms(scenario.leg, record, window)
    error = tracking.rms(scenario.leg, record, window)
    if not gap > max(OPENED * error, NOTHING * scenario.leg.size):
        return None
    return (
        f"tracking depends on the timestep: the loop is open by {1e3 * gap:.3g} mm, of an error "
        f"of {1e3 * error:.3g} mm; {CHECK}"
    )


def _sprung(scenario: Scenario) -> str | None:
    """Return the warning that the step damps the servos' springs, which jerks and contacts load.

    Under `discrete` a spring acts with the angle that a step ends in: as if kd were kp h larger.
    """
    sim = scenario.sim
    servo = scenario.servo
    if isinstance(scenario.controller, Feedback) or sim.integrator != "discrete":
        return None

    added = servo.kp * sim.timestep
    jerked = isinstance(scenario.scene, Ground) or scenario.path.ramp == 0.0
    if not jerked or not added > SPRUNG * servo.damping:
        return None
    return (
        f"torques of jerks depend on the timestep: kp h = {added:.3g} N m s/rad adds to the "
        f"servos' damping of {servo.damping:.3g} N m s/rad; {CHECK}"
    )


def _damped(scenario: Scenario, record: Mapping[str, Array], guards: list[Guard]) -> str | None:
    """Return the warning that the step damps the motion under a feedback controller."""
    if not all(guard.ok for guard in guards if guard.name == "feedback"):
        return None
    if not isinstance(scenario.controller, Feedback):
        return None
    h = scenario.sim.timestep
    force = scenario.foot_force
    wanted = motion.plan(
        scenario.leg, scenario.path, scenario.steps, h, force=force, payload=scenario.payload
    )
    theta = motors(record, "theta")
    # On the ground too: the leg's own inertia is what a light damper has to stop there.
    free = np.zeros(scenario.steps, dtype=bool)
    found = sampling.stability(scenario, wanted, theta, motors(record, "theta_dot"), free)
    if found is None:
        return None

    settles = found.shown < 0.0
    if not settles.any():
        return None
    real = float(np.median(found.real[settles]))
    shown = float(np.median(found.shown[settles]))
    if not -shown > (1.0 + DAMPED) * max(-real, 0.0):
        return None
    really = "die out" if real < 0.0 else "grow"
    return (
        f"the timestep damps the feedback: errors die out at {-shown:.3g}/s, with shorter ones "
        f"they {really} at {abs(real):.3g}/s; {CHECK}"
    )
