"""Random scenarios of every kind, and what of a run changes when its timestep is a quarter."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from fivebar_sim import rollout, workspace
from fivebar_sim.errors import FiveBarError
from fivebar_sim.metrics import guards
from fivebar_sim.metrics.catalogue import ABSOLUTE
from fivebar_sim.metrics.limits import look_up
from fivebar_sim.rollout import Result
from fivebar_sim.scenario import Scenario
from fivebar_sim.scenario.refined import refined

PLANNED = {
    "classic-ellipse": 1.0,
    "classic-figure-eight": 1.25,
    "classic-edge-line": 2.25,
    "extended-figure-eight": 0.75,
    "payload-ellipse": 0.75,
    "q8bot-trot": 0.75,
    "q8bot-xl330": 0.75,
    "hobby-servo-circle": 2.25,
    "minitaur-trot": 0.75,
    "rail-landing": 0.8,
    "rail-hop": 0.75,
    "q8bot-squat": 2.5,
    "treadmill-trot": 0.8,
    "minitaur-treadmill": 0.8,
}
"""Shipped scenarios for position servos, and how long each is run [s]: a period at least."""

ASKED = {
    "classic-ellipse": 1.0,
    "payload-ellipse": 0.75,
    "q8bot-trot": 0.75,
    "minitaur-trot": 0.75,
    "rail-landing": 0.8,
    "rail-hop": 0.75,
    "treadmill-trot": 0.8,
}
"""The same for feedback controllers."""

NATURAL = {"classic": 2e-5, "extended": 2e-5, "q8bot": 1e-5, "minitaur": 8e-5, "doggo": 1e-4}
"""About the lesser inertia that a motor feels [kg m^2]: it makes gains of all legs alike."""

KEYS = (
    *("tracking.rms", "tracking.max"),
    *(f"load.{name}.{motor}" for name in ("torque_rms", "torque_peak") for motor in "AE"),
    *(f"whole.torque_peak.{motor}" for motor in "AE"),
    "load.share_A",
)
"""What must not depend on the timestep."""

BAR = 0.05
"""Largest part by which it may."""

NEAR = 1e-3
"""Part of the leg's size by which tracking may differ: fed forward, it is all the step's error."""


def case(seed: int) -> tuple[str, list[str]]:
    """Return the name of a shipped scenario, and random settings of one of two kinds."""
    rng = np.random.default_rng(seed)
    asked = rng.random() < 0.4
    bases = ASKED if asked else PLANNED
    name = str(rng.choice(list(bases)))
    scenario = Scenario.load(name)

    def near(value: float, factor: float) -> float:
        return float(value * factor ** rng.uniform(-1.0, 1.0))

    h = float(rng.choice([0.0005, 0.001, 0.002]))
    sets = [
        "limits={}",
        "converge={}",
        "guards.heat=1e9",
        f"duration={bases[name]}",
        f"leg.L2={near(scenario.leg.L2, 1.05)}",
        f"leg.armature={near(max(scenario.leg.armature, 1e-6), 2.0)}",
        f"sim.timestep={h}",
    ]
    if rng.random() < 0.2:
        sets.append("sim.integrator=implicitfast")
    if asked:
        natural = NATURAL[scenario.leg.name] if scenario.leg.name in NATURAL else 2e-5
        sets += _asked(rng, near, natural, h)
    else:
        sets += _planned(rng, near, scenario, h)
    if rng.random() < 0.15 and scenario.leg.L6 == 0.0:
        sets += _too_short(scenario)
    return name, sets


def _too_short(scenario: Scenario) -> list[str]:
    """Return settings of a leg that is so short that it follows the edge of what it reaches."""
    leg = scenario.leg
    foot = scenario.foot_path
    shrunk = {}
    for factor in np.arange(0.98, 0.6, -0.02):
        shrunk = {link: float(factor) * getattr(leg, link) for link in ("L1", "L2", "L3", "L4")}
        if not workspace.reachable(dataclasses.replace(leg, **shrunk), foot).all():
            break
    return ["path.outside=nearest", *(f"leg.{link}={length}" for link, length in shrunk.items())]


def _planned(
    rng: np.random.Generator, near: Callable[[float, float], float], scenario: Scenario, h: float
) -> list[str]:
    """Return settings of a position servo, its bus and its path."""
    servo = scenario.servo
    sets = [
        f"servo.kp={near(servo.kp, 4.0)}",
        f"servo.kd={near(max(servo.kd, 0.01), 4.0)}",
        f"controller.feedforward={rng.choice(['none', 'velocity', 'torque'])}",
    ]
    if rng.random() < 0.2:
        sets.append(f"servo.rate={1.0 / (h * float(rng.choice([2, 5, 10, 20])))}")
    if rng.random() < 0.2:
        sets.append(f"servo.resolution={float(rng.choice([2, 10, 40])) * np.pi / 4096}")
    if rng.random() < 0.2:
        sets.append(f"servo.delay={h * float(rng.choice([1, 2.5, 5]))}")
    if rng.random() < 0.2:
        sets.append(f"servo.friction={near(0.002, 4.0)}")
    if rng.random() < 0.2:
        sets.append(f"servo.limit={near(0.5, 4.0)}")
    if rng.random() < 0.2 and scenario.path.ramp > 0.0:
        sets.append("path.ramp=0.0")
    return sets


def _asked(
    rng: np.random.Generator, near: Callable[[float, float], float], m: float, h: float
) -> list[str]:
    """Return a feedback controller whose gains may be too high for its period."""
    T = h * float(rng.choice([1, 1, 2]))
    # Of the undamped oscillation, from soft to what a held torque just stands.
    kp = near(0.03, 20.0) / T**2
    kd = float(rng.uniform(0.0, 1.5)) * np.sqrt(kp)
    kind = str(rng.choice(["pd", "computed_torque", "impedance"]))
    if kind == "pd":
        law = f"kp={kp * m},kd={kd * m},derivative='{rng.choice(['measurement', 'error'])}'"
    elif kind == "computed_torque":
        law = f"kp={kp},kd={kd}"
    else:
        # The foot of all these legs feels like some ten grams.
        law = "stiffness=[{0},{0}],damping=[{1},{1}]".format(0.013 * kp, 0.013 * kd)
    sets = [f"controller={{name='{kind}',{law},period={T}}}"]
    if rng.random() < 0.2:
        sets.append(f"sensors.delay={h * float(rng.choice([1, 2]))}")
    if rng.random() < 0.2:
        sets.append(f"servo.limit={near(0.5, 4.0)}")
    return sets


class Outcome(NamedTuple):
    """A run and its like at a quarter of the timestep.

    Attributes:
        said: What the first run itself says against its numbers: guards and remarks.
        failed: Why the finer run fails; "" where it passes.
        off: Metrics that differ by more than `BAR`, each with the part.
    """

    said: list[str]
    failed: str
    off: dict[str, float]


def ran(name: str, sets: list[str]) -> Result | None:
    """Return a random scenario's run; None where it is refused, or breaks down."""
    try:
        return rollout.run(Scenario.load(name, sets))
    except FiveBarError:
        return None


def outcome(coarse: Result) -> Outcome:
    """Return how a run differs from its like at a quarter of the timestep."""
    said = [*guards.tripped(coarse.measured.guards), *coarse.remarks]
    try:
        fine = rollout.run(refined(coarse.scenario, 4, coarse.scenario.sim.integrator))
    except FiveBarError as error:
        return Outcome(said, str(error), {})
    failed = "; ".join(guards.tripped(fine.measured.guards))
    return Outcome(said, failed, differences(coarse, fine))


def differences(coarse: Result, fine: Result) -> dict[str, float]:
    """Return the metrics that differ by more than `BAR` and their baseline's tolerance."""
    off = {}
    for key in KEYS:
        was = look_up(coarse.metrics, key)
        now = look_up(fine.metrics, key)
        if was is None or now is None:
            continue
        small = NEAR * coarse.scenario.leg.size if "tracking" in key else ABSOLUTE[key]
        if abs(was - now) > max(BAR * abs(now), small):
            off[key] = abs(was - now) / abs(now)
    return off
