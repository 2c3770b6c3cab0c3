"""Short runs, simulated once for all tests of a process, and the logs that robots kept of them."""

from __future__ import annotations

import functools

from fivebar_sim import Scenario, run
from fivebar_sim.logs import Log
from fivebar_sim.overlay import measured
from fivebar_sim.rollout import Result

SENSORS = ("sensors.noise=0.001", "sensors.rate_noise=0.01", "sensors.resolution=0.0015339808")
SERVO = ("servo.rate=200", "servo.delay=0.002", "servo.kt=0.5", "servo.resistance=3.0")
SHORT = ("duration=1.2", "path.ramp=0.25", "limits={}")


@functools.cache
def ran(*settings: str) -> Result:
    return run(Scenario.load("classic-ellipse", [*SHORT, *SERVO, *settings]))


def log_of(result: Result, *sensors: str) -> Log:
    """Return the log of a run with other sensors, which only see it."""
    seen = Scenario.load("classic-ellipse", [*SHORT, *SERVO, *sensors])
    return measured.log_of(seen, result.record)
