"""MuJoCo against the oracle under load: the leg under a trunk on a slide, its foot on the floor.

The servo has `gains`, the trunk 0.5 kg; the squat is an ellipse without width. The oracle's floor
is rigid, MuJoCo's gives way: the foot sinks in until the contact carries, so the hip rides lower.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
import oracle
import oracle_stance
import validation_air as air
from oracle_stance import Stance
from validation_air import Key

from fivebar_sim import dynamics, kinematics, rollout
from fivebar_sim.arrays import Array
from fivebar_sim.control.servo import Servo
from fivebar_sim.geometry import FiveBar
from fivebar_sim.integrator import Integrator
from fivebar_sim.metrics import ground as floor
from fivebar_sim.paths import Ellipse, Line
from fivebar_sim.rollout import Plan, Result
from fivebar_sim.scenario.scenes import Air, Rail, Scene

HANGING = ("classic", "doggo", "extended", "minitaur", "q8bot")
TRUNK = 0.5  # [kg]
SQUAT = 1e-12
"""Width of the squat [m]: an ellipse's radii are above 0."""
DURATION = 1.25  # [s]: the ramp and two squats
ONCE = 0.75  # [s]: the ramp and one
FIRST = round(air.RAMP / air.TIMESTEPS[0])
GRID: Array = air.TIMESTEPS[0] * np.arange(1, round(DURATION / air.TIMESTEPS[0]) + 1.0)
HARD = (5e-4, 1.0), (0.95, 0.99, 0.001)
"""solref (time constant [s], damping ratio) and solimp of a contact harder than leg.xml's."""


class Error(NamedTuple):
    """How far a stance is from the oracle's after the ramp; of A and E the worse.

    Attributes:
        rms: Difference of the RMS torques, in parts of the oracle's.
        late: RMS difference of the torques at the same time, in parts of the oracle's RMS.
        force: RMS difference of N, in parts of the oracle's RMS.
        depth: Mean depth to which the foot sinks in [m].
        hip: RMS difference of hip_z, the depth taken off [m].
        foot_x: RMS difference of F_x [m].
        gap: Largest loop gap of the run [m].
    """

    rms: float
    late: float
    force: float
    depth: float
    hip: float
    foot_x: float
    gap: float


def gains(leg: FiveBar) -> Servo:
    """Return the servo that holds the trunk: classic's, scaled with the size as the torques are."""
    factor = leg.size / FiveBar.load("classic").size
    return Servo(kp=8.0 * factor, kd=0.05 * factor)


def squat(leg: FiveBar) -> Ellipse:
    """Return a squat from the rest pose on at 2 Hz; 16 mm deep in `classic`."""
    x, z = air.rest(leg)
    deep = 0.08 * leg.size
    frequency = 1.0 / air.PERIOD
    return Ellipse(centre=(x, z + deep), radii=(SQUAT, deep), frequency=frequency, ramp=air.RAMP)


def planned(key: Key, *, grips: bool = False, duration: float = DURATION) -> Plan:
    """Return the plan of a preset's squat, duration [s] long."""
    leg = FiveBar.load(key.preset)
    scene = Rail(mass=TRUNK, friction=1.0 if grips else 0.0)
    return rollout.plan(air.scenario(leg, squat(leg), gains(leg), key, scene, duration))


def harden(plan: Plan) -> Plan:
    """Make the contact of a plan hard; return the plan."""
    foot = plan.model.geom("foot")
    foot.solref[:], foot.solimp[:3] = HARD
    return plan


@cache
def truth(preset: str, feedforward: str, duration: float) -> Stance:
    """Return the oracle's squat of a preset on a floor without friction, duration [s] long."""
    return _truth(preset, feedforward, duration, grips=False, start=None)


def _truth(
    preset: str, feedforward: str, duration: float, *, grips: bool, start: complex | None
) -> Stance:
    leg = FiveBar.load(preset)
    ground = oracle_stance.Ground(TRUNK, leg.foot_radius, grips)
    law = air.servo_of(gains(leg), feedforward)
    path = air.path_of(squat(leg))
    times = GRID[: round(duration / air.TIMESTEPS[0])]
    return oracle_stance.simulate(
        *(oracle.Leg.of(leg), ground, law, path, times),
        start=start,
        rtol=air.RTOL,
        atol=0.1 * air.RTOL,
    )


def measure(
    key: Key, *, hard: bool = False, duration: float = DURATION, device: str | None = None
) -> Error:
    """Return the errors of a squat without friction, duration [s] long, on a device if named."""
    plan = planned(key, duration=duration)
    known = truth(key.preset, key.feedforward, duration)
    if hard:
        plan = harden(plan)
    (result,) = rollout.run_all([plan], device=device)
    return _compared(result, known)


class Grip(NamedTuple):
    """A stance with friction.

    Attributes:
        error: Against the oracle that rolls without slip, begun where MuJoCo's foot stood.
        side: RMS of the oracle's side force [N].
        side_off: RMS difference of the side forces [N].
        creep: How fast the foot creeps [m/s].
    """

    error: Error
    side: float
    side_off: float
    creep: float


