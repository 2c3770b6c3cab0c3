"""What comes of a robot's gait when nobody knows friction, mass and delay exactly.

Run: .venv/bin/python scripts/robot_draws.py robot-q8bot-trot robot-q8bot-trot-fast [--count 64]

For each scenario a row: in how many draws the robot stays up, and the least, the middle and the
largest of its speed and turning rate, or of height and agility where it jumps. Then, one at a time,
how far each assumption moves them.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

import numpy as np

from fivebar_sim.errors import FiveBarError
from fivebar_sim.robots import LEGS
from fivebar_sim.robots.scenario import RobotScenario
from fivebar_sim.scenario import Scenario
from fivebar_sim.walking.draws import Outcome, draw, outcome, outcomes
from fivebar_sim.walking.plan import plan_scenario
from fivebar_sim.walking.walk import walk

SEED = 16
"""Of the draws of docs/robots.md."""

Q8BOT = {
    "friction 0.5": ["scene.friction=0.5"],
    "friction 1.2": ["scene.friction=1.2"],
    "mass - 10 %": ["robot.mass=0.198"],
    "mass + 10 %": ["robot.mass=0.242"],
    "delay 1 ms": ["robot.servo.delay=0.001"],
    "delay 3 ms": ["robot.servo.delay=0.003"],
    "trunk 40 mm wide": ["robot.trunk.size=[0.12, 0.04, 0.034]"],
    "centre 10 mm forward": ["robot.trunk.center=[0.01, 0.0, 0.006]"],
    "centre 10 mm back": ["robot.trunk.center=[-0.01, 0.0, 0.006]"],
    "centre 10 mm higher": ["robot.trunk.center=[0.0, 0.0, 0.016]"],
    "trunk inertia - 50 %": ["robot.trunk.inertia=[2.7e-5, 9.7e-5, 1.1e-4]"],
    "rotor - 30 %": ["robot.servo.armature=9.2e-5"],
    "rotor + 30 %": ["robot.servo.armature=1.7e-4"],
    "gear friction - 50 %": ["robot.servo.friction=0.00275"],
    "gear friction + 50 %": ["robot.servo.friction=0.00825"],
    "foot of 4 mm": ["robot.leg.foot_radius=0.004"],
}
"""What robots/q8bot.toml and servos/xl330.toml assume, moved one at a time over honest ranges."""

DOGGO = {
    "friction 0.5": ["scene.friction=0.5"],
    "friction 1.2": ["scene.friction=1.2"],
    "mass - 10 %": ["robot.mass=4.32"],
    "mass + 10 %": ["robot.mass=5.28"],
    "40 A": ["robot.servo.limit=3.36"],
    "bus 1 ms late": ["robot.servo.delay=0.001"],
    "rotor - 30 %": ["robot.servo.armature=2.8e-4"],
    "rotor + 30 %": ["robot.servo.armature=5.2e-4"],
    "belts rub by 0.1 N m": ["robot.servo.friction=0.1"],
    "centre 20 mm forward": ["robot.trunk.center=[0.02, 0.0, 0.0]"],
    "centre 20 mm higher": ["robot.trunk.center=[0.0, 0.0, 0.02]"],
    "trunk inertia - 50 %": ["robot.trunk.inertia=[6.0e-3, 0.034, 0.038]"],
    "foot of 6 mm": ["robot.leg.foot_radius=0.006"],
}
"""The same of robots/doggo.toml, and the other current limit that is published."""

ASSUMED = {"q8bot": Q8BOT, "doggo": DOGGO}
"""What is assumed, by robot."""

WALKS = ("body lengths/s", "turns [rad/s]")
JUMPS = ("jumps [m]", "agility [m/s]")
"""What is said of a robot that walks, and of one that jumps."""

SOFT = (0.0025, 0.001)
"""Time constants of a foot's contact beside the model's 5 ms [s]."""


def middle(values: Sequence[float], digits: int = 3) -> str:
    """Return the least, the middle and the largest of some numbers: "0.05 .. 0.07 .. 0.09"."""
    low, mid, high = np.quantile(values, [0.0, 0.5, 1.0])
    return " .. ".join(f"{each:.{digits}g}" for each in (low, mid, high))


def loaded(name: str, settings: Sequence[str] = ()) -> RobotScenario:
    """Return a robot's scenario with changes."""
    scenario = Scenario.load(name, settings)
    assert isinstance(scenario, RobotScenario)
    return scenario


def jumps(scenario: RobotScenario) -> bool:
    """Return whether a scenario is a jump: no gait, whose path would repeat."""
    return scenario.path.period is None


def told(found: Outcome, jumping: bool) -> tuple[float, float]:
    """Return the two numbers that are told of a run: see `WALKS` and `JUMPS`."""
    if not jumping:
        return found.moved.body_lengths_per_second, found.moved.turn_rate
    return (0.0, 0.0) if found.jump is None else (found.jump.height, found.jump.agility)


def summary(name: str, count: int, seed: int) -> str:
    """Return the row of a scenario in the table of draws."""
    scenario = loaded(name)
    found = outcomes(draw(scenario, count, seed))
    up = sum(each.moved.falls == 0 for each in found)
    leans = np.degrees([each.moved.lean for each in found])
    first, second = zip(*(told(each, jumps(scenario)) for each in found), strict=True)
    return (
        f"| {name} | {up} of {count} | {middle(first)} | {middle(second)} | "
        f"{middle(leans.tolist())} |"
    )


def assumed(name: str) -> list[str]:
    """Return the rows of the table of assumptions."""
    base = loaded(name)
    finer = [f"sim.timestep={0.5 * base.sim.timestep!r}"]
    every = {"as assumed": [], **ASSUMED[base.robot.name], "steps half as long": finer}
    rows = []

    for label, settings in every.items():
        try:
            (found,) = outcomes([loaded(name, settings)])
        except FiveBarError as error:
            rows.append(f"| {label} | {error} |")
            continue
        rows.append(_row(label, found, jumps(base)))
    for soft in SOFT:
        rows.append(_row(f"contact of {1e3 * soft:g} ms", harder(name, soft), jumps(base)))
    return rows


def _row(label: str, found: Outcome, jumping: bool) -> str:
    first, second = told(found, jumping)
    return f"| {label} | {first:.2f} | {second:.2f} | {found.moved.falls} |"


def harder(name: str, soft: float) -> Outcome:
    """Return what comes of contacts of another time constant [s], in steps of at most 0.5 ms."""
    step = min(loaded(name).sim.timestep, 0.0005)
    planned = plan_scenario(loaded(name, [f"sim.timestep={step!r}"]))
    for leg in LEGS:
        planned.model.geom(f"{leg}_foot").solref[0] = soft
    return outcome(walk(planned))


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("scenarios", nargs="+")
    parser.add_argument("--count", type=int, default=64)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--assumed", action="store_true", help="the other tables too")
    asked = parser.parse_args()

    columns = JUMPS if jumps(loaded(asked.scenarios[0])) else WALKS
    if asked.count:
        print(f"| scenario | stays up | {columns[0]} | {columns[1]} | leans up to [deg] |")
    for name in asked.scenarios if asked.count else ():
        print(summary(name, asked.count, asked.seed), flush=True)
    for name in asked.scenarios if asked.assumed else ():
        print(f"\n{name}\n\n| assumption | {columns[0]} | {columns[1]} | falls |")
        print("\n".join(assumed(name)), flush=True)


if __name__ == "__main__":
    main()
