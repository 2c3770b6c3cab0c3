"""./.venv/bin/python scripts/antagonism.py: the price of motors that oppose each other.

The classic leg and the serial leg with its L1 and L2, knee back, motor in the knee: the same foot
path, foot force, motors and gears. Prints the table of docs/load.md.
"""

from __future__ import annotations

import math

import numpy as np

from fivebar_sim import dynamics, kinematics
from fivebar_sim.arrays import Array
from fivebar_sim.dynamics.antagonism import serial_leg
from fivebar_sim.geometry import FiveBar
from fivebar_sim.paths import Gait

CLASSIC = FiveBar.load("classic")
SERIAL = serial_leg(CLASSIC)
STEPS = 2000
PUSH = 10.0  # [N], largest vertical force of the ground
LEANS = {"level": 0.0, "uphill": 0.2, "downhill": -0.2}  # horizontal by vertical force
SPEEDS = (2.0, 5.0)  # [Hz]

# The XL330's motor: docs/servos.md. Friction as identified on the XL330-M288 (Rhoban/bam, m6).
RATIO = 288.4
KT = 0.215 / 1.47 / 77.5  # [N m/A] at the rotor
R = 5.0 / 1.47  # [ohm]
BASE = 0.00477 / RATIO  # [N m] at the rotor
LOST = 0.2668  # of the torque
RATIOS = (77.5, 150.0, RATIO)


def lost(ratio: float) -> float:
    """Return the part of its torque that a gear loses: every factor of the ratio loses alike."""
    return 1.0 - (1.0 - LOST) ** (math.log(ratio) / math.log(RATIO))


def stance(frequency: float, lean: float) -> tuple[Array, Array, Array]:
    """Return foot [m], its rate [m/s] and the force on it [N] in a stance, (n, 2) each."""
    path = Gait(
        centre=(0.0, -0.080), stride=0.040, lift=0.015, frequency=frequency, duty=0.5, ramp=0.0
    )
    time = (np.arange(STEPS) + 0.5) / (STEPS * frequency)
    foot, foot_dot, _ = path.at(time)
    stands = path.in_stance(time)
    z = PUSH * np.sin(np.pi * path.cycle(time) / path.duty)
    force = np.stack([lean * z, z], axis=-1)
    return foot[stands], foot_dot[stands], force[stands]


def losses(torque: Array, omega: Array, ratio: float, step: float) -> tuple[float, float]:
    """Return copper heat and gear friction of a stance [mJ]; torques and rates of the output."""
    heat = R * np.sum((torque / (ratio * KT)) ** 2)
    friction = np.sum((ratio * BASE + lost(ratio) * np.abs(torque)) * np.abs(omega))
    return 1e3 * step * float(heat), 1e3 * step * float(friction)


def rates(J: Array, foot_dot: Array) -> Array:
    """Return the motors' rates [rad/s], (n, 2)."""
    return np.asarray(np.linalg.solve(J, foot_dot[..., None])[..., 0], dtype=np.float64)


def against(torque: Array, omega: Array) -> float:
    """Return which part of the work that a motor gives goes into the other."""
    power = torque * omega
    opposed = np.prod(power, axis=1) < 0.0
    passed = np.abs(power[opposed]).min(axis=1).sum()
    return float(passed / np.maximum(power, 0.0).sum())


def main() -> None:
    """Print a row for every gait and gear ratio."""
    print("Of one stance       against      heat [mJ]        gear friction [mJ]   all losses")
    print("         Hz  ratio    [%]    5-bar serial  price   5-bar serial  price    price")
    for name, lean in LEANS.items():
        for frequency in SPEEDS:
            foot, foot_dot, force = stance(frequency, lean)
            theta = kinematics.inverse(CLASSIC, foot)
            q = SERIAL.inverse(foot)
            own = dynamics.statics(CLASSIC, theta, force)
            motors = (
                (own, rates(kinematics.jacobian(CLASSIC, theta), foot_dot)),
                (SERIAL.static_torques(q, force), rates(SERIAL.jacobian(q), foot_dot)),
            )
            part = 100.0 * against(*motors[0])
            for ratio in RATIOS:
                step = 1.0 / (STEPS * frequency)
                (h, f), (h_s, f_s) = (losses(tau, w, ratio, step) for tau, w in motors)
                print(
                    f"{name:9}{frequency:2.0f}{ratio:7.1f}{part:7.1f}{h:9.1f}{h_s:7.1f}"
                    f"{h / h_s:6.2f} x{f:7.1f}{f_s:7.1f}{f / f_s:6.2f} x"
                    f"{(h + f) / (h_s + f_s):8.2f} x"
                )


if __name__ == "__main__":
    main()