def grip(key: Key, impratio: float) -> Grip:
    """Return how a stance with friction compares; impratio: how hard friction is in MuJoCo."""
    leg = FiveBar.load(key.preset)
    plan = planned(key, grips=True)
    plan.model.opt.impratio = impratio
    result = rollout.execute(plan)
    record = air.sampled(result, FIRST)
    rolled = _rolled(leg, record["foot_x"], record["theta_A"] + record["theta_B"])
    rate = np.polyfit(record["time"], rolled, 1)[0]

    # at the start the contact carries nothing yet and the foot slides: begin where it stood later
    x, z = air.rest(leg)
    wanted = float(rolled.mean())
    foot = complex(x, z)
    for _ in range(3):  # F_x moves the ball by nearly as much: three rounds are enough
        psi = oracle.pose(oracle.Leg.of(leg), foot)
        foot += wanted - float(_rolled(leg, np.array(foot.real), np.array(psi[1])))
    known = _truth(key.preset, key.feedforward, DURATION, grips=True, start=foot)
    side = known.ground[FIRST:, 0]
    off = float(air.rms(record["ground_x"] - side))
    return Grip(_compared(result, known), float(air.rms(side)), off, float(rate))


def _rolled(leg: FiveBar, foot_x: Array, psi_2: Array) -> Array:
    """Return F_x + r psi_2 [m]."""
    return foot_x + leg.foot_radius * psi_2


def _compared(result: Result, known: Stance) -> Error:
    record = air.sampled(result, FIRST)
    rows = slice(FIRST, None)
    tau = air.pair(record, "torque_A", "torque_E")
    scale = air.rms(known.tau[rows])
    N = known.ground[rows, 1]
    height = floor.height(result.scenario.leg, record)
    return Error(
        rms=air.worst(air.rms(tau) / scale - 1.0),
        late=air.worst(air.rms(tau - known.tau[rows]) / scale),
        force=float(air.rms(record["ground_z"] - N) / air.rms(N)),
        depth=float(-height.mean()),
        hip=float(air.rms(record["hip_z"] - height - known.hip_z[rows])),
        foot_x=float(air.rms(record["foot_x"] - known.foot[rows, 0])),
        gap=result.metrics["closure"]["max"],
    )


def static(preset: str, integrator: Integrator, aside: float) -> tuple[Array, Array, float]:
    """Return the torques of a leg at rest, those of dynamics.inverse, and N / weight.

    Args:
        preset: The leg.
        integrator: MuJoCo's, at 1 ms.
        aside: How far from the rest pose the foot stands, in parts of the leg's size.
    """
    leg = FiveBar.load(preset)
    x, z = air.rest(leg)
    at = (x + aside * leg.size, z)
    hold = Line(start=at, stop=at, frequency=1.0)
    record = rollout.run(_held(leg, hold, Rail(mass=TRUNK, friction=0.0), integrator, 1.5)).record
    end = {name: column[-1] for name, column in record.items()}
    theta = (end["theta_A"], end["theta_E"])
    still = (0.0, 0.0)
    force = (end["ground_x"], end["ground_z"])
    need = dynamics.inverse(leg, theta, still, still, force)
    weight = -(TRUNK + sum(link.mass for link in leg.links)) * leg.gravity[1]
    return np.array([end["torque_A"], end["torque_E"]]), need, float(force[1] / weight)


def _held(
    leg: FiveBar, path: Ellipse | Line, scene: Scene, integrator: Integrator, duration: float
) -> air.Scenario:
    key = Key("held", integrator, "none", 1e-3)
    return air.scenario(leg, path, gains(leg), key, scene, duration)


def gaps(integrator: Integrator) -> dict[str, float]:
    """Return classic's largest loop gap of a run at 1 ms [m]."""
    leg = FiveBar.load("classic")
    x, z = air.rest(leg)
    hold = Line(start=(x, z), stop=(x, z), frequency=1.0)
    runs: dict[str, tuple[Ellipse | Line, Scene]] = {
        "air, 2 Hz": (ellipse(2.0), Air()),
        "air, 5 Hz": (ellipse(5.0), Air()),
        "stance": (squat(leg), Rail(mass=TRUNK)),
        "landing from 5 cm": (hold, Rail(mass=TRUNK, drop=0.05)),
        "landing from 50 cm": (hold, Rail(mass=TRUNK, drop=0.5)),
    }
    return {
        name: rollout.run(_held(leg, path, scene, integrator, DURATION)).metrics["closure"]["max"]
        for name, (path, scene) in runs.items()
    }


def ellipse(frequency: float) -> Ellipse:
    """Return the path of the scenario classic-ellipse."""
    return Ellipse(centre=(0.0, -0.072), radii=(0.020, 0.008), frequency=frequency, ramp=air.RAMP)


def drop(preset: str, integrator: Integrator) -> Result:
    """Return a preset's landing from 50 cm at 1 ms."""
    leg = FiveBar.load(preset)
    at = kinematics.forward(leg, kinematics.home(leg)[::2]).tolist()
    hold = Line(start=(at[0], at[1]), stop=(at[0], at[1]), frequency=1.0)
    return rollout.run(_held(leg, hold, Rail(mass=TRUNK, drop=0.5), integrator, DURATION))
