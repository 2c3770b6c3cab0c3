"""Friction that changes from step to step: how much each gear resists at most in the next step.

MuJoCo's dry friction is implicit: it holds a joint at rest exactly, up to a largest torque. That
torque comes from the rate before the step and from the torques of the step before, so that it is
late by one timestep where the load changes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import msgspec
import mujoco
import numpy as np
from mujoco.batch import MODEL_FIELDS, Batch
from numpy.typing import NDArray

from fivebar_sim.arrays import Array
from fivebar_sim.control.friction import Friction, FrictionArrays
from fivebar_sim.dynamics.gears import Bars, Foot, Through, standing, through
from fivebar_sim.model.feet import POSE, Hips, walking
from fivebar_sim.model.friction import friction_law

RECORDED = ("qfrc_constraint", "qfrc_bias", "qfrc_actuator", "actuator_force")
"""What has to be known of a step."""

LEAST = 1e-12
"""Largest friction of a gear that has none at the time [N m]: MuJoCo must not leave it out."""


class Step(NamedTuple):
    """A step, as the gears need it; (n, ...) each.

    Attributes:
        q, v: State before it: qpos and qvel.
        q_next, v_next: State after it.
        ctrl: Its commands.
        found: What MuJoCo had in it, by the names of `RECORDED`, and "sensordata".
    """

    q: Array
    v: Array
    q_next: Array
    v_next: Array
    ctrl: Array
    found: Mapping[Any, Array]


class Gears:
    """The gears of n legs or robots, k legs each, and what passed through them in the last step.

    Args:
        models: Each one's model.
        ground: Where sensordata has the ground's force, (x, z) of a leg, (x, y, z) of each leg of a
            robot; empty without a ground.

    Attributes:
        dofs: The motors' joints in a model's degrees of freedom, A and E of each leg.
        memory: Torques of the motors, and those from outside, in the last step [N m], (n, 2, 2 k).
    """

    def __init__(self, models: Sequence[mujoco.MjModel], ground: Sequence[int]) -> None:
        first = models[0]
        laws = [friction_law(model) for model in models]
        self._law = FrictionArrays.named(
            np.array([_numbers(model) for model in models]).T[..., None]
        )
        # A gear without friction of its own must stay without, so that its leg keeps its bits.
        self._least = np.array([[0.0 if law is None else LEAST] for law in laws])

        fronts = fronts_of(first)
        self._legs = len(fronts)
        self._bars = bars_of(models)
        self._motors = _Motors.of(models)
        self._ground = list(ground)
        self._hips = Hips.of(models, fronts) if fronts[0] else None

        self._joints = slice(-4 * self._legs, None)
        self._turning = slice(-4 * self._legs, None, 2)
        self._own = slice(-2 * self._legs, None)
        self.dofs = dofs_of(first)
        self.memory = np.zeros((len(models), 2, 2 * self._legs))

    @classmethod
    def of(cls, models: Sequence[mujoco.MjModel], ground: Sequence[int]) -> Gears | None:
        """Return the gears of some models; None where no friction changes."""
        return (
            cls(models, ground)
            if any(friction_law(model) is not None for model in models)
            else None
        )

    def restart(self, rows: NDArray[np.int64]) -> None:
        """Forget what passed through some legs' gears: they begin at rest, without load."""
        self.memory[rows] = 0.0

    def largest(self, v: Array) -> Array:
        """Return how much the gears resist at most in the next step [N m], (n, 2 k).

        Args:
            v: qvel before it, (n, nv).
        """
        torque = self.memory[:, 0]
        outer = self.memory[:, 1]
        # What broke down is found later; here it must only not become another error.
        with np.errstate(all="ignore"):
            found = self._law.largest(torque, outer, v[:, self._turning])
        return np.maximum(np.where(np.isfinite(found), found, 0.0), self._least)

    def took(self, step: Step) -> None:
        """Remember a step."""
        with np.errstate(all="ignore"):
            memory = np.empty_like(self.memory)
            memory[:, 0] = self._motors.torque(step)
            memory[:, 1] = self._outer(step)

        # Who kept the last one has it still.
        self.memory = memory

    def _outer(self, step: Step) -> Array:
        """Return the torque from outside at each motor's joint [N m], (n, 2 k).

        Weight, centripetal torques, and all that constraints and pushes do but the gear itself.
        """
        q = step.q[:, self._joints].reshape(-1, 4)
        constraint = step.found["qfrc_constraint"][:, self._joints].reshape(-1, 4)
        parts: Through = through(self._bars, q, constraint, self._feet(step, q))
        pushed = (
            step.found["qfrc_actuator"][:, self.dofs] - step.found["actuator_force"][:, self._own]
        )
        outer = parts.outer.reshape(len(step.q), -1)
        return outer + pushed - step.found["qfrc_bias"][:, self.dofs]

    def _feet(self, step: Step, q: Array) -> Foot | None:
        """Return what the ground does to the feet; None without a ground."""
        force = step.found["sensordata"][:, self._ground]
        if self._hips is None:
            hip = step.q[:, 0] if step.q.shape[1] > 4 else np.zeros(len(step.q))
            return standing(self._bars, q, force, hip)
        # A trunk that is held has no place in qpos, and its feet no floor.
        if step.q.shape[1] < POSE + 4 * self._legs:
            return None
        shape = (len(q) // self._legs, self._legs)
        pose = step.q[:, :POSE]
        return walking(self._bars, self._hips, q.reshape(*shape, 4), pose, force.reshape(*shape, 3))


def fronts_of(model: mujoco.MjModel) -> tuple[str, ...]:
    """Return what the names of each leg of a model begin with; "" of a leg alone."""
    names = [model.joint(i).name for i in range(model.njnt)]
    return tuple(name.removesuffix("A") for name in names if name == "A" or name.endswith("_A"))


def dofs_of(model: mujoco.MjModel) -> list[int]:
    """Return the motors' degrees of freedom, A and E of each leg."""
    return [int(model.joint(f"{front}{m}").dofadr[0]) for front in fronts_of(model) for m in "AE"]


def _numbers(model: mujoco.MjModel) -> Array:
    """Return the numbers of a model's friction, as in `control.friction.NUMBERS`."""
    law = friction_law(model)
    if law is not None:
        return law
    constant = msgspec.structs.astuple(Friction(base=float(model.dof_frictionloss.max())))
    return np.array(constant[1:], dtype=np.float64)


class _Motors(NamedTuple):
    """The laws of motors as their models have them, (n, 2 k) each.

    Attributes:
        gain, bias, rate: Of the command, the angle and the rate, within the limit.
        limit: [N m].
        back_emf: Rate gain outside the limit [N m s/rad].
        late: Whether the spring acts at the end of a step, (n, 1).
    """

    gain: Array
    bias: Array
    rate: Array
    limit: Array
    back_emf: Array
    late: NDArray[np.bool_]

    @classmethod
    def of(cls, models: Sequence[mujoco.MjModel]) -> _Motors:
        dofs = dofs_of(models[0])
        own = slice(-len(dofs), None)
        numbers = FrictionArrays.named(np.array([_numbers(model) for model in models]).T).numbers
        ends = [
            np.where(model.actuator_forcelimited[own], model.actuator_forcerange[own, 1], np.inf)
            for model in models
        ]

        discrete = mujoco.mjtIntegrator.mjINT_DISCRETE
        return cls(
            np.array([model.actuator_gainprm[own, 0] for model in models]),
            np.array([model.actuator_biasprm[own, 1] for model in models]),
            np.array([model.actuator_biasprm[own, 2] for model in models]),
            np.array(ends),
            np.array([model.dof_damping[dofs] for model in models]) - numbers["viscous"][:, None],
            np.array([[model.opt.integrator == discrete] for model in models]),
        )

    def torque(self, step: Step) -> Array:
        """Return what each motor applied in a step [N m], as `control.servo.applied_torque`."""
        count = self.gain.shape[1]
        turning = slice(-2 * count, None, 2)
        q = np.where(self.late, step.q_next[:, turning], step.q[:, turning])
        v = step.v_next[:, turning]
        asked = self.gain * step.ctrl[:, -count:] + self.bias * q + self.rate * v
        return np.clip(asked, -self.limit, self.limit) - self.back_emf * v


def bars_of(models: Sequence[mujoco.MjModel]) -> Bars:
    """Return what places the joints of all legs of some models, (n k,) each."""
    # The legs of a robot are alike.
    fronts = fronts_of(models[0])
    first = fronts[0]

    def column(read: Any) -> Array:
        return np.repeat(np.array([float(read(model)) for model in models]), len(fronts))

    return Bars(
        L1=column(lambda m: m.body(f"{first}L2").pos[0]),
        L2=column(lambda m: m.site(f"{first}C_left").pos[0]),
        L3=column(lambda m: m.site(f"{first}C_right").pos[0]),
        L4=column(lambda m: m.body(f"{first}L3").pos[0]),
        along=column(lambda m: m.site(f"{first}foot").pos[0]),
        across=column(lambda m: m.site(f"{first}foot").pos[2]),
        base=column(lambda m: m.body(f"{first}L1").pos[0]),
        height=column(lambda m: m.body(f"{first}L1").pos[2]),
        foot_radius=column(lambda m: m.geom(f"{first}foot").size[0]),
    )


def spread(batch: Batch, models: Sequence[mujoco.MjModel]) -> None:
    """Give a batch the numbers in which its models differ, and a friction for each simulation.

    Models of one's own could not be changed from step to step without setting all of them again.
    """
    first = models[0]
    batch.expand("dof_frictionloss")[:] = [model.dof_frictionloss for model in models]
    if all(model is first for model in models):
        return

    for name in MODEL_FIELDS:
        values = [_field(model, name) for model in models]
        # Only the numbers of the friction itself may be there or not, which MuJoCo does not read.
        alike = all(each.shape == values[0].shape for each in values)
        if alike and any(np.any(each != values[0]) for each in values[1:]):
            batch.expand(name)[:] = values


def _field(model: mujoco.MjModel, name: str) -> Any:
    """Return a model's field; those of its options are called "opt.<name>"."""
    option = name.removeprefix("opt.")
    return np.asarray(getattr(model if option == name else model.opt, option))


class Rubbing(Protocol):
    """As much of `mujoco.batch.Batch` as `rubbed` needs.

    Attributes:
        qpos, qvel: The state of each simulation, (nsim, ...).
    """

    qpos: Array
    qvel: Array

    def expand(self, name: str) -> Array:
        """Return a field of the simulations' models, (nsim, ...), to be written."""
        ...


Rollout = Callable[[Array, Sequence[Any]], dict[Any, Array]]
"""Takes steps with commands (nsim, n, nu), and returns what is recorded, (nsim, n, ...) each."""


def rubbed(
    batch: Rubbing, gears: Gears, ctrl: Array, record: Sequence[Any], rollout: Rollout
) -> dict[Any, Array]:
    """Return what `rollout` does, one step after the other, each with its own friction.

    Args:
        batch: The simulations.
        gears: Their gears.
        ctrl: Commands of every step, (nsim, N, nu).
        record: What to record.
        rollout: Takes steps.
    """
    known = (*RECORDED, "sensordata")
    wanted = tuple(dict.fromkeys([*record, *known]))
    friction = batch.expand("dof_frictionloss")
    # Views of the state, which change with every step.
    q_next = batch.qpos
    v_next = batch.qvel
    out: dict[Any, Array] = {}

    for k in range(ctrl.shape[1]):
        q = q_next.copy()
        v = v_next.copy()
        friction[:, gears.dofs] = gears.largest(v)
        rows = rollout(ctrl[:, k : k + 1], wanted)
        found = {item: rows[item][:, 0] for item in known}
        gears.took(Step(q, v, q_next, v_next, ctrl[:, k], found))
        for item in record:
            if item not in out:
                shape = (len(ctrl), ctrl.shape[1], *rows[item].shape[2:])
                out[item] = np.empty(shape, rows[item].dtype)
            out[item][:, k] = rows[item][:, 0]
    return out
