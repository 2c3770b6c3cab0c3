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
from fivebar_sim.dynamics.gears import Bars, Through, through
from fivebar_sim.metrics.columns import MOTORS_FROM_END
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
    """The gears of legs, and what passed through them in the last step.

    Args:
        models: Each leg's model.
        ground: Where sensordata has the ground's force (x, z); empty without a ground.

    Attributes:
        dofs: The two joints in a model's degrees of freedom.
    """

    def __init__(self, models: Sequence[mujoco.MjModel], ground: Sequence[int]) -> None:
        first = models[0]
        laws = [friction_law(model) for model in models]
        self._law = FrictionArrays.named(
            np.array([_numbers(model) for model in models]).T[..., None]
        )
        # A gear without friction of its own must stay without, so that its leg keeps its bits.
        self._least = np.array([[0.0 if law is None else LEAST] for law in laws])
        self._bars = bars_of(models)
        self._motors = _Motors.of(models)
        self._ground = list(ground)
        self.dofs = [int(first.joint(name).dofadr[0]) for name in "AE"]
        self.memory = np.zeros((len(models), 2, 2))

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
        """Return how much the gears resist at most in the next step [N m], (n, 2).

        Args:
            v: qvel before it, (n, nv).
        """
        torque = self.memory[:, 0]
        outer = self.memory[:, 1]
        # What broke down is found later; here it must only not become another error.
        with np.errstate(all="ignore"):
            found = self._law.largest(torque, outer, v[:, MOTORS_FROM_END])
        return np.maximum(np.nan_to_num(found, posinf=LEAST), self._least)

    def took(self, step: Step) -> None:
        """Remember a step."""
        with np.errstate(all="ignore"):
            self.memory = np.stack([self._motors.torque(step), self._outer(step)], axis=1)

    def _outer(self, step: Step) -> Array:
        """Return the torque from outside at each motor's joint [N m], (n, 2).

        Weight, centripetal torques, and all that constraints and pushes do but the gear itself.
        """
        ground = step.found["sensordata"][:, self._ground] if self._ground else step.q[:, :0]
        hip = step.q[:, 0] if step.q.shape[1] > 4 else np.zeros(len(step.q))
        constraint = step.found["qfrc_constraint"][:, -4:]
        parts: Through = through(self._bars, step.q[:, -4:], constraint, ground, hip)
        pushed = step.found["qfrc_actuator"][:, self.dofs] - step.found["actuator_force"][:, -2:]
        return parts.outer + pushed - step.found["qfrc_bias"][:, self.dofs]


def _numbers(model: mujoco.MjModel) -> Array:
    """Return the numbers of a model's friction, as in `control.friction.NUMBERS`."""
    law = friction_law(model)
    if law is not None:
        return law
    constant = msgspec.structs.astuple(Friction(base=float(model.dof_frictionloss.max())))
    return np.array(constant[1:], dtype=np.float64)


class _Motors(NamedTuple):
    """The laws of motors as their models have them, (n, 2) each.

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
        own = slice(-2, None)
        dofs = [int(models[0].joint(name).dofadr[0]) for name in "AE"]
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
        q = np.where(self.late, step.q_next[:, MOTORS_FROM_END], step.q[:, MOTORS_FROM_END])
        v = step.v_next[:, MOTORS_FROM_END]
        asked = self.gain * step.ctrl[:, -2:] + self.bias * q + self.rate * v
        return np.clip(asked, -self.limit, self.limit) - self.back_emf * v


def bars_of(models: Sequence[mujoco.MjModel]) -> Bars:
    """Return what places the joints of some models, (n,) each."""

    def column(read: Any) -> Array:
        return np.array([float(read(model)) for model in models])

    return Bars(
        L1=column(lambda m: m.body("L2").pos[0]),
        L2=column(lambda m: m.site("C_left").pos[0]),
        L3=column(lambda m: m.site("C_right").pos[0]),
        L4=column(lambda m: m.body("L3").pos[0]),
        along=column(lambda m: m.site("foot").pos[0]),
        across=column(lambda m: m.site("foot").pos[2]),
        height=column(lambda m: m.body("L1").pos[2]),
        foot_radius=column(lambda m: m.geom("foot").size[0]),
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
    wanted = tuple(dict.fromkeys([*record, *RECORDED, "sensordata"]))
    friction = batch.expand("dof_frictionloss")
    out: dict[Any, Array] = {}

    for k in range(ctrl.shape[1]):
        q = batch.qpos.copy()
        v = batch.qvel.copy()
        friction[:, gears.dofs] = gears.largest(v)
        rows = rollout(ctrl[:, k : k + 1], wanted)
        found = {item: each[:, 0] for item, each in rows.items()}
        gears.took(Step(q, v, batch.qpos, batch.qvel, ctrl[:, k], found))
        for item in record:
            shape = (len(ctrl), ctrl.shape[1], *rows[item].shape[2:])
            whole = out.setdefault(item, np.empty(shape, rows[item].dtype))
            whole[:, k] = rows[item][:, 0]
    return out
