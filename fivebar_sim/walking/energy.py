"""The energy balance of a robot: as that of a leg, with MuJoCo's masses instead of formulas.

`metrics.energy` says how a step is balanced. Here M, c and the potential are MuJoCo's own, of trunk
and legs together, at the recorded states; what acts is the record's: a torque or a force that
MuJoCo did not apply, or one that the record lacks, opens the balance.
"""

from __future__ import annotations

import mujoco
import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.metrics.columns import motors
from fivebar_sim.metrics.energy import STILL, Balance
from fivebar_sim.robots import LEGS, Floor
from fivebar_sim.robots.columns import FORCE_COLUMNS, of_leg
from fivebar_sim.robots.floor import load
from fivebar_sim.robots.hips.motors import column
from fivebar_sim.walking.record import before, wrench
from fivebar_sim.walking.walk import Walk


def balance(went: Walk) -> Balance:
    """Return the works of every step, and what the energies gained.

    Args:
        went: What the robot did.
    """
    planned = went.plan
    h = planned.sim.timestep
    v = went.states.qvel[0]
    w = 0.5 * (before(np.zeros(v.shape[1]), v) + v)
    meter = _Meter(went)
    kinetic, potential = meter.energies()
    ground = meter.ground(w) if isinstance(planned.scene, Floor) else np.zeros(len(v))
    torque = np.concatenate([motors(of_leg(went.record, leg), "torque") for leg in LEGS], axis=1)
    own = _motors(planned.model)
    turning = w[:, own]
    motor = np.sum(torque * turning, axis=1)
    for i, each in enumerate(planned.robot.hip_motors):
        hips = [planned.robot.joints * (k - len(LEGS)) + i for k in range(len(LEGS))]
        turned = [went.record[f"{leg}_{column('torque', each)}"] for leg in LEGS]
        motor += np.sum(np.stack(turned, axis=1) * w[:, hips], axis=1)

    # MuJoCo counts the gears' viscous friction as damping, which a motor has too.
    constraint = went.states.constraint[0].copy()
    constraint[:, own] -= planned.robot.servo.gear.viscous * v[:, own]

    start = planned.start
    moved = np.abs(went.states.qpos[0] - start).max() > STILL
    weight = (planned.robot.mass + load(planned.scene)) * float(
        np.linalg.norm(planned.model.opt.gravity)
    )
    return Balance(
        motor=h * motor,
        force=h * meter.pushed(w),
        ground=ground,
        constraints=h * np.sum(constraint * w, axis=1) - ground,
        step=h * meter.given_away(w),
        kinetic=np.diff(kinetic),
        potential=np.diff(potential),
        moved=bool(moved),
        lift=weight * planned.robot.leg.size,
    )


def _motors(model: mujoco.MjModel) -> list[int]:
    """Return where the rates of the motors are in qvel, in the order of ctrl."""
    motors = model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT.value
    joints = model.actuator_trnid[motors, 0]
    return [int(model.jnt_dofadr[joint]) for joint in joints]


