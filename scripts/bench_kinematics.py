""".venv/bin/python scripts/bench_kinematics.py  # inverse kinematics: one array against a loop.

Solves 10^6 random reachable points of the classic leg, once as an array with `kinematics.inverse`
and once in a loop that calls the same formula, written with `math`, for each point. Prints the
time a point takes in each and their ratio, medians of several runs in turn. (A loop with all that
depends on the leg only taken out of it by hand takes half as long.)
"""

from __future__ import annotations

import argparse
import math
from statistics import median
from time import perf_counter

import numpy as np

from fivebar_sim import kinematics, workspace
from fivebar_sim.arrays import Array
from fivebar_sim.errors import UnreachableError
from fivebar_sim.geometry import FiveBar


def random_points(leg: FiveBar, count: int) -> Array:
    """Return random reachable points of a leg with L6 = 0 [m], (count, 2)."""
    size = leg.size + 0.5 * leg.L5
    points = np.random.default_rng(0).uniform(-size, size, (8 * count, 2))
    return points[workspace.reachable(leg, points)][:count]


def side_angle(x: float, z: float, near: float, far: float, s: int) -> float:
    """Return one motor angle [rad], as `kinematics.reach.side_angle` does for arrays."""
    d2 = x * x + z * z
    low = (near - far) ** 2
    high = (near + far) ** 2
    slack = 16 * 2.0**-52 * high
    if not low - slack <= d2 <= high + slack:
        raise UnreachableError(f"the point is out of reach: {math.sqrt(d2):g} m from the motor")
    N = d2 + (near - far) * (near + far)
    S = s * math.sqrt(max((high - d2) * (d2 - low), 0.0))
    return math.atan2(z * N + S * x + 0.0, x * N - S * z)


def inverse(leg: FiveBar, x: float, z: float) -> tuple[float, float]:
    """Return (theta_A, theta_E) [rad] of one point of a leg with L6 = 0."""
    x_E = 0.5 * leg.L5 * math.cos(leg.tilt)
    z_E = 0.5 * leg.L5 * math.sin(leg.tilt)
    s_A, s_E = leg.mode
    theta_A = side_angle(x + x_E, z + z_E, leg.L1, leg.L2, s_A)
    theta_E = side_angle(x - x_E, z - z_E, leg.L4, leg.L3, s_E)
    return theta_A, theta_E


def inverse_loop(leg: FiveBar, points: list[list[float]]) -> list[tuple[float, float]]:
    """Return the motor angles of points, one after the other."""
    return [inverse(leg, x, z) for x, z in points]


def seconds_per_point(leg: FiveBar, array: Array, looped: list[list[float]]) -> tuple[float, float]:
    """Return the times per point [s] of one run each: of the array, of the loop."""
    start = perf_counter()
    kinematics.inverse(leg, array)
    middle = perf_counter()
    inverse_loop(leg, looped)
    return (middle - start) / len(array), (perf_counter() - middle) / len(looped)


def main() -> None:
    """Print the two times and their ratio."""
    parser = argparse.ArgumentParser(description="Time inverse kinematics against a plain loop.")
    parser.add_argument("--points", type=int, default=1_000_000, help="default: 10^6")
    parser.add_argument("--runs", type=int, default=5, help="default: 5")
    args = parser.parse_args()

    leg = FiveBar.load("classic")
    array = random_points(leg, args.points)
    looped = array.tolist()
    runs = [seconds_per_point(leg, array, looped) for _ in range(args.runs)]
    fast, slow = (1e9 * median(times) for times in zip(*runs, strict=True))
    ratio = median(loop / batch for batch, loop in runs)
    print(f"kinematics.inverse {fast:7.1f} ns a point")
    print(f"math loop          {slow:7.1f} ns a point")
    print(f"ratio              {ratio:7.1f} (median of {args.runs} runs, {args.points} points)")


if __name__ == "__main__":
    main()
