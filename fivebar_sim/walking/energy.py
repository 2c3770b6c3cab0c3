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
from fivebar_sim.robots.columns import of_leg
from fivebar_sim.robots.floor import load
from fivebar_sim.robots.hips.motors import column
from fivebar_sim.walking.poses import Pose, Poses
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
    meter = _Meter(went, w)
    kinetic, potential = meter.energies()
    given_away, pushed, ground = meter.works()
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
        force=pushed,
        ground=ground,
        constraints=h * np.sum(constraint * w, axis=1) - ground,
        step=given_away,
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
        w: Rates in the middle of each step, (N, nv).
    """

    def __init__(self, went: Walk, w: Array) -> None:
        self._went = went
        self._model = went.plan.model
        self._w = w
        self._q = np.concatenate([went.plan.start[None], went.states.qpos[0]])
        v = went.states.qvel[0]
        self._v = np.concatenate([np.zeros((1, v.shape[1])), v])
        self._poses = Poses(self._model)

    def energies(self) -> tuple[Array, Array]:
        """Return kinetic and potential energy before the first step and after each [J], (N + 1,).

        Rates belong to the middle of the step that they moved the robot by.
        """
        model = self._model
        h = self._went.plan.sim.timestep
        middle = self._q.copy()
        for q, v in zip(middle, self._v, strict=True):
            mujoco.mj_integratePos(model, q, v, -0.5 * h)

        found = np.empty((2, len(middle)))
        for rows, at in self._poses.blocks(middle, self._v):
            found[0, rows] = at.kinetic
            heights = at.centers @ model.opt.gravity
            found[1, rows] = -np.sum(model.body_mass * heights, axis=1)
        return found[0], found[1]

    def works(self) -> tuple[Array, Array, Array]:
        """Return what the steps give away, and the works of pushes and floor in each [J], (N,).

        A step gives away -h (c(q, v) - c(q, w)) . w, v the rates at its start.
        """
        w = self._w
        h = self._went.plan.sim.timestep
        start = self._q[:-1]
        turning = np.empty_like(w)
        for rows, at in self._poses.blocks(start, self._v[:-1]):
            turning[rows] = at.bias

        found = np.empty((3, len(w)))
        for rows, at in self._poses.blocks(start, w):
            found[0, rows] = -np.sum((turning[rows] - at.bias) * w[rows], axis=1)
            found[1, rows] = self._pushed(at, rows)
            found[2, rows] = self._ground(at, rows)
        found *= h
        return found[0], found[1], found[2]

    def _pushed(self, at: Pose, rows: slice) -> Array:
        """Return the power of the pushes on the trunk in some steps [W], (n,)."""
        pushes = self._went.plan.pushes[rows]
        power = np.zeros(len(pushes))
        if not pushes.any():
            return power

        for i, force in enumerate(np.split(pushes, pushes.shape[1] // 3, axis=1)):
            site = self._model.site(f"push_{i}").id
            body = int(self._model.site_bodyid[site])
            power += np.sum(force * at.velocity(body, at.sites[:, site]), axis=1)
        return power

    def _ground(self, at: Pose, rows: slice) -> Array:
        """Return the power of the floor on all feet in some steps [W], (n,)."""
        went = self._went
        model = self._model
        power = np.zeros(rows.stop - rows.start)
        if not isinstance(went.plan.scene, Floor):
            return power

        for k, leg in enumerate(LEGS):
            foot = model.geom(f"{leg}_foot").id
            body = int(model.geom_bodyid[foot])
            acting = wrench(went.states, k)[rows]
            if went.depths is not None:
                # Uneven ground tells its force's place, and a torque about it.
                power += np.sum(acting[:, 3:6] * at.turning(body), axis=1)
                point = acting[:, 6:]
            else:
                point = at.geoms[:, foot].copy()
                # MuJoCo puts the contact in the middle of the overlap with the floor.
                point[:, 2] = 0.5 * (point[:, 2] - model.geom_size[foot, 0])
            force = acting[:, :3]
            power += np.sum(force * at.velocity(body, point), axis=1)
        return power