class _Meter:
    """MuJoCo's masses at the states of a run.

    Args:
        went: What the robot did.
    """

    def __init__(self, went: Walk) -> None:
        self._model = went.plan.model
        self._data = mujoco.MjData(self._model)
        self._went = went
        self._q = np.concatenate([went.plan.start[None], went.states.qpos[0]])
        v = went.states.qvel[0]
        self._v = np.concatenate([np.zeros((1, v.shape[1])), v])

    def energies(self) -> tuple[Array, Array]:
        """Return kinetic and potential energy before the first step and after each [J], (N + 1,).

        Rates belong to the middle of the step that they moved the robot by.
        """
        model = self._model
        data = self._data
        h = self._went.plan.sim.timestep
        found = np.empty((2, len(self._q)))

        for k, (q, v) in enumerate(zip(self._q, self._v, strict=True)):
            data.qpos[:] = q
            mujoco.mj_integratePos(model, data.qpos, v, -0.5 * h)
            data.qvel[:] = v
            # What the energies need of `mj_forward`, and no more.
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            mujoco.mj_crb(model, data)
            mujoco.mj_energyVel(model, data)
            found[0, k] = data.energy[1]
            found[1, k] = -float(model.body_mass @ (data.xipos @ model.opt.gravity))
        return found[0], found[1]

    def given_away(self, w: Array) -> Array:
        """Return -(c(q, v) - c(q, w)) . w of every step [W], v the rates at its start, (N,)."""
        model = self._model
        data = self._data
        start = np.empty(model.nv)
        meant = np.empty(model.nv)
        found = np.empty(len(w))

        for k, rates in enumerate(w):
            data.qpos[:] = self._q[k]
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            # Gravity is in both, and goes out in the difference.
            for v, c in ((self._v[k], start), (rates, meant)):
                data.qvel[:] = v
                mujoco.mj_comVel(model, data)
                mujoco.mj_rne(model, data, 0, c)
            found[k] = -float((start - meant) @ rates)
        return found

    def pushed(self, w: Array) -> Array:
        """Return the power of the pushes on the trunk in every step [W], (N,)."""
        model = self._model
        data = self._data
        pushes = self._went.plan.pushes
        jac = np.empty((3, model.nv))
        found = np.zeros(len(w))

        for k in np.flatnonzero(pushes.any(axis=1)):
            data.qpos[:] = self._q[k]
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            for i, force in enumerate(pushes[k].reshape(-1, 3)):
                mujoco.mj_jacSite(model, data, jac, None, model.site(f"push_{i}").id)
                found[k] += float(force @ (jac @ w[k]))
        return found

    def ground(self, w: Array) -> Array:
        """Return the work of the floor on all feet in every step [J], (N,)."""
        model = self._model
        data = self._data
        h = self._went.plan.sim.timestep
        record = self._went.record
        if self._went.depths is not None:
            return self._uneven(w)
        force = np.stack(
            [np.stack([record[f"{leg}_{c}"] for c in FORCE_COLUMNS], axis=-1) for leg in LEGS],
            axis=1,
        )
        geoms = [model.geom(f"{leg}_foot").id for leg in LEGS]
        jac = np.empty((3, model.nv))
        found = np.zeros(len(w))
        for k in np.flatnonzero(force.any(axis=(1, 2))):
            data.qpos[:] = self._q[k]
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            for foot, geom in zip(force[k], geoms, strict=True):
                if not foot.any():
                    continue
                point = data.geom_xpos[geom].copy()
                # MuJoCo puts the contact in the middle of the overlap with the floor.
                point[2] = 0.5 * (point[2] - model.geom_size[geom, 0])
                mujoco.mj_jac(model, data, jac, None, point, int(model.geom_bodyid[geom]))
                found[k] += h * float(foot @ (jac @ w[k]))
        return found

    def _uneven(self, w: Array) -> Array:
        """Return the work of uneven ground, whose force is known with its torque and place [J]."""
        model = self._model
        data = self._data
        h = self._went.plan.sim.timestep
        wrenches = np.stack([wrench(self._went.states, k) for k in range(len(LEGS))], axis=1)
        bodies = [int(model.geom_bodyid[model.geom(f"{leg}_foot").id]) for leg in LEGS]
        moves = np.empty((3, model.nv))
        turns = np.empty((3, model.nv))
        found = np.zeros(len(w))

        for k in np.flatnonzero(wrenches[..., :3].any(axis=(1, 2))):
            data.qpos[:] = self._q[k]
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            for acting, body in zip(wrenches[k], bodies, strict=True):
                if not acting[:3].any():
                    continue
                mujoco.mj_jac(model, data, moves, turns, acting[6:], body)
                power = acting[:3] @ (moves @ w[k]) + acting[3:6] @ (turns @ w[k])
                found[k] += h * float(power)
        return found
