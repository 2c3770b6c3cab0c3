"""Faults as a mistake in the program would make them: how they are put in, and those of the model.

Each names the quickest shipped scenario whose check shows it; tests/faults_program.py has the rest.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from operator import attrgetter
from typing import Any, NamedTuple

import msgspec
import mujoco
import numpy as np
import pytest

from fivebar_sim import model, rollout
from fivebar_sim.arrays import Array
from fivebar_sim.simulation import plan as planning
from fivebar_sim.simulation.steps import Legs

Put = Callable[[pytest.MonkeyPatch], None]
Change = Callable[[Any], None]


class Fault(NamedTuple):
    """A mistake in the program.

    Attributes:
        what: In words.
        seen_by: The scenario that shows it in the short form of the tests.
        put: Makes the mistake.
    """

    what: str
    seen_by: str
    put: Put


def around(owner: Any, name: str, wrong: Callable[..., Any]) -> Put:
    """Return what makes a function or method wrong: it is given the right one and the arguments."""

    def put(patch: pytest.MonkeyPatch) -> None:
        right = getattr(owner, name)
        patch.setattr(owner, name, lambda *args, **keys: wrong(right, *args, **keys))

    return put


def around_property(owner: Any, name: str, wrong: Callable[..., Any]) -> Put:
    """Return what makes a property wrong: it is given the right value and its owner."""

    def put(patch: pytest.MonkeyPatch) -> None:
        right = getattr(owner, name)
        patch.setattr(owner, name, property(lambda self: wrong(right.fget(self), self)))

    return put


def built(*changes: Change) -> Put:
    """Return what changes every model that is built."""

    def wrong(right: Callable[..., Any], *args: Any, **keys: Any) -> Any:
        compiled = right(*args, **keys)
        for change in changes:
            change(compiled)
        return compiled

    return around(model, "build", wrong)


def scaled(field: str, factor: float | Array) -> Change:
    """Return what scales a field of a model, or each of its columns."""

    def change(compiled: Any) -> None:
        fixed(field, factor * attrgetter(field)(compiled))(compiled)

    return change


def fixed(field: str, value: Any) -> Change:
    """Return what sets a field of a model."""

    def change(compiled: Any) -> None:
        owner, _, name = field.rpartition(".")
        part = attrgetter(owner)(compiled) if owner else compiled
        if isinstance(getattr(part, name), np.ndarray):
            getattr(part, name)[...] = value
        else:
            setattr(part, name, value)

    return change


def stronger(factor: float) -> Change:
    """Return what scales the position gain of the servos."""

    def change(compiled: Any) -> None:
        position = compiled.actuator_biasprm[:, 1] != 0.0
        compiled.actuator_gainprm[position, 0] *= factor
        compiled.actuator_biasprm[position, 1] *= factor

    return change


def loop_impedance(compiled: Any) -> None:
    """Give the loop MuJoCo's default impedance."""
    compiled.eq_solimp[:, :2] = 0.9, 0.95


def ended_rail(compiled: Any) -> None:
    """End the rail at 68 mm, 4 mm above the lowest point of the hip in the trot."""
    slide = compiled.joint("hip_z").id
    compiled.jnt_limited[slide] = 1
    compiled.jnt_range[slide] = 0.068, 1.0


def other_integrator(compiled: Any) -> None:
    kinds = mujoco.mjtIntegrator
    discrete = compiled.opt.integrator == kinds.mjINT_DISCRETE
    compiled.opt.integrator = kinds.mjINT_IMPLICITFAST if discrete else kinds.mjINT_DISCRETE


def longer(**factors: float) -> Put:
    """Return what builds models whose lengths or angles are not quite the leg's."""

    def wrong(right: Callable[..., Any], leg: Any, **keys: Any) -> Any:
        return right(replace(leg, **{k: f * getattr(leg, k) for k, f in factors.items()}), **keys)

    return around(model, "build", wrong)


def unloaded(patch: pytest.MonkeyPatch) -> None:
    """Build models without their payload."""

    def wrong(right: Callable[..., Any], leg: Any, *, scene: Any, **keys: Any) -> Any:
        return right(leg, scene=msgspec.structs.replace(scene, mass=0.0), **keys)

    around(model, "build", wrong)(patch)


