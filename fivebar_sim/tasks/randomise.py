"""Legs that differ: lengths, masses, friction, servo gains and delay drawn from ranges."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np

from fivebar_sim.checks import check_number
from fivebar_sim.errors import ArgumentError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.tasks.base import Grounded, Task

Range = tuple[float, float]


class Randomise(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Ranges (low, high) from which a leg's numbers are drawn evenly; all but delay are factors.

    The defaults leave everything as it is.

    Attributes:
        length: Factor of L1, L2, L3 and L4, each drawn separately.
        mass: Factor of all links' masses and inertias, one for all.
        trunk: Factor of the trunk's mass; tasks on the ground only.
        friction: Factor of the friction of foot and floor; tasks on the ground only.
        kp: Factor of the servos' position gain.
        kd: Factor of the servos' derivative gain.
        delay: Delay on top of the servos' own [s].
    """

    length: Range = (1.0, 1.0)
    mass: Range = (1.0, 1.0)
    trunk: Range = (1.0, 1.0)
    friction: Range = (1.0, 1.0)
    kp: Range = (1.0, 1.0)
    kd: Range = (1.0, 1.0)
    delay: Range = (0.0, 0.0)

    def __post_init__(self) -> None:
        for name in self.__struct_fields__:
            pair = getattr(self, name)
            if not (isinstance(pair, (tuple, list)) and len(pair) == 2):
                raise ArgumentError(f"{name} must be two numbers (low, high), got {pair!r}")
            late = name == "delay"
            low = 0.0 if late else 0.1
            high = 1.0 if late else 10.0
            unit = "s" if late else ""
            check_number(f"{name}[0]", pair[0], unit, low=low, high=high)
            check_number(f"{name}[1]", pair[1], unit, low=float(pair[0]), high=high)

    def drawn(self, task: Task, seed: int) -> Task:
        """Return a task with its leg, servos and ground drawn, on the same path.

        Args:
            task: The nominal task.
            seed: Seed of the draw: equal seeds draw equal legs.
        """
        random = np.random.default_rng(seed)
        # Every range takes its draws, wide or not: so widening one leaves the others' numbers.
        factor = {
            name: random.uniform(*getattr(self, name), size=4 if name == "length" else 1).tolist()
            for name in self.__struct_fields__
        }
        (kp,) = factor["kp"]
        (kd,) = factor["kd"]
        (delay,) = factor["delay"]
        servo = msgspec.structs.replace(
            task.servo,
            kp=task.servo.kp * kp,
            kd=task.servo.kd * kd,
            delay=task.servo.delay + delay,
        )
        ground = {}

        if isinstance(task, Grounded):
            ground = {
                "mass": task.mass * factor["trunk"][0],
                "friction": task.friction * factor["friction"][0],
            }

        leg = _leg(task.leg, factor["length"], factor["mass"][0])
        # Resolved before the leg is replaced: a default path follows the leg.
        return msgspec.structs.replace(task.resolved(), leg=leg, servo=servo, **ground)


def _leg(leg: FiveBar, lengths: list[float], mass: float) -> FiveBar:
    """Return a leg with L1..L4 and its masses multiplied."""
    longer = {f"L{i}": getattr(leg, f"L{i}") * by for i, by in enumerate(lengths, start=1)}
    heavier = {"density": leg.density * mass}
    # Masses that are given outright do not come from the density.
    if leg.mass is not None:
        heavier = {"mass": tuple(m * mass for m in leg.mass)}
        if leg.inertia is not None:
            heavier["inertia"] = tuple(i * mass for i in leg.inertia)
    return replace(leg, **longer, **heavier)
