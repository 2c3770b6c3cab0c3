"""What comes of a robot's gait when nobody knows friction, mass and delay exactly.

Run: .venv/bin/python scripts/robot_draws.py robot-q8bot-trot robot-q8bot-trot-fast [--count 64]

For each scenario a row: in how many draws the robot stays up, and the least, the middle and the
largest of its speed and turning rate. Then, one at a time, how far each assumption moves them.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

import numpy as np

from fivebar_sim.errors import FiveBarError
from fivebar_sim.robots import LEGS
from fivebar_sim.robots.measure import Gone, measure
from fivebar_sim.robots.scenario import RobotScenario
from fivebar_sim.scenario import Scenario
from fivebar_sim.walking.draws import Outcome, draw, outcomes
from fivebar_sim.walking.plan import plan_scenario
from fivebar_sim.walking.walk import walk

SEED = 16
"""Of the draws of docs/robots.md."""

ASSUMED = {
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
    "steps of 0.5 ms": ["sim.timestep=0.0005"],
}
"""What robots/q8bot.toml and servos/xl330.toml assume, moved one at a time over honest ranges."""

SOFT = (0.0025, 0.001)
"""Time constants of a foot's contact beside the model's 5 ms [s]; in steps of 0.5 ms."""


def middle(values: Sequence[float], digits: int = 3) -> str:
    """Return the least, the middle and the largest of some numbers: "0.05 .. 0.07 .. 0.09"."""
    low, mid, high = np.quantile(values, [0.0, 0.5, 1.0])
    return " .. ".join(f"{each:.{digits}g}" for each in (low, mid, high))


def summary(name: str, found: Sequence[Outcome]) -> str:
    """Return a row of the table of draws."""
    up = sum(each.moved.falls == 0 for each in found)
    lengths = [each.moved.body_lengths_per_second for each in found]
    turns = [each.moved.turn_rate for each in found]
    leans = np.degrees([each.moved.lean for each in found])
    return (
        f"| {name} | {up} of {len(found)} | {middle(lengths)} | {middle(turns)} | "
        f"{middle(leans.tolist())} |"
    )


def assumed(name: str) -> list[str]:
    """Return the rows of the table of assumptions."""
    rows = []
    for label, settings in {"as assumed": [], **ASSUMED}.items():
        try:
            scenario = Scenario.load(name, settings)
            assert isinstance(scenario, RobotScenario)
            (found,) = outcomes([scenario])
        except FiveBarError as error:
            rows.append(f"| {label} | {error} |")
            continue
        rows.append(_row(label, found.moved))
    return [*rows, *(_row(f"contact of {1e3 * soft:g} ms", harder(name, soft)) for soft in SOFT)]


def _row(label: str, moved: Gone) -> str:
    return (
        f"| {label} | {moved.body_lengths_per_second:.2f} | {moved.turn_rate:.2f} | {moved.falls} |"
    )


def harder(name: str, soft: float) -> Gone:
    """Return how a robot moves on contacts of another time constant [s], in steps of 0.5 ms."""
    scenario = Scenario.load(name, ["sim.timestep=0.0005"])
    assert isinstance(scenario, RobotScenario)
    planned = plan_scenario(scenario)
    for leg in LEGS:
        planned.model.geom(f"{leg}_foot").solref[0] = soft
    went = walk(planned)
    assert went.trunk is not None
    return measure(went.trunk, planned.window, planned.robot.length, len(went.falls))


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("scenarios", nargs="+")
    parser.add_argument("--count", type=int, default=64)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--assumed", action="store_true", help="the other tables too")
    asked = parser.parse_args()

    if asked.count:
        print("| scenario | stays up | body lengths/s | turns [rad/s] | leans up to [deg] |")
    for name in asked.scenarios if asked.count else ():
        scenario = Scenario.load(name)
        assert isinstance(scenario, RobotScenario)
        print(summary(name, outcomes(draw(scenario, asked.count, asked.seed))), flush=True)
    for name in asked.scenarios if asked.assumed else ():
        print(f"\n{name}\n\n| assumption | body lengths/s | turns [rad/s] | falls |")
        print("\n".join(assumed(name)), flush=True)


if __name__ == "__main__":
    main()
