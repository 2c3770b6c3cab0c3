"""Faults of paths, plans, controllers, the control step and the record; see tests/faults.py."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from faults import Fault, Put, a_step_late, around, around_property
from fivebar_controllers import gain_schedule
from fivebar_controllers.computed_torque import ComputedTorque
from fivebar_controllers.impedance import Impedance
from fivebar_controllers.pd import Pd
from fivebar_controllers.servo import Servo as Planned
from msgspec.structs import replace as other

from fivebar_sim import dynamics, kinematics, motion
from fivebar_sim.control.servo import Servo
from fivebar_sim.control.step import ControlStep
from fivebar_sim.metrics import ground, tracking
from fivebar_sim.paths import Ellipse, Gait, base, csv, shapes
from fivebar_sim.scenario import Scenario
from fivebar_sim.simulation import asked, record
from fivebar_sim.simulation import plan as planning

Right = Callable[..., Any]


def own(**values: Any) -> Callable[..., Any]:
    """Return a wrong method: the right one of an object whose keys have other values."""
    return lambda right, self, *args, **keys: right(other(self, **values), *args, **keys)


def seeing(**values: Any) -> Put:
    """Return what makes sensors better or worse than the scenario's."""

    def wrong(right: Right, self: Any, servo: Any, sensors: Any, *args: Any, **keys: Any) -> None:
        right(self, servo, other(sensors, **values), *args, **keys)

    return around(ControlStep, "__init__", wrong)


def seedless(right: Right, *args: Any, **keys: Any) -> None:
    right(*args, **{**keys, "seeds": [0 for _ in keys["seeds"]]})


def uncompensated(right: Right, self: Any, k: Any, command: Any) -> Any:
    sent = right(self, k, command)
    return sent - self._back_emf * self._theta_dot[:, -1:]


def times(factor: float) -> Right:
    """Return a wrong function: its answer is scaled."""
    return lambda right, *args: factor * right(*args)


def nothing_done(right: Right, owner: Any, values: Any, *args: Any, **keys: Any) -> Any:
    del right, owner, args, keys
    return values


def of_the_other(right: Right, self: Any, leg: Any, servo: Any, wanted: Any, used: str) -> Any:
    return right(self, leg, servo, wanted, "implicitfast" if used == "discrete" else "discrete")


def endless(right: Right, *args: Any) -> Any:
    return np.full_like(right(*args), np.inf)


def transposed(right: Right, *args: Any) -> Any:
    foot, jacobian = right(*args)
    return foot, np.swapaxes(jacobian, -1, -2)


def turned_over(right: Right, *args: Any) -> Any:
    found = right(*args)
    return found._replace(assembly=-found.assembly)


def summed(right: Right, values: Any) -> Any:
    return right(values) * len(values) ** 0.5


def from_the_start(window: slice, _: Any) -> slice:
    return slice(0, window.stop)


def weightless(right: Right, leg: Any, *args: Any, **keys: Any) -> Any:
    return right(replace(leg, gravity=(0.0, 0.0)), *args, **keys)


def unloaded(right: Right, *args: Any, **keys: Any) -> Any:
    return right(*args, **{**keys, "payload": 0.0})


def frictionless(right: Right, *args: Any, **keys: Any) -> Any:
    return right(*args, **{**keys, "friction": 0.0})


def slow(right: Right, leg: Any, theta: Any, rate: Any, *args: Any, **keys: Any) -> Any:
    return right(leg, theta, np.zeros_like(np.asarray(rate)), *args, **keys)


def unexpected(right: Right, *args: Any) -> Any:
    wanted = right(*args)
    return wanted._replace(force=0.0 * wanted.force)


def mirrored(right: Right, leg: Any, *foot: Any) -> Any:
    return right(replace(leg, mode=(leg.mode[1], leg.mode[0])), *foot)


def wrong_knee(right: Right, *args: Any) -> Any:
    q = right(*args)
    return q * np.array([1.0, -1.0, 1.0, 1.0])


def raw_torque(right: Right, servo: Any, step: Any) -> Any:
    """Return what MuJoCo's actuator sensor shows: the spring at the start of the step."""
    del right
    return servo.kp * (step.ctrl - step.q)


def columns(change: Callable[[dict[str, Any]], dict[str, Any]]) -> Put:
    """Return what changes the record of every run."""

    def wrong(right: Right, *args: Any, **keys: Any) -> Any:
        found = right(*args, **keys)
        return found | change(found)

    return around(record, "columns", wrong)


def target_a_step_late(found: dict[str, Any]) -> dict[str, Any]:
    return {k: np.roll(found[k], 1) for k in ("target_x", "target_z")}


def motors_exchanged(found: dict[str, Any]) -> dict[str, Any]:
    return {"torque_A": found["torque_E"], "torque_E": found["torque_A"]}


def without_rolling(right: Right, leg: Any, found: Any) -> Any:
    return right(replace(leg, foot_radius=0.1 * leg.foot_radius), found)


def hundredths(right: Right, *args: Any) -> Any:
    track = right(*args)
    return track._replace(pair=1.01 * track.pair)


def at_once(right: Right, time: Any, ramp: float) -> Any:
    del right, ramp
    return time, np.ones_like(time), np.zeros_like(time)


def a_quarter_on(right: Right, self: Any, time: Any) -> Any:
    return right(self, np.asarray(time) + 0.25 / self.frequency)