def commanded(change: Callable[[Array], Array]) -> Put:
    """Return what changes the commands on their way to MuJoCo."""

    def put(patch: pytest.MonkeyPatch) -> None:
        for name in ("advance", "once"):
            around(Legs, name, lambda right, legs, ctrl: right(legs, change(ctrl)))(patch)

    return put


def swapped(ctrl: Array) -> Array:
    return np.concatenate([ctrl[..., :-2], ctrl[..., :-3:-1]], axis=-1)


def a_step_late(right: Callable[..., Any], *args: Any, **keys: Any) -> Any:
    """Answer with rows of which each is that of the step before."""
    rows = right(*args, **keys)
    return np.concatenate([rows[:1], rows[:-1]])


def not_pushed(right: Callable[..., Any], scenario: Any) -> Any:
    plan = right(scenario)
    return plan._replace(pushes=0.0 * plan.pushes)


def on_the_floor(right: Callable[..., Array], scenario: Any, scene: Any, q: Array) -> Array:
    return right(scenario, msgspec.structs.replace(scene, drop=0.0), q)


LENGTHS = {name: 1.01 for name in ("L1", "L2", "L3", "L4", "L5", "L6")}
ELLIPSE = "classic-ellipse"
EIGHT = "extended-figure-eight"
TROT = "treadmill-trot"

MODEL = (
    Fault("kp of the motors 10 % low", "payload-ellipse", built(stronger(0.9))),
    Fault("kd of the motors 10 % high", ELLIPSE, built(scaled("dof_damping", 1.1))),
    Fault("links 2 % heavy", "classic-figure-eight", built(scaled("body_mass", 1.02))),
    Fault("inertias 5 % high", "minitaur-trot", built(scaled("body_inertia", 1.05))),
    Fault("armature 10 % high", "q8bot-trot", built(scaled("dof_armature", 1.1))),
    Fault("armature left out", "q8bot-xl330", built(fixed("dof_armature", 0.0))),
    Fault("gravity upside down", ELLIPSE, built(scaled("opt.gravity", -1.0))),
    Fault("loop half as stiff", ELLIPSE, built(scaled("eq_solref", 2.0))),
    Fault("loop of MuJoCo's default impedance", "payload-ellipse", built(loop_impedance)),
    Fault("solver stops after an iteration", "rail-landing", built(fixed("opt.iterations", 1))),
    Fault("the other integrator", "classic-edge-line", built(other_integrator)),
    Fault("half the timestep", ELLIPSE, built(scaled("opt.timestep", 0.5))),
    Fault("L1 1 % long", ELLIPSE, longer(L1=1.01)),
    Fault("L2 1 % long", ELLIPSE, longer(L2=1.01)),
    Fault("L5 1 % long", ELLIPSE, longer(L5=1.01)),
    Fault("L6 1 % long", "minitaur-treadmill", longer(L6=1.01)),
    Fault("all lengths 1 % long", ELLIPSE, longer(**LENGTHS)),
    Fault("foot bent to the other side", EIGHT, longer(bend=-1.0)),
    Fault("base tilted to the other side", EIGHT, longer(tilt=-1.0)),
    Fault("payload left out", "payload-ellipse", unloaded),
    Fault("torque limit left out", "airhockey-pd", built(fixed("actuator_forcelimited", 0))),
    Fault("gear friction left out", "q8bot-xl330", built(fixed("dof_frictionloss", 0.0))),
    Fault("foot friction 10 % low", TROT, built(scaled("geom_friction", 0.9))),
    Fault("belt runs the other way", TROT, built(scaled("geom_surfacevel", -1.0))),
    Fault("belt 2 % fast", TROT, built(scaled("geom_surfacevel", 1.02))),
    Fault("rail that ends in the stance", TROT, built(ended_rail)),
    Fault("floor half as stiff", "rail-landing", built(scaled("geom_solref", 2.0))),
    Fault("drop left out", "rail-landing", around(planning, "_above_ground", on_the_floor)),
    Fault("commands a step late", ELLIPSE, around(planning, "sent_setpoints", a_step_late)),
    Fault("motors swapped", ELLIPSE, commanded(swapped)),
    Fault("commands 0.1 % large", "payload-ellipse", commanded(lambda ctrl: 1.001 * ctrl)),
    Fault(
        "push on the foot left out", "extended-stance-force", around(rollout, "plan", not_pushed)
    ),
)
