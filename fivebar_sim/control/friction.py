"""Friction of a servo's gear as it is measured: with speed, with load, and with its direction.

The models are M1 to M6 of "Extended Friction Models for the Physics Simulation of Servo Actuators"
(Duclusaud, Passault and others, ICRA 2025, arXiv 2410.08650). A gear resists with up to

    F = base + load part + s (stribeck + load part at rest + quadratic part)

and with viscous |rate| on top, where s = exp(-(|rate| / rate_stribeck)^alpha) is 1 at rest and
goes to 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Literal, get_args

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim.arrays import Array
from fivebar_sim.checks import check_number
from fivebar_sim.errors import ArgumentError, unknown

Kind = Literal["constant", "stribeck", "load", "directional"]
"""How much a model knows: each one knows what those before it do."""

PLAIN = ("base", "viscous")
AT_REST = ("stribeck", "rate_stribeck", "alpha")
LOADED = ("load", "load_stribeck")
DIRECTED = (
    *("motor", "external", "motor_stribeck", "external_stribeck"),
    *("motor_quadratic", "external_quadratic"),
)

TAKES: dict[str, tuple[str, ...]] = {
    "constant": PLAIN,
    "stribeck": PLAIN + AT_REST,
    "load": PLAIN + AT_REST + LOADED,
    "directional": PLAIN + AT_REST + DIRECTED,
}
"""The keys that each model has a use for."""


class Friction(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Friction of a gear, at its output; t is the motor's torque, x the one from outside.

        constant     F = base
        stribeck     F = base + s stribeck
        load         F = base + load |x - t| + s (stribeck + load_stribeck |x - t|)
        directional  F = base + |external x - motor t|
                         + s (stribeck + |external_stribeck x - motor_stribeck t| + quadratic)

    where quadratic, only if t and x oppose each other, is external_quadratic x^2 where the motor
    drives, |x| < |t|, and motor_quadratic t^2 where it is driven.

    Attributes:
        model: How F depends on rate and load: "constant", "stribeck", "load" or "directional".
        base: Friction of a gear that turns without load [N m].
        viscous: Friction per rate, in all models [N m s/rad].
        stribeck: What comes on top at rest [N m].
        rate_stribeck: Rate at which that has gone [rad/s].
        alpha: How suddenly it goes.
        load: Friction per torque that passes through the gear.
        load_stribeck: What comes on top of it at rest.
        motor, external: Friction per torque of the motor, and per torque from outside.
        motor_stribeck, external_stribeck: What comes on top of them at rest.
        motor_quadratic: Friction at rest per torque squared of a driven motor [1/(N m)].
        external_quadratic: Friction at rest per outer torque squared of a driving one [1/(N m)].
    """

    model: Kind = "constant"
    base: float = 0.0
    viscous: float = 0.0
    stribeck: float = 0.0
    rate_stribeck: float = 0.2
    alpha: float = 1.0
    load: float = 0.0
    load_stribeck: float = 0.0
    motor: float = 0.0
    external: float = 0.0
    motor_stribeck: float = 0.0
    external_stribeck: float = 0.0
    motor_quadratic: float = 0.0
    external_quadratic: float = 0.0

    def __post_init__(self) -> None:
        if self.model not in get_args(Kind):
            raise ArgumentError(unknown("friction.model", str(self.model), get_args(Kind)))
        for name, default in _numbers():
            value = getattr(self, name)
            if name in ("rate_stribeck", "alpha"):
                check_number(f"friction.{name}", value, "", low=1e-6, high=1e6)
            elif name in ("base", "viscous", "stribeck"):
                check_number(f"friction.{name}", value, "", low=0.0, high=1e6)
            else:
                # From 1 on the gear could not be driven by any torque.
                check_number(f"friction.{name}", value, "", low=0.0, high=1.0)
            if value != default and name not in TAKES[self.model]:
                raise ArgumentError(
                    f"friction.{name} has no use in model {self.model!r}, which takes "
                    f"{', '.join(TAKES[self.model])}"
                )

    def geared(self, ratio: float) -> Friction:
        """Return the friction as it is behind a further gear without friction of its own.

        Args:
            ratio: How much slower and stronger the new output is.
        """
        factors = {
            **dict.fromkeys(("base", "stribeck"), ratio),
            "viscous": ratio**2,
            **dict.fromkeys(
                ("rate_stribeck", "motor_quadratic", "external_quadratic"), 1.0 / ratio
            ),
        }
        return msgspec.structs.replace(
            self, **{name: factor * getattr(self, name) for name, factor in factors.items()}
        )

    @property
    def changes(self) -> bool:
        """Whether the largest friction changes from step to step."""
        return self.model != "constant"


@cache
def _numbers() -> tuple[tuple[str, float], ...]:
    """Return name and default of every number of a friction: every run makes some frictions."""
    return tuple((field.name, field.default) for field in msgspec.structs.fields(Friction)[1:])


NUMBERS = tuple(name for name, _ in _numbers())
"""The keys of `Friction` but the model."""


@dataclass(frozen=True, slots=True)
class FrictionArrays:
    """Struct-of-arrays view of the friction of n gears, attributes as in `Friction`, (n,) each.

    Attributes:
        numbers: The keys of `Friction` but the model; those that a model does not take are 0.
    """

    numbers: dict[str, Array]

    @classmethod
    def of(cls, gears: Sequence[Friction]) -> FrictionArrays:
        """Return the arrays of some gears."""
        return cls({name: np.array([getattr(gear, name) for gear in gears]) for name in NUMBERS})

    @classmethod
    def named(cls, values: Sequence[Array] | Array) -> FrictionArrays:
        """Return the arrays of values in the order of `NUMBERS`."""
        named = zip(NUMBERS, values, strict=True)
        return cls({name: np.asarray(each, dtype=np.float64) for name, each in named})

    def largest(self, torque: ArrayLike, outer: ArrayLike, rate: ArrayLike) -> Array:
        """Return F, without the viscous part [N m].

        Args:
            torque: Of the motor [N m].
            outer: From outside: of all that acts on the joint but motor and friction [N m].
            rate: Of the joint [rad/s].
        """
        k = self.numbers
        t = np.asarray(torque, dtype=np.float64)
        x = np.asarray(outer, dtype=np.float64)
        speed = np.abs(np.asarray(rate, dtype=np.float64))
        # A rate of a breakdown may overflow: s is 0 there all the same.
        with np.errstate(over="ignore"):
            s = np.exp(-((speed / k["rate_stribeck"]) ** k["alpha"]))

        passed = np.abs(x - t)
        moving = k["base"] + k["load"] * passed + np.abs(k["external"] * x - k["motor"] * t)
        rest = k["stribeck"] + k["load_stribeck"] * passed
        rest = rest + np.abs(k["external_stribeck"] * x - k["motor_stribeck"] * t)
        drives = np.abs(x) < np.abs(t)
        driven = np.abs(x) > np.abs(t)
        square = drives * k["external_quadratic"] * x**2 + driven * k["motor_quadratic"] * t**2
        return moving + s * (rest + square * (np.sign(x) != np.sign(t)))


def as_friction(value: float | Friction) -> Friction:
    """Return the friction of a servo's table, of which a number alone is a constant one [N m]."""
    return value if isinstance(value, Friction) else Friction(base=value)