def backwards(right: Right, centre: Any, radii: Any, w: float, time: Any) -> Any:
    return right(centre, (-radii[0], radii[1]), w, time)


ELLIPSE = "classic-ellipse"
LOAD = "payload-ellipse"
SENSORS = "classic-pd-sensors"
CIRCLE = "hobby-servo-circle"
XL330 = "q8bot-xl330"
FORCE = "extended-stance-force"
LANDING = "doggo-landing"

PATHS = (
    Fault("ramp left out", ELLIPSE, around(base, "ease", at_once)),
    Fault("gait a quarter of a period on", "treadmill-trot", around(Gait, "nominal", a_quarter_on)),
    Fault("path run backwards", CIRCLE, around(shapes, "_orbit", backwards)),
    Fault("path 1 % fast", ELLIPSE, around_property(Ellipse, "omega", lambda w, _: 1.01 * w)),
    Fault("CSV read 1 % large", "q8bot-trot", around(csv, "read_track", hundredths)),
    Fault(
        "measured from the start on", ELLIPSE, around_property(Scenario, "window", from_the_start)
    ),
)
PLANS = (
    Fault("knees on the wrong side", ELLIPSE, around(kinematics, "joint_motion", mirrored)),
    Fault("sign of theta_B", ELLIPSE, around(motion, "_continuous", wrong_knee)),
    Fault(
        "velocity feedforward left out",
        "classic-figure-eight",
        around(Planned, "setpoints", own(feedforward="none")),
    ),
    Fault(
        "feedforward of the back-EMF left out",
        XL330,
        around_property(Servo, "damping", lambda _, servo: servo.kd),
    ),
    Fault("setpoints of the other integrator", ELLIPSE, around(Planned, "setpoints", of_the_other)),
    Fault("torque feedforward a step late", LOAD, around(dynamics, "step_torques", a_step_late)),
    Fault("torque feedforward without weight", LOAD, around(dynamics, "step_torques", weightless)),
    Fault("torque feedforward without payload", LOAD, around(dynamics, "step_torques", unloaded)),
    Fault(
        "torque feedforward without friction",
        CIRCLE,
        around(dynamics, "step_torques", frictionless),
    ),
    Fault(
        "loop taken for closed under implicitfast",
        "extended-figure-eight",
        around(dynamics, "soft_loop", nothing_done),
    ),
)
CONTROLLERS = (
    Fault("gains of pd 2 % high", SENSORS, around(Pd, "command", times(1.02))),
    Fault(
        "pd's derivative of the wrong thing",
        SENSORS,
        around(Pd, "command", own(derivative="measurement")),
    ),
    Fault(
        "gain schedule always far",
        "airhockey-gain-schedule",
        around(gain_schedule, "distance", endless),
    ),
    Fault(
        "computed torque without velocity terms",
        "doggo-fast-ellipse",
        around(dynamics, "inverse", slow),
    ),
    Fault(
        "computed torque 5 % light",
        "doggo-fast-ellipse",
        around(ComputedTorque, "command", own(mass_error=-0.05)),
    ),
    Fault(
        "impedance 10 % stiff", FORCE, around(Impedance, "command", own(stiffness=(220.0, 220.0)))
    ),
    Fault(
        "impedance's Jacobian turned over",
        FORCE,
        around(kinematics, "foot_and_jacobian", transposed),
    ),
    Fault(
        "payload unknown to the controller",
        "extended-gravity-hold",
        around(dynamics, "inverse", unloaded),
    ),
    Fault("expected force forgotten", LANDING, around(asked, "_references", unexpected)),
)
STEP = (
    Fault("delay of the servo ignored", XL330, around(Servo, "latched", own(delay=0.0))),
    Fault("rate of the bus ignored", XL330, around(Servo, "latched", own(rate=None))),
    Fault("steps of the servo ignored", CIRCLE, around(Servo, "rounded", nothing_done)),
    Fault("delay of the sensors ignored", SENSORS, seeing(delay=0.0)),
    Fault("noise of the angles ignored", SENSORS, seeing(noise=0.0)),
    Fault("noise of the rates ignored", SENSORS, seeing(rate_noise=0.0)),
    Fault("steps of the sensors ignored", SENSORS, seeing(resolution=0.0)),
    Fault("seed ignored", SENSORS, around(ControlStep, "__init__", seedless)),
    Fault("back-EMF not made up for", SENSORS, around(ControlStep, "send", uncompensated)),
    Fault("control period twice as long", LANDING, around(planning, "whole_steps", times(2))),
)
RECORD = (
    Fault("torque of the start of the step", ELLIPSE, around(record, "applied_torque", raw_torque)),
    Fault("torques exchanged", "rail-landing", columns(motors_exchanged)),
    Fault("error against a late target", "classic-figure-eight", columns(target_a_step_late)),
    Fault("gap 1 % large", ELLIPSE, columns(lambda found: {"gap": 1.01 * found["gap"]})),
    Fault("saturation not seen", "airhockey-pd", around(record, "clipped", times(0))),
    Fault("slip without rolling", "treadmill-trot", around(ground, "slid", without_rolling)),
    Fault(
        "the mirrored assembly taken for right", ELLIPSE, around(kinematics, "branch", turned_over)
    ),
    Fault("errors summed and not averaged", ELLIPSE, around(tracking, "root_mean_square", summed)),
)
PROGRAM = (*PATHS, *PLANS, *CONTROLLERS, *STEP, *RECORD)
