"""How deep the parts of a robot are in uneven ground, after each step, as MuJoCo's geometry has it.

A flat floor needs none of this: there the lowest point of a part is known by formula.
"""

from __future__ import annotations

import mujoco
import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.model import robot_spec
from fivebar_sim.robots import LEGS, Robot, Scene

LINKS = ("L1", "L2", "L3", "L4", "L6")
"""Links that may come into the ground, beside the foot; not every leg has an L6."""

TRUNK = "trunk"


def depths(robot: Robot, scene: Scene, qpos: Array) -> dict[str, Array]:
    """Return how deep each part is in the ground [m], (N,), by "trunk", "FL foot", "FL link L1".

    Args:
        robot: The robot.
        scene: Where it is.
        qpos: MuJoCo's coordinates after each step, (N, nq).
    """
    spec = robot_spec(robot, scene)
    names = {TRUNK: TRUNK}
    for leg in LEGS:
        names[f"{leg}_foot"] = f"{leg} foot"
        names |= {f"{leg}_{link}": f"{leg} link {link}" for link in LINKS}
    for geom in spec.geoms:
        if geom.name in names:
            # The ground's geoms answer to it, and no part of a robot does.
            geom.contype = 1

    model = spec.compile()
    data = mujoco.MjData(model)
    part_of = [names.get(model.geom(k).name) for k in range(model.ngeom)]
    found = {part: np.zeros(len(qpos)) for part in names.values()}
    for k, q in enumerate(qpos):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        for pair, distance in zip(
            data.contact.geom.tolist(), data.contact.dist.tolist(), strict=True
        ):
            part = part_of[pair[0]] or part_of[pair[1]]
            assert part is not None
            found[part][k] = max(found[part][k], -distance)
    return found
